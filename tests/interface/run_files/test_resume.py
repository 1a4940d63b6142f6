"""Continuing a run file with `--resume`: bit for bit, or refused in one line."""

import re

import h5py
import numpy as np
import pytest

import esail_jax as esail
import esail_jax.commands.running
import esail_jax.simulation.programs
from esail_jax import cli
from esail_jax.files.seal import write_seal
from support.bits import check_same, esail_run
from support.quick import quickly
from support.run_kinds import KINDS


@pytest.mark.parametrize("kind", quickly(KINDS))
def test_resume_without_a_file_starts(kind, scenes, wholes, tmp_path):
    assert esail_run(scenes[kind], tmp_path / "a.h5", "--resume") == 0
    check_same(tmp_path / "a.h5", wholes(kind))


def test_resume_of_a_complete_run_changes_no_byte(scene, whole, tmp_path, capsys):
    path = tmp_path / "a.h5"
    path.write_bytes(whole.read_bytes())
    before = path.stat()
    assert esail_run(scene, path, "--resume") == 0
    after = path.stat()
    assert path.read_bytes() == whole.read_bytes()
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("kind", quickly(KINDS))
@pytest.mark.parametrize("first", [30.0, 35.0, 1.0, 68.0, 30.07, 0.07])
def test_a_later_end_continues_bit_for_bit(first, kind, scenes, wholes, tmp_path):
    """A run can be continued from any t_end.

    With fixed steps the first end lies within the first compiled call, within the second, within a block of
    steps, at the end of a call that is no multiple of the interval, within a step, or before the end of the
    first step. With collocation the first runs fit into one call.
    """
    path, scale = tmp_path / "a.h5", KINDS[kind].scale
    assert esail_run(scenes[kind], path, "--t-end", first * scale) == 0
    assert esail_run(scenes[kind], path, "--t-end", 80.0 * scale, "--resume") == 0
    check_same(path, wholes(kind))


@pytest.mark.parametrize("kind", quickly(KINDS))
def test_a_call_of_any_length_gives_the_same_bits(kind, scenes, wholes, tmp_path, monkeypatch):
    """The whole run and its first part fit into one compiled call each, which the other tests' runs do
    not."""
    monkeypatch.undo()
    programs, path, scale = esail_jax.simulation.programs, tmp_path / "a.h5", KINDS[kind].scale
    monkeypatch.setattr(programs, "MAX_ATTEMPTS", 4096)
    monkeypatch.setattr(programs, "MAX_INSTANTS", 256)
    monkeypatch.setattr(programs, "_compiled", programs._compiled.__wrapped__)
    assert esail_run(scenes[kind], path, "--t-end", 35.0 * scale) == 0
    assert esail_run(scenes[kind], path, "--resume") == 0
    check_same(path, wholes(kind))


def test_resume_with_another_scene_is_refused(scene, whole, tmp_path, capsys):
    path = tmp_path / "a.h5"
    path.write_bytes(whole.read_bytes())
    for setting, got in (
        ("voltage.value=20001.0", "`voltage.value` is 20000 in {path} and 20001 here"),
        ("integrator.step=0.05", "`integrator.step` is 0.1 in {path} and 0.05 here"),
        ("output.interval=0.5", "`output.interval` is 0.35 in {path} and 0.5 here"),
        ("tethers.count=3", "`tethers.count` is 2 in {path} and 3 here"),
        ("voltage.maximum=3e4", "`voltage.maximum` is absent in {path} and 30000 here"),
    ):
        assert esail_run(scene, path, "--resume", "--set", setting) == 2
        must = "`--resume` must continue the same scene (t_end apart)"
        assert capsys.readouterr().err == f"{must}, but {got.format(path=path)}\n"
    assert esail_run(scene, path, "--resume", "--set", "voltage.value=1.0", "--set", "tethers.count=3") == 2
    assert capsys.readouterr().err.endswith(" here (1 more key differs)\n")
    assert path.read_bytes() == whole.read_bytes()


def test_resume_of_a_complete_run_says_so(scene, whole, tmp_path, capsys):
    path = tmp_path / "a.h5"
    path.write_bytes(whole.read_bytes())
    assert cli.main(["run", str(scene), "-o", str(path), "--resume"]) == 0
    out, err = capsys.readouterr()
    assert (out, err) == (f"{path} is complete already, up to 80 s: nothing is left to run\n", "")


def test_resume_to_an_earlier_end_is_refused(scene, whole, tmp_path, capsys):
    """A finished run refuses it, and so does one that was interrupted after that end."""
    path = tmp_path / "a.h5"
    path.write_bytes(whole.read_bytes())
    for status in ("complete", "interrupted"):
        with h5py.File(path, "r+") as file:
            file.attrs["status"] = status
        write_seal(path)
        before = path.read_bytes()
        assert esail_run(scene, path, "--resume", "--t-end", 10) == 2
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and re.match("`--t-end` must .*, but ", err)
        assert path.read_bytes() == before


def missing(state):
    del state["motion/state/now"]


def unknown(state):
    state["motion/state/more"] = 1.0


def of_another_shape(state):
    del state["motion/earlier"]
    state["motion/earlier"] = np.zeros(3)


def without_statistics(state):
    del state["pending"]


def of_the_first_version(state):
    del state["motion"]


@pytest.mark.parametrize(
    "change", [missing, unknown, of_another_shape, without_statistics, of_the_first_version]
)
def test_resume_of_a_checkpoint_of_another_version_is_refused(change, scene, whole, tmp_path, capsys):
    path = tmp_path / "a.h5"
    path.write_bytes(whole.read_bytes())
    with h5py.File(path, "r+") as file:
        file.attrs["status"] = "interrupted"
        change(file["state"])
    write_seal(path)
    before = path.read_bytes()
    assert esail_run(scene, path, "--resume", "--t-end", 90) == 2
    out, err = capsys.readouterr()
    assert (out, path.read_bytes()) == ("", before)
    expected = f"`--resume` must continue a run of this version of esail_jax, but {path} is of another"
    assert err == f"{expected}\n"
    with pytest.raises(esail.RunFileError, match="of another"):
        esail_jax.commands.running.run_scene(
            esail.load_scene(scene, {"integrator.t_end": 90.0}), path, resume=True, quiet=True
        )
