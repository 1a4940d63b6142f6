"""The program cache keeps files privately, notices damage and stays below its limit."""

import os
import stat

import pytest

from esail_jax import cli
from esail_jax.compilation import store


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder of an empty cache."""
    path = tmp_path / "programs"
    monkeypatch.setenv(store.VARIABLE, str(path))
    return path


def test_a_file_is_read_as_it_was_written_by_its_user_only(folder):
    assert store.load("a") is None
    store.save("a", b"code")
    assert (store.load("a"), store.has("a"), store.has("b")) == (b"code", True, False)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


@pytest.mark.parametrize(
    "change", [lambda x: x[:-1], lambda x: x[:-1] + b"?", lambda x: b"", lambda x: b"x" + x]
)
def test_a_damaged_file_is_missing_until_it_is_written_again(folder, change):
    store.save("a", b"code")
    (path,) = folder.iterdir()
    path.write_bytes(change(path.read_bytes()))
    assert store.load("a") is None
    store.save("a", b"code")
    assert store.load("a") == b"code"


def test_a_folder_that_others_can_write_to_is_not_used(folder):
    """A process runs what the files hold: they must come from its own user."""
    store.save("a", b"code")
    folder.chmod(0o777)
    with pytest.warns(UserWarning, match="must be a folder that only you can write to"):
        assert store.load("a") is None
    with pytest.warns(UserWarning, match="compiled programs are not kept"):
        store.save("b", b"code")
    assert len(list(folder.iterdir())) == 1


@pytest.mark.parametrize("name", ["off", "OFF", "0", ""])
def test_the_cache_can_be_off(name, monkeypatch, capsys):
    monkeypatch.setenv(store.VARIABLE, name)
    store.save("a", b"code")
    assert (store.location(), store.load("a"), store.usage()) == (None, None, (0, 0))
    assert cli.main(["cache"]) == 0
    assert capsys.readouterr().out == "Compiled programs are not kept (ESAIL_CACHE is off).\n"


def test_the_folder_is_in_the_users_cache(tmp_path, monkeypatch):
    monkeypatch.delenv(store.VARIABLE, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert store.location() == tmp_path / "esail_jax" / "programs"


def test_a_path_that_is_no_folder_keeps_nothing(tmp_path, monkeypatch):
    """A file in the way, or a disk that cannot be written to, is no reason to stop."""
    path = tmp_path / "file"
    path.write_text("")
    for place in (path, path / "below"):
        monkeypatch.setenv(store.VARIABLE, str(place))
        store.save("a", b"code")
        assert store.load("a") is None


def test_a_write_that_fails_leaves_nothing(folder, monkeypatch):
    """As on a full disk."""

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    store.save("a", b"code")
    assert list(folder.iterdir()) == []


def test_files_used_longest_ago_go_first(folder, monkeypatch):
    size = len(store.HEADER) + 32 + 4
    monkeypatch.setattr(store, "MOST_BYTES", 3 * size)
    for age, name in enumerate("abc"):
        store.save(name, b"code")
        os.utime(folder / f"{name}{store.SUFFIX}", (1000.0 + age, 1000.0 + age))
    assert store.load("a") == b"code"  # used now
    store.save("d", b"code")
    assert [store.has(name) for name in "abcd"] == [True, False, True, True]


def test_the_command_shows_and_clears_the_cache(folder, capsys):
    store.save("a", bytes(3 * 2**20))
    assert cli.main(["cache"]) == 0
    shown = capsys.readouterr().out
    assert str(folder) in shown and "files     1\n" in shown and "3.0 MiB (at most 1.0 GiB)" in shown
    assert cli.main(["cache", "--clear"]) == 0
    assert "removed   1" in capsys.readouterr().out
    assert store.usage() == (0, 0)
