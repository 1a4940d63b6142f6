"""The folder of an ensemble: one writer at a time, a full disk, and the progress in `esail info`."""

import dataclasses
import errno
import fcntl
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import esail_jax as esail
import esail_jax.commands.ensemble_here
from esail_jax.atomic_file import atomic_file
from esail_jax.cli import main
from esail_jax.commands.cluster import end_together
from esail_jax.commands.ensemble_here import publish_pieces, task_of
from esail_jax.commands.ensemble_report import distributions
from esail_jax.ensembles import load_ensemble
from esail_jax.ensembles.ensemble_file import (
    computed_members,
    parts_of,
    pieces_in,
    try_claim,
    write_piece,
)
from esail_jax.ensembles.merging import merge_pieces, size_of
from esail_jax.errors import NoSpaceError
from esail_jax.files.locks import FolderLock, in_use
from support.small_ensemble import VARY, arguments, made_up, same

# ---- one writer ----------------------------------------------------------------------------------


def test_a_second_writer_is_refused(tmp_path, capsys):
    """As long as another process holds the folder, the command is refused in one line, with and without
    `--resume`, and nothing is written."""
    folder = tmp_path / "run"
    lock = FolderLock(folder)
    for more in ([], ["--resume"]):
        assert main([*arguments(folder), *more]) == 2
        err = capsys.readouterr().err
        assert err == f"`-o` must not be in use by another process, but {folder} is\n"
    assert in_use(folder) and [path.name for path in folder.iterdir()] == ["in-use.lock"]
    lock.release()
    assert not in_use(folder) and not list(folder.iterdir())


def test_locks_that_are_shared(tmp_path):
    """A folder is shared by those that ask for it; who wants it alone waits for the others to end."""
    first = FolderLock(tmp_path)
    first.share()
    second = FolderLock(tmp_path, shared=True)
    with pytest.raises(esail.RunFileError, match="in use"):
        FolderLock(tmp_path)
    assert not first.try_alone()
    second.release(remove=False)
    assert first.try_alone() and first.works
    with pytest.raises(esail.RunFileError, match="in use"):
        FolderLock(tmp_path, shared=True)
    first.release()


HOLD = """
import sys, time
from pathlib import Path
from esail_jax.files.locks import FolderLock
lock = FolderLock(Path(sys.argv[1]))
print("held", flush=True)
time.sleep(300)
"""


def test_a_killed_process_leaves_no_lock(tmp_path):
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "held\n" and in_use(tmp_path)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    assert not in_use(tmp_path)


def test_a_file_system_without_locks(tmp_path, monkeypatch):
    """The folder is then not guarded, and the lock says so."""

    def no_locks(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", no_locks)
    locks = [FolderLock(tmp_path), FolderLock(tmp_path)]
    assert not locks[0].works
    for lock in locks:
        lock.release()


@pytest.fixture
def parts_missing(scene, tmp_path):
    """A folder with pieces of members 0 to 2 of 6, and its task."""
    task = task_of(scene, 6, VARY, 3, "random", ["coning_angle"])
    publish_pieces(task, tmp_path, np.arange(6), 1)
    write_piece(tmp_path, "00000000-00000002-000000", task, made_up(scene, [0, 1, 2], {}), (1.0, 1.0))
    return task, tmp_path


def test_distributed_processes_end_together(parts_missing, capsys):
    """Who has no more work waits for the others, unless it is interrupted. The first that finds no other
    reports what is missing; the next ends with the same code, and says nothing."""
    task, folder = parts_missing
    locks = [FolderLock(folder, shared=True) for _ in range(3)]
    assert end_together(task, folder, locks[0], lambda: True, False) == 130
    assert parts_of(folder).exists() and capsys.readouterr().err == ""
    other = threading.Thread(target=lambda: time.sleep(0.2) or locks[2].release(remove=False))
    other.start()
    assert end_together(task, folder, locks[1], lambda: False, False) == 130
    other.join()
    line = "3 of 6 members are missing (3, 4, 5); --resume computes them\n"
    assert capsys.readouterr().err == line and [path.name for path in folder.iterdir()] == ["ensemble.h5"]
    assert end_together(task, folder, FolderLock(folder, shared=True), lambda: False, False) == 130
    assert capsys.readouterr().err == ""


def test_distributed_processes_without_locks(parts_missing, scene, monkeypatch, capsys):
    """A process cannot know then whether the others have ended. It puts only a complete ensemble
    together."""

    def no_locks(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", no_locks)
    task, folder = parts_missing
    assert end_together(task, folder, FolderLock(folder, shared=True), lambda: False, True) == 0
    assert parts_of(folder).exists()
    write_piece(folder, "00000003-00000005-000001", task, made_up(scene, [3, 4, 5], {}), (1.0, 1.0))
    assert end_together(task, folder, FolderLock(folder, shared=True), lambda: False, False) == 0
    assert not parts_of(folder).exists() and "6, seed 3" in capsys.readouterr().out


# ---- a full disk ---------------------------------------------------------------------------------

HDF5_TEXT = "Can't close file (file write failed, errno = 28, error message = 'No space left on device')"


@pytest.mark.parametrize(
    "error", [OSError(errno.ENOSPC, "No space"), OSError(errno.EDQUOT, "Quota"), RuntimeError(HDF5_TEXT)]
)
def test_a_full_disk_is_named(error, tmp_path):
    """The error names the folder, and no part of the file is left. Other errors stay as they are."""
    with (
        pytest.raises(NoSpaceError, match=f"^no space is left in {tmp_path}$"),
        atomic_file(tmp_path / "a") as part,
    ):
        part.write_text("half")
        raise error
    assert not list(tmp_path.iterdir())
    with pytest.raises(RuntimeError, match="other"), atomic_file(tmp_path / "a"):
        raise RuntimeError("other")


def test_a_piece_on_a_full_disk(scene, tmp_path, monkeypatch):
    """HDF5 writes a piece to memory; Python writes it to the disk, and raises one error."""
    task = task_of(scene, 3, VARY, 3, "random", ["coning_angle"])
    publish_pieces(task, tmp_path, np.arange(3), 1)
    found = made_up(scene, [0, 1, 2], {}, ["", "The result may be wrong.", ""])

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched, pytest.raises(NoSpaceError, match="no space is left"):
        patched.setattr(Path, "write_bytes", full)
        write_piece(tmp_path, "00000000-00000002-000000", task, found, (1.0, 1.0))
    assert [path.name for path in parts_of(tmp_path).iterdir()] == ["task.h5"]
    write_piece(tmp_path, "00000000-00000002-000000", task, found, (1.0, 1.0))
    found_status = merge_pieces(tmp_path, task)
    assert found_status == ("complete", "1 of 3 members have a warning (1)")
    assert size_of(task) > (tmp_path / "ensemble.h5").stat().st_size
    assert same(load_ensemble(tmp_path / "ensemble.h5"), found)


@pytest.mark.nightly
def test_a_full_disk_keeps_the_pieces(finished, tmp_path, monkeypatch, capsys):
    """One line says that the disk is full, whether a worker process or the merging finds it so. The pieces
    stay, and `--resume` completes the ensemble."""
    folder = tmp_path / "run"
    line = "; make room and use --resume\n"
    with monkeypatch.context() as patched:
        patched.setattr(
            esail_jax.commands.ensemble_here,
            "start_worker",
            lambda _: subprocess.Popen(["sh", "-c", "exit 28"]),
        )
        assert main([*arguments(folder), "--processes", "2"]) == 130
    assert capsys.readouterr().err == f"no space is left in {parts_of(folder)}{line}"
    before = len(pieces_in(folder))
    assert before and not (folder / "ensemble.h5").exists()

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "posix_fallocate", full)
        assert main([*arguments(folder), "--resume"]) == 130
    assert capsys.readouterr().err == f"no space is left in {folder}{line}"
    assert len(pieces_in(folder)) >= before
    assert main([*arguments(folder), "--resume"]) == 0
    assert same(load_ensemble(folder / "ensemble.h5"), load_ensemble(finished))
    assert [path.name for path in folder.iterdir()] == ["ensemble.h5"]


# ---- progress and statistics ----------------------------------------------------------------------


def test_info_of_an_unfinished_ensemble(scene, tmp_path, capsys):
    """`esail info DIR` counts the members of the pieces, and tells whether a process is at work."""
    assert main(["info", str(tmp_path)]) == 2
    assert "is a folder without an ensemble" in capsys.readouterr().err
    task = task_of(scene, 12, VARY, 3, "random", ["coning_angle"])
    publish_pieces(task, tmp_path, np.arange(12), 1)
    found = made_up(scene, [0, 1, 2], {}, ["", "The result may be wrong.", "At t = 1"], [True, True, False])
    write_piece(tmp_path, "00000000-00000002-000000", task, found, (1.0, 1.0))
    assert main(["info", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "interrupted, and not put together yet" in out and "--resume" in out
    assert "3 of 12 computed, 1 of them failed, 1 of them have a warning" in out
    lock = FolderLock(tmp_path)
    assert main(["info", str(tmp_path)]) == 0
    assert ": running" in capsys.readouterr().out
    lock.release()
    assert found.warned.tolist() == [1] and found.failed.tolist() == [2]


def test_too_few_members_for_shares(scene):
    """The report says why it names no inputs, and how many members it would need."""
    inputs = {
        "tethers.length": np.linspace(1.0, 2.0, 57).reshape(19, 3) ** 2,
        "initial.spin_rate": np.ones(19),
    }
    lines = distributions(made_up(scene, np.arange(19), inputs))
    assert "driven by" not in lines[0]
    assert "with 4 varied numbers and less than 40 complete members" in lines[-1]
    one = {"initial.spin_rate": np.arange(19.0)}
    lines = distributions(made_up(scene, np.arange(19), one))
    assert lines[0].endswith("driven by") and lines[1].endswith("initial.spin_rate 100 %")


# ---- pieces ---------------------------------------------------------------------------------------


def test_a_piece_is_taken_once(scene, tmp_path):
    """Two processes that ask for the same piece do not both get it."""
    publish_pieces(task_of(scene, 2, VARY, 3, "random", ["coning_angle"]), tmp_path, np.arange(2), 1)
    assert [try_claim(tmp_path, "piece") for _ in range(3)] == [True, False, False]


def test_only_what_a_file_holds_is_computed(scene, tmp_path):
    """Three of five members are in a piece, and later in ensemble.h5; the other two are missing there."""
    task = task_of(scene, 5, VARY, 3, "random", ["coning_angle"])
    publish_pieces(task, tmp_path, np.arange(5), 1)
    write_piece(tmp_path, "00000000-00000003-000000", task, made_up(scene, [0, 1, 3], {}), (1.0, 1.0))
    assert computed_members(tmp_path, task)[0].tolist() == [0, 1, 3]
    status, message = merge_pieces(tmp_path, task)
    assert (status, message) == ("interrupted", "2 of 5 members are missing (2, 4)")
    members, held = computed_members(tmp_path, task)
    assert members.tolist() == [0, 1, 3] and held == 5
    must = "`task` must go on with the same seed, but .* is of another"
    with pytest.raises(esail.RunFileError, match=must):
        computed_members(tmp_path, dataclasses.replace(task, seed=4))
    assert load_ensemble(tmp_path / "ensemble.h5")["coning_angle"][3, 0, 0] == 3.0
