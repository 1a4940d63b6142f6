"""Run files of another layout are refused in one line, by every function and command that reads them."""

import h5py
import pytest

import esail_jax as esail
from esail_jax import cli
from esail_jax.scenes.toml_text import to_toml


@pytest.fixture(params=[2, 4])
def other_version(request, tmp_path):
    """A run file of an earlier or a later layout."""
    path = tmp_path / "other.h5"
    with h5py.File(path, "w") as file:
        file["scene"] = to_toml(esail.load_scene("baseline"))
        file.attrs.update({"schema_version": request.param, "status": "complete"})
    return path, f"must have schema version 3, but has {request.param}: read it with the version"


def test_load_refuses_the_file(other_version):
    path, message = other_version
    with pytest.raises(esail.RunFileError, match=message):
        esail.load(path)


@pytest.mark.parametrize(
    "command",
    [["info"], ["plot", "-o", "figures"], ["run", "baseline", "--resume", "-o"]],
    ids=["info", "plot", "resume"],
)
def test_commands_refuse_the_file(command, other_version, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path, message = other_version
    before = path.read_bytes()
    arguments = [*command, str(path)] if command[0] != "plot" else ["plot", str(path), "-o", "figures"]
    assert cli.main(arguments) == 2
    err = capsys.readouterr().err
    assert message in err and err.count("\n") == 1
    assert path.read_bytes() == before and not (tmp_path / "figures").exists()
