"""The program cache keeps files privately, notices damage and stays below its limit."""

import os
import stat

import pytest

from kept_programs.store import SUFFIX, Store

VARIABLE = "TOY_CACHE"

with_users = pytest.mark.skipif(not hasattr(os, "getuid"), reason="Windows has no such users and modes")


@pytest.fixture
def store():
    return Store("toy/programs", VARIABLE, b"toy program\n")


def test_a_file_is_read_as_it_was_written(store, folder):
    assert store.load("a") is None
    store.save("a", b"code")
    assert (store.load("a"), store.has("a"), store.has("b")) == (b"code", True, False)


@with_users
def test_only_the_user_can_open_the_folder(store, folder):
    store.save("a", b"code")
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


@pytest.mark.parametrize(
    "change", [lambda x: x[:-1], lambda x: x[:-1] + b"?", lambda x: b"", lambda x: b"x" + x]
)
def test_a_damaged_file_is_missing_until_it_is_written_again(store, folder, change):
    store.save("a", b"code")
    (path,) = folder.iterdir()
    path.write_bytes(change(path.read_bytes()))
    assert store.load("a") is None
    store.save("a", b"code")
    assert store.load("a") == b"code"


@with_users
def test_a_folder_that_others_can_write_to_is_not_used(store, folder):
    """A process runs what the files hold: they must come from its own user."""
    store.save("a", b"code")
    folder.chmod(0o777)
    with pytest.warns(UserWarning, match="must be a folder that only you can write to"):
        assert store.load("a") is None
    with pytest.warns(UserWarning, match="compiled programs are not kept"):
        store.save("b", b"code")
    assert len(list(folder.iterdir())) == 1


@pytest.mark.parametrize("name", ["off", "OFF", "0", ""])
def test_the_cache_can_be_off(store, name, monkeypatch):
    monkeypatch.setenv(VARIABLE, name)
    store.save("a", b"code")
    assert (store.location(), store.load("a"), store.usage()) == (None, None, (0, 0))


def test_the_folder_is_in_the_users_cache(store, tmp_path, monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert store.location() == tmp_path / "toy" / "programs"


def test_a_path_that_is_no_folder_keeps_nothing(store, tmp_path, monkeypatch):
    """A file in the way, or a disk that cannot be written to, is no reason to stop."""
    path = tmp_path / "file"
    path.write_text("")
    for place in (path, path / "below"):
        monkeypatch.setenv(VARIABLE, str(place))
        store.save("a", b"code")
        assert store.load("a") is None


def test_a_write_that_fails_leaves_nothing(store, folder, monkeypatch):
    """As on a full disk."""

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    store.save("a", b"code")
    assert list(folder.iterdir()) == []


def test_files_used_longest_ago_go_first(store, folder):
    size = len(store.header) + 32 + 4
    store.most_bytes = 3 * size
    for age, name in enumerate("abc"):
        store.save(name, b"code")
        os.utime(folder / f"{name}{SUFFIX}", (1000.0 + age, 1000.0 + age))
    assert store.load("a") == b"code"  # used now
    store.save("d", b"code")
    assert [store.has(name) for name in "abcd"] == [True, False, True, True]
