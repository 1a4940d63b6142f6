"""`esail run --estimate` tells what a run will cost and writes nothing; `esail info SCENE` points to it."""

import re

import pytest

from esail_jax.cli import main
from esail_jax.commands import estimate
from esail_jax.commands.estimate import Trial, estimate_text
from esail_jax.scenes.loading import load_scene

SMALL = [
    *("--set", "tethers.count=3", "--set", "tethers.elements=2", "--t-end", "20"),
    *("--set", "integrator.method=generalized-alpha"),
]


def test_the_rest_is_taken_to_go_like_the_beginning():
    """After a tenth of the time: ten times the steps and the time. The file grows with its rows, here from
    1 MiB without any to 1.5 MiB with 100 of 1,001, that is to 6 MiB."""
    scene = load_scene("baseline", {"integrator.t_end": 1000.0, "output.interval": 1.0})
    text = estimate_text(scene, Trial(100.0, 100, 25, 7.5, 12.0, 2**20, 3 * 2**19), 4.56e8)
    assert text.splitlines() == [
        "12 tethers x 5 elements, 1000 s, 1001 saved instants (from the first 100 s)",
        "  steps      250",
        "  time       02:00 after compiling, which took 7.5 s",
        "  memory     434.9 MiB, which does not grow with the run",
        "  file       6.0 MiB",
    ]


def test_a_short_run_is_counted_and_not_estimated():
    """If the trial has reached the end, the numbers are those of the run."""
    scene = load_scene("baseline", {"integrator.t_end": 100.0, "output.interval": 1.0})
    text = estimate_text(scene, Trial(100.0, 101, 1234, 7.5, 2.0, 10_000, 20_000), None)
    assert "the whole run was tried" in text and "steps      1234\n" in text and "memory" not in text
    assert text.endswith("file       19.5 KiB")


def test_steps_and_size_are_those_of_the_run(tmp_path, capsys, monkeypatch):
    """A whole trial tells the number of steps of `esail run`, and the size of its file to a tenth: the
    texts and times in the two files differ. The folder stays empty."""
    monkeypatch.chdir(tmp_path)
    assert main(["run", "baseline", *SMALL, "--estimate"]) == 0
    told = capsys.readouterr().out
    assert not list(tmp_path.iterdir())
    assert main(["run", "baseline", *SMALL, "-o", "run.h5"]) == 0
    steps = re.search(r"(\d+) steps in", capsys.readouterr().out)[1]
    assert re.search(r"steps +(\S+)", told)[1] == steps
    size = float(re.search(r"file +(\S+) KiB", told)[1]) * 2**10
    assert size == pytest.approx((tmp_path / "run.h5").stat().st_size, rel=0.1)


def test_a_trial_ends_after_its_time(monkeypatch):
    """Without patience it ends with the first chunk of a long run."""
    monkeypatch.setattr(estimate, "SECONDS", 0.0)
    small = {"tethers.count": 3, "tethers.elements": 2, "integrator.method": "generalized-alpha"}
    found = estimate.tried(load_scene("baseline", {**small, "integrator.t_end": 1e8}), ())
    assert 0.0 < found.reached < 1e6 and found.rows > 0 and found.size > found.empty


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "`-o RUN.h5` must be given (or `--estimate`), but is missing"),
        (["--estimate", "-o", "x.h5"], "`-o` must be left out with --estimate, but is given"),
        (["--estimate", "--resume"], "`--resume` must be left out with --estimate, but is given"),
        (["--estimate", "--stability"], "`--stability` must be left out with --estimate, but is given"),
    ],
)
def test_options_that_do_not_fit_together(
    options, message, tmp_path, capsys, monkeypatch, nothing_compiles
):
    """Nothing that is given is ignored: an estimate writes no file and continues none."""
    monkeypatch.chdir(tmp_path)
    assert main(["run", "baseline", *options]) == 2
    assert capsys.readouterr().err == f"{message}\n" and not list(tmp_path.iterdir())


def test_a_built_in_scene_is_described_by_its_name(capsys, tmp_path, monkeypatch, nothing_compiles):
    """`esail info baseline` needs no file. A file of this name comes first."""
    monkeypatch.chdir(tmp_path)
    assert main(["info", "baseline"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("baseline: Scene: 12 tethers of 5 cable elements")
    assert lines[4] == "  cost      steps, time, memory and file size: esail run baseline --estimate"
    (tmp_path / "baseline").write_text("no HDF5")
    assert main(["info", "baseline"]) == 2
    assert "`baseline` must be" in capsys.readouterr().err
