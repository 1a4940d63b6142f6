"""One process at a time writes a run file."""

import pytest

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.files.locks import FileLock, is_file_at

SHORT = ["--set", "tethers.count=3", "--set", "tethers.elements=2", "--t-end", "20", "--quiet"]


def test_a_second_writer_of_a_run_file_is_refused(tmp_path, capsys):
    """As long as another process writes a run file, `esail run` refuses in one line to write it, with and
    without `--resume`, before anything is compiled, and leaves everything as it is."""
    path = tmp_path / "run.h5"
    with FileLock(path):
        for more in ([], ["--resume"]):
            assert main(["run", "baseline", "-o", str(path), *SHORT, *more]) == 2
            assert capsys.readouterr().err == f"`-o` must not be in use by another process, but {path} is\n"
        assert [found.name for found in tmp_path.iterdir()] == [".run.h5.lock"]
    assert not list(tmp_path.iterdir())


def test_a_run_locks_its_own_file_only(tmp_path):
    """Two runs in one folder do not disturb each other. A lock is free again after an error."""
    with FileLock(tmp_path / "a.h5"), FileLock(tmp_path / "b.h5"):
        with pytest.raises(esail.RunFileError, match=r"in use by another process, but .*a\.h5 is"):
            FileLock(tmp_path / "a.h5")
    with pytest.raises(ZeroDivisionError), FileLock(tmp_path / "a.h5"):
        raise ZeroDivisionError
    FileLock(tmp_path / "a.h5").release()
    assert not list(tmp_path.iterdir())


def test_a_lock_on_a_file_that_was_removed_is_none(tmp_path):
    """Another process may remove the file of a lock between its opening and the lock; the lock would then
    be on a file that nobody else finds."""
    path = tmp_path / "lock"
    with open(path, "w") as file:
        assert is_file_at(file, path)
        path.unlink()
        assert not is_file_at(file, path)
        path.touch()
        assert not is_file_at(file, path)
