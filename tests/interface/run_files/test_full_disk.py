"""A run on a disk that becomes full: one line, and a file that can be resumed."""

import errno
import os

import pytest

from esail_jax.files import run_file
from support.bits import check_same, esail_run, status_of
from support.run_kinds import check_start_of

pytestmark = pytest.mark.skipif(
    not hasattr(os, "posix_fallocate"), reason="this system cannot reserve room for a file"
)


@pytest.mark.parametrize("number", [1, 3])
def test_a_run_on_a_full_disk_ends_in_one_line_and_resumes(
    number, scene, whole, tmp_path, monkeypatch, capsys
):
    """The room for the `number`-th file is missing: for the first one, or during the run. HDF5 is not asked
    to write then, which would crash the process; nothing is left but the last good file."""
    path, left, reserved = tmp_path / "a.h5", [number], os.posix_fallocate

    def full(descriptor, start, size):
        left[0] -= 1
        if left[0] == 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        reserved(descriptor, start, size)

    monkeypatch.setattr(os, "posix_fallocate", full)
    monkeypatch.setattr(run_file, "CHECKPOINT_SECONDS", 0.0)
    monkeypatch.setattr(run_file, "COPY_SHARE", 1e9)
    assert esail_run(scene, path) != 0
    assert capsys.readouterr().err.splitlines()[0].startswith(f"no space is left in {tmp_path}")
    assert [x.name for x in tmp_path.iterdir() if not x.name.startswith(".")] == ["a.h5"] * (number > 1)
    if number > 1:
        check_start_of(path, whole)
        assert status_of(path) == "running"
    assert esail_run(scene, path, "--resume") == 0
    check_same(path, whole)


def test_the_room_is_enough_for_the_file(scene, whole, tmp_path, monkeypatch):
    """Every file is at most as large as the room that was reserved for it."""
    path, rooms, sizes, replaced = tmp_path / "a.h5", [], [], os.replace
    monkeypatch.setattr(os, "posix_fallocate", lambda descriptor, start, size: rooms.append(size))

    def measured(part, target):
        if target == path:
            sizes.append(os.path.getsize(part))
        replaced(part, target)

    monkeypatch.setattr(os, "replace", measured)
    monkeypatch.setattr(run_file, "CHECKPOINT_SECONDS", 0.0)
    monkeypatch.setattr(run_file, "COPY_SHARE", 1e9)
    assert esail_run(scene, path) == 0
    assert len(sizes) == len(rooms) > 2
    assert all(size <= room for size, room in zip(sizes, rooms, strict=True))
