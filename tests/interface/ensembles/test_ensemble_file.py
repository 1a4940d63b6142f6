"""Files of ensembles: contents, `esail info` and `plot`, more members, and refused input."""

import dataclasses
from pathlib import Path

import h5py
import numpy as np
import pytest

import esail_jax as esail
import esail_jax.commands.ensemble_progress
from esail_jax.cli import main
from esail_jax.ensembles import load_ensemble
from esail_jax.plotting.ensemble import plot_ensemble
from support.small_ensemble import VARY, arguments, same


@pytest.mark.nightly
def test_file(finished, scene, inputs, ensemble):
    """The file is a run file with `member` as first axis and with /inputs; its numbers are those of
    Python."""
    with h5py.File(finished) as file:
        assert file.attrs["status"] == "complete" and file.attrs["members"] == 12
        assert file.attrs["message"] == "" and file.attrs["steps"] == ensemble.steps.sum()
        assert file["inputs/tethers.length"].shape == (12, 3)
        assert file["inputs/initial.spin_rate"].shape == (12,)
        assert np.array_equal(file["inputs/tethers.length"][()], inputs["tethers.length"])
        assert np.array_equal(file["time"][()], ensemble.time)
        assert set(file["observables"]) == set(ensemble.observables)
        for name, data in file["observables"].items():
            assert list(data.attrs["axes"])[:2] == ["member", "time"]
            assert data.shape == ensemble[name].shape and data.attrs["unit"] is not None
    assert same(load_ensemble(finished), ensemble)
    assert list(finished.parent.iterdir()) == [finished]


@pytest.mark.nightly
def test_info_and_figures(finished, tmp_path, capsys, monkeypatch):
    """`esail info` describes an ensemble, and `plot` draws it, unless all members have failed; commands
    for one run refuse it.

    The figure of the shares of variance requires enough members.
    """
    assert main(["info", str(finished)]) == 0
    text = capsys.readouterr().out
    assert (
        "12, seed 3" in text
        and "summed over processes" in text
        and "largest coning angle" in text
        and "initial.spin_rate" in text
    )
    assert main(["plot", str(finished), "-o", str(tmp_path / "figures")]) == 0
    names = {Path(line).name for line in capsys.readouterr().out.split()}
    assert names == {"fans.png", "distributions.png"}
    whole = load_ensemble(finished)
    spin = dataclasses.replace(whole, inputs={"initial.spin_rate": whole.inputs["initial.spin_rate"]})
    assert {path.name for path in plot_ensemble(spin, tmp_path)} == names | {"drivers.png"}
    with pytest.raises(esail.RunFileError, match="of an ensemble"):
        esail.load(finished)
    none = dataclasses.replace(whole, complete=np.zeros(len(whole), bool))
    monkeypatch.setattr("esail_jax.ensembles.load_ensemble", lambda _: none)
    assert main(["plot", str(finished), "-o", str(tmp_path / "none")]) == 2
    assert "must have a member that reached its end, but has none\n" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
    assert main(["run", "baseline", "-o", str(finished), "--resume"]) == 2


@pytest.mark.nightly
def test_going_on(finished, tmp_path, capsys):
    """Resuming with more members keeps the old members and adds those of the larger ensemble.

    A line is printed and nothing changes if the ensemble is complete, if resuming was not asked for, if the
    ensemble is another one, or if it has fewer members.
    """
    folder = tmp_path / "run"
    folder.mkdir()
    whole = folder / "ensemble.h5"
    whole.write_bytes(finished.read_bytes())
    before = whole.read_bytes()
    assert main([*arguments(folder), "--resume"]) == 0
    others = [
        arguments(folder),
        [*arguments(folder, seed=4), "--resume"],
        [*arguments(folder, vary=VARY[:1]), "--resume"],
        [*arguments(folder, members=6), "--resume"],
        [*arguments(folder, sampling="sobol"), "--resume"],
        [*arguments(folder, observables="coning_angle"), "--resume"],
    ]
    errors = []
    for command in others:
        assert main(command) == 2
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and " must " in err, err
        errors.append(err)
    assert errors[1] == f"`--resume` must go on with the same seed, but {whole} is of another\n"
    assert whole.read_bytes() == before and list(folder.iterdir()) == [whole]
    assert main([*arguments(folder, members=15, processes=1), "--resume"]) == 0
    old, new = load_ensemble(finished), load_ensemble(whole)
    assert len(new) == 15 and new.complete.all()
    for name in old.observables:
        assert np.array_equal(old[name], new[name][:12], equal_nan=True)


BAD = [
    (["--members", "0"], "--members"),
    (["--seed", "-1"], "--seed"),
    (["--processes", "0"], "--processes"),
    (["--max-steps", "0"], "--max-steps"),
    (["--vary", "tethers.length=uniform:1"], "--vary"),
    (["--vary", "tethers.count=uniform:1:2"], "tethers.count"),
    (["--observables", "coning"], "observables"),
    (["--engine", "slurm"], "--engine"),
    (["--engine", "dask"], "--engine"),
    (["--engine", "mpi"], "mpiexec"),
    (["--engine", "dask:localhost:1", "--processes", "2"], "--processes"),
    (["--reduce", "men"], "mean"),
    (["--reduce", "mean,mean"], "twice"),
    (["--reduce", "no_module:function"], "no_module"),
]


@pytest.mark.parametrize(("more", "key"), BAD, ids=lambda x: " ".join(x) if isinstance(x, list) else x)
def test_bad_input(more, key, tmp_path, capsys):
    """Bad input gives one line and status 2, and nothing is written."""
    command = ["ensemble", "baseline", "-o", str(tmp_path / "run"), "--members", "2", *more]
    assert main(command) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and key in err and " must " in err, err
    assert not err.startswith(("`vary", "`observables", "`reduce")), "words of Python"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("more", "said"), [([], 1), (["--vary", "tethers.length=uniform:9e3:1e4"], 0)])
def test_members_without_variation_are_announced(more, said, tmp_path, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(esail_jax.commands.ensemble_progress, "run_task", interrupted)
    assert main(["ensemble", "baseline", "-o", str(tmp_path / "run"), "--members", "2", *more]) == 130
    assert capsys.readouterr().err.count("Without --vary all members are equal.") == said
