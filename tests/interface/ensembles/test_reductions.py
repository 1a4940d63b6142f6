"""Ensembles that keep numbers in place of histories."""

import csv

import h5py
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.ensembles import join, load_ensemble, run_ensemble
from esail_jax.ensembles.driver import drive
from esail_jax.ensembles.merging import merge_pieces, size_of
from esail_jax.ensembles.reductions import REDUCTIONS, names_of, reduced
from esail_jax.ensembles.task import task_of
from support import greedy
from support.made_up_engine import MadeUp, piece_of
from support.small_ensemble import VARY

NAMES = ("mean", "max", "min", "final", "support.greedy:swing")


def test_the_numbers():
    """The mean over time is that of straight lines between the instants, which need not be equidistant: of
    t on (0, 1, 4) it is 2, whatever the middle instant. The others are extremes and the last value."""
    time = np.array([0.0, 1.0, 4.0])
    rows = np.stack([time, -time], axis=1)
    found = {name: REDUCTIONS[name](time, rows).tolist() for name in REDUCTIONS}
    assert found == {"mean": [2.0, -2.0], "max": [4.0, 0.0], "min": [0.0, -4.0], "final": [4.0, -4.0]}
    assert REDUCTIONS["mean"](time[:1], rows[:1]).tolist() == [0.0, 0.0]


def test_members_that_failed_have_no_numbers():
    """A history that is NaN from a failure on has NaN for all of its numbers."""
    rows = np.ones((2, 4))
    rows[1, 2:] = np.nan
    found = reduced(np.arange(4.0), {"a": rows}, ["mean", "max", "min", "final"])
    assert list(found) == ["a.mean", "a.max", "a.min", "a.final"]
    for values in found.values():
        assert values[0] == 1.0 and np.isnan(values[1])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["men"], r"`reduce` must have names among mean, .* but has 'men' \(perhaps `mean`\)"),
        (["mean", "mean"], "`reduce` must have each name once, but has 'mean' twice"),
        (
            ["no_module:swing"],
            "`reduce` must have functions that can be imported, but has 'no_module",
        ),
        (["support.greedy:no"], "`reduce` must have functions that can be imported, but has 'support"),
        (["support.greedy:np"], "which is none"),
        ([lambda t, x: x[0]], "`reduce` must have functions that other processes can import"),
    ],
)
def test_reductions_that_cannot_be(given, message):
    with pytest.raises(esail.SceneError, match=message):
        names_of(given)


def test_functions_neither_change_the_history_nor_return_something_else(monkeypatch):
    """What one function writes would be what the next one sees; complex numbers would lose a part."""
    rows, time = {"a": np.ones((2, 3))}, np.arange(3.0)
    for function, error, message in (
        (writes, ValueError, "read-only"),
        (complex_numbers, esail.SceneError, r"must return real numbers .* but returns complex128"),
        (text, esail.SceneError, r"must return real numbers .* but returns <U1"),
    ):
        with pytest.raises(error, match=message):
            reduced(time, rows, [f"test_reductions:{function.__name__}"])
    assert rows["a"].flags.writeable and (rows["a"] == 1.0).all()
    assert reduced(time, rows, ["test_reductions:counted"])["a.counted"].tolist() == [3.0, 3.0]


def writes(time, rows):
    """Changes the history."""
    rows[:] = 0.0
    return rows[-1]


def complex_numbers(time, rows):
    """No real numbers."""
    return rows[-1] + 1.0j


def text(time, rows):
    """No numbers."""
    return "a"


def counted(time, rows):
    """An integer."""
    return len(rows)


def swing(time, rows):
    """Another function of this name."""
    return rows[0]


def test_two_functions_of_one_name():
    """They would give one name to two numbers."""
    with pytest.raises(esail.SceneError, match="`reduce` must have each name once, but has 'swing' twice"):
        names_of([greedy.swing, swing])


def computed(scene, folder, members, first=0.0):
    """An ensemble without a run, with the numbers of a history that is the number of the member."""
    task = task_of(scene, members, VARY, 3, "random", ["coning_angle"], reduce=NAMES)

    def do(numbers):
        piece = piece_of(numbers)
        return piece._replace(rows=reduced(np.linspace(0.0, 200.0, 11), piece.rows, NAMES))

    drive(task, folder, np.ones(members, bool), MadeUp(do))
    status = merge_pieces(folder, task)
    assert status == ("complete", "")
    return task


def test_the_file_and_what_reads_it(scene, tmp_path, capsys):
    """The file has the numbers with units and axes, and no history; all commands take it. A `mean` is asked
    for as `coning_angle.mean`, and a history is refused with what there is."""
    folder = tmp_path / "run"
    task = computed(scene, folder, 60)
    path = folder / "ensemble.h5"
    assert path.stat().st_size < size_of(task)
    with h5py.File(path) as file:
        assert not len(file["observables"]) and set(file["reduced"]) == {
            f"coning_angle.{name}" for name in ("mean", "max", "min", "final", "swing")
        }
        data = file["reduced/coning_angle.max"]
        assert data.shape == (60, 3) and list(data.attrs["axes"]) == ["member", "tether"]
        assert data.attrs["unit"] == "rad"
    found = load_ensemble(path)
    assert found["coning_angle.mean"][:, 1].tolist() == list(range(60)) and "coning_angle.max" in found
    assert list(found.keys()) == sorted(
        f"coning_angle.{n}" for n in ("mean", "max", "min", "final", "swing")
    )
    with pytest.raises(KeyError, match=r"only coning_angle.final, coning_angle.max"):
        found["coning_angle"]
    with pytest.raises(ValueError, match="`ensemble` must have histories to be drawn, but has only"):
        esail.plot(found, "coning_angle")
    assert main(["info", str(folder)]) == 0
    out = capsys.readouterr().out
    assert "coning_angle.mean, largest [rad]" in out and "coning_angle.min, smallest [rad]" in out
    line = next(line for line in out.splitlines() if "coning_angle.max" in line)
    assert line.split()[3:5] == ["29.5", "17.32"]  # mean and deviation of 0 to 59
    assert main(["plot", str(folder), "-o", str(tmp_path / "figures")]) == 0
    assert {path.stem for path in (tmp_path / "figures").iterdir()} == {"distributions", "drivers"}
    table = tmp_path / "table.csv"
    assert main(["export", str(folder), "-o", str(table), "--observables", "coning_angle.max[2]"]) == 0
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert len(rows) == 60 and float(rows[7]["coning_angle.max[2] [rad]"]) == 7.0
    assert float(rows[7]["time [s]"]) == 200.0
    data = found.to_xarray()
    assert data["coning_angle.max"].dims == ("member", "tether")
    other = load_ensemble(path)
    other.inputs["initial.spin_rate"][0] += 1e-3
    assert join([found, other])["coning_angle.max"].shape == (120, 3)


def test_more_members_keep_the_numbers(scene, tmp_path):
    """A larger ensemble takes over what the smaller one has, bit for bit."""
    computed(scene, tmp_path, 12)
    before = load_ensemble(tmp_path / "ensemble.h5")
    task = task_of(scene, 15, VARY, 3, "random", ["coning_angle"], reduce=NAMES)
    merge_pieces(tmp_path, task)
    after = load_ensemble(tmp_path / "ensemble.h5")
    assert np.isnan(after["coning_angle.mean"][12:]).all()
    for name in before.reduced:
        assert np.array_equal(before[name], after[name][:12])


@pytest.mark.nightly
def test_reduced_in_the_processes(ensemble, scene, tmp_path):
    """Each member's numbers are those of its history, from processes that never send the history."""
    found = run_ensemble(
        scene, tmp_path / "run", members=12, vary=VARY, seed=3, reduce=["max", greedy.swing]
    )
    assert not found.observables and found.complete.all()
    for name, rows in ensemble.observables.items():
        assert np.array_equal(found[f"{name}.max"], rows.max(1)), name
        assert np.array_equal(found[f"{name}.swing"], rows.max(1) - rows.min(1)), name
    with pytest.raises(
        esail.SceneError,
        match=r"must return real numbers in the shape \(3,\) of one instant of coning_angle",
    ):
        run_ensemble(scene, tmp_path / "bad", members=2, vary=VARY, reduce=[greedy.wrong_shape])
    assert not (tmp_path / "bad").exists()
