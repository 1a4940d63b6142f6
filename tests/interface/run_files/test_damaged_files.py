"""Run files that were damaged after they were written: flipped bits, truncation, replaced parts."""

import os

import h5py
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.files import seal
from esail_jax.files.seal import write_seal
from esail_jax.scenes.toml_text import to_toml
from support.bits import esail_run


def flip(data, random):
    place = int(random.integers(len(data)))
    data[place] ^= 1 << int(random.integers(8))


def truncate(data, random):
    del data[int(random.integers(len(data))) :]


def overwrite(data, random):
    place, count = int(random.integers(len(data))), int(random.integers(1, 2000))
    data[place : place + count] = random.bytes(len(data[place : place + count]))


@pytest.fixture(scope="module")
def file_of_a_run(whole):
    return whole.read_bytes()


@pytest.mark.parametrize("damage", [flip, truncate, overwrite])
def test_a_damaged_file_is_refused_in_one_line(
    damage, file_of_a_run, scene, tmp_path, capsys, nothing_compiles
):
    """Two hundred files of each kind: `info`, `plot`, `load` and `--resume` refuse them in one line, and do
    not change them. A change of nothing (a byte overwritten by itself) is none."""
    random = np.random.default_rng(3)
    path, tried = tmp_path / "a.h5", 0
    for case in range(200):
        data = bytearray(file_of_a_run)
        damage(data, random)
        if data == file_of_a_run:
            continue
        tried += 1
        path.write_bytes(data)
        commands = [["info", str(path)], ["plot", str(path), "-o", str(tmp_path / "figures")]]
        commands.append(["run", str(scene), "-o", str(path), "--resume"])
        assert main(commands[case % 3]) == 2
        out, error = capsys.readouterr()
        assert (out, error.count("\n")) == ("", 1) and error.startswith(f"`{path}` must be ")
        with pytest.raises(esail.RunFileError):
            esail.load(path)
        assert path.read_bytes() == data
    assert tried > 190


def test_a_file_that_another_program_has_changed_is_refused(file_of_a_run, scene, tmp_path, capsys):
    """A state with a replaced number would be resumed to an end that looks right."""
    path = tmp_path / "a.h5"
    path.write_bytes(file_of_a_run)
    with h5py.File(path, "r+") as file:
        file["state/energy"][1] = 1.0
    assert esail_run(scene, path, "--resume", "--t-end", 90) == 2
    assert "must be an intact run file, but is damaged" in capsys.readouterr().err


def test_a_file_without_a_checksum_is_refused(file_of_a_run, tmp_path):
    path = tmp_path / "a.h5"
    path.write_bytes(bytes(512) + file_of_a_run[512:])
    with pytest.raises(esail.RunFileError, match="its checksum is missing"):
        esail.load(path)


def test_a_file_that_is_replaced_while_it_is_read_is_intact(file_of_a_run, tmp_path, monkeypatch):
    """A running simulation replaces its file by the next one. A reader that looks at the checksum of one
    and the content of the other would call an intact file damaged."""
    path, later = tmp_path / "a.h5", tmp_path / "b.h5"
    path.write_bytes(file_of_a_run)
    later.write_bytes(bytes(512) + file_of_a_run[512:] + b"more")
    write_seal(later)
    original = seal.seal_of

    def meanwhile(file):
        os.replace(later, path)
        return original(file)

    monkeypatch.setattr(seal, "seal_of", meanwhile)
    assert seal.is_sealed(path) and not later.exists()


def test_a_scene_is_checked_and_described(scene, whole, tmp_path, capsys, nothing_compiles):
    """`esail info SCENE.toml` checks a scene without a run, and says what in it has no effect. Among run
    files a scene is refused, and so is a scene with a mistake."""
    assert main(["info", str(scene)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{scene}: Scene: ") and lines[-2] == "  interval  0.35 s"
    assert lines[-1].endswith(f"esail run {scene} --estimate")
    other = tmp_path / "other.toml"
    text = to_toml(esail.load_scene("baseline", {"tethers.bending": False}))
    other.write_text(text)
    assert main(["info", str(other)]) == 0
    assert "because `tethers.bending` is false" in capsys.readouterr().out
    other.write_text(text.replace("second_moment = ", "second_moment = -"))
    assert main(["info", str(other)]) == 2
    assert capsys.readouterr().err.startswith("`tethers.second_moment` must be positive, but is -1.47e-18")
    assert main(["info", str(whole), str(scene)]) == 2
    assert capsys.readouterr().err == f"`{scene}` must be a run file, but is a scene\n"
