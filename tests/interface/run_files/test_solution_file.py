"""Solutions in files: `save`, `load`, and the command that continues them."""

import jax
import numpy as np
import pytest

import esail_jax as esail
import esail_jax.simulation.restoring
from esail_jax.cli import main
from support.bits import check_same, esail_run, status_of


def test_a_run_that_is_not_the_scenes_own_cannot_be_resumed(scene, solution, tmp_path, capsys):
    """A run with `times`, `save` or `start` is saved without a checkpoint; its file stays."""
    path = tmp_path / "a.h5"
    esail.save(esail.simulate(str(scene), times=[1.0, 2.0]), path)
    before = path.read_bytes()
    assert esail_run(scene, path, "--resume") == 2
    assert (
        capsys.readouterr().err
        == f"`--resume` must continue a run with a checkpoint, but {path} has none\n"
    )
    assert path.read_bytes() == before
    with pytest.raises(ValueError, match="was read from a file"):
        esail.load(path).at(1.5)


def test_simulate_and_the_command_give_the_same_file(solution, whole, tmp_path):
    esail.save(solution, tmp_path / "a.h5")
    check_same(tmp_path / "a.h5", whole)
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"], "temporary files stay"


def test_load_gives_back_what_was_saved(solution, tmp_path):
    path = tmp_path / "a.h5"
    esail.save(solution, str(path))
    again = esail.load(str(path))
    assert again.scene == solution.scene and again.steps == solution.steps
    assert again.time.tobytes() == solution.time.tobytes()
    assert set(again.observables) == set(solution.observables)
    for name in solution.observables:
        assert np.asarray(again[name]).tobytes() == np.asarray(solution[name]).tobytes(), name
    motion = esail_jax.simulation.restoring.restored(solution.checkpoint.motion, again.checkpoint.motion)
    assert jax.tree.all(jax.tree.map(np.array_equal, motion, solution.checkpoint.motion))
    assert again.checkpoint[1:3] == solution.checkpoint[1:3]
    assert again.result == esail.RESULTS.successful
    assert set(again.stats["terms"]) == set(solution.stats["terms"])
    esail.save(again, tmp_path / "b.h5")
    check_same(tmp_path / "b.h5", path)


def test_save_overwrites_only_when_told(solution, tmp_path):
    path = tmp_path / "a.h5"
    path.write_text("precious")
    with pytest.raises(FileExistsError, match=r"a\.h5"):
        esail.save(solution, path)
    assert path.read_text() == "precious"
    esail.save(solution, path, overwrite=True)
    assert status_of(path) == "complete"


def test_a_saved_solution_can_be_resumed(scene, whole, tmp_path):
    """The run time in the file is that of both parts."""
    first = esail.simulate(str(scene), {"integrator.t_end": 30.0})
    first.stats["wall_time"] = 1e6
    esail.save(first, tmp_path / "a.h5")
    assert esail_run(scene, tmp_path / "a.h5", "--resume") == 0
    check_same(tmp_path / "a.h5", whole)
    assert esail.load(tmp_path / "a.h5").stats["wall_time"] > 1e6


def test_load_refuses_a_file_that_is_no_run(tmp_path):
    (tmp_path / "a.h5").write_text("precious")
    with pytest.raises(esail.RunFileError, match=r"a\.h5"):
        esail.load(tmp_path / "a.h5")
    with pytest.raises(esail.RunFileError, match="does not exist"):
        esail.load(tmp_path / "b.h5")
    with pytest.raises(esail.RunFileError, match="must be a run file, but is a folder"):
        esail.load(tmp_path)


# The last test of the file, because it drops the programs that the others share.
def test_load_compiles_nothing(whole, nothing_compiles):
    assert esail.load(whole)["kinetic_energy"].shape == (230,)


def test_a_failed_solution_is_saved_as_failed(scene, tmp_path, capsys):
    """Its file says why, and has the rows before the failure. Those behind it are NaN, which `esail info`
    does not count."""
    found = esail.simulate(str(scene), max_steps=1, throw=False)
    assert found.result != esail.RESULTS.successful
    esail.save(found, tmp_path / "a.h5")
    assert status_of(tmp_path / "a.h5") == "failed"
    known = int(np.isfinite(found["kinetic_energy"]).sum())
    assert main(["info", str(tmp_path / "a.h5")]) == 0 and known < len(found.time)
    reached = f"  time       {found.time[known - 1]:g} of {found.time[-1]:g} s, {known} saved instants\n"
    assert reached in capsys.readouterr().out
    assert esail.load(tmp_path / "a.h5").stats["message"] == found.stats["message"] != ""
