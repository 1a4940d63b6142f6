"""The folder of an ensemble: one writer at a time, a full disk, and the progress in `esail info`."""

import errno
import fcntl
import os
import signal
import subprocess
import sys
import threading
from types import SimpleNamespace

import numpy as np
import pytest

import esail_jax as esail
from esail_jax.atomic_file import atomic_file
from esail_jax.cli import main
from esail_jax.commands.ensemble_report import distributions
from esail_jax.ensembles import load_ensemble
from esail_jax.ensembles.ensemble_file import computed_members, parts_of
from esail_jax.ensembles.merging import merge_pieces, size_of
from esail_jax.ensembles.pieces import PieceFile, files_in, identity_of, pieces_of
from esail_jax.ensembles.task import about, task_of
from esail_jax.errors import NoSpaceError
from esail_jax.files.locks import FolderLock, in_use
from support.made_up_engine import piece_of, write_pieces
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
    assert not in_use(folder) and not folder.exists()


def test_a_look_at_the_lock_refuses_no_writer(tmp_path):
    """`esail info` holds the lock for a moment. A writer that comes just then waits for it."""
    look = FolderLock(tmp_path)
    threading.Timer(0.1, look.release).start()
    FolderLock(tmp_path).release()


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
    """The folder is then not guarded."""

    def no_locks(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", no_locks)
    for lock in [FolderLock(tmp_path), FolderLock(tmp_path)]:
        lock.release()


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
    """A record that does not fit is taken back, so that the file ends with the piece before; others may be
    appended to it once there is room."""
    task = task_of(scene, 4, VARY, 3, "random", ["coning_angle"])
    parts_of(tmp_path).mkdir()
    path = parts_of(tmp_path) / "a.pieces"
    with PieceFile(path, about(task)) as file:
        file.add(piece_of([0]))
        size = path.stat().st_size

        def half(data):
            if path.stat().st_size > size:
                raise OSError(errno.ENOSPC, "No space left on device")
            return write(data[: len(data) // 2])

        write, file._file = (
            file._file.write,
            SimpleNamespace(
                write=half, tell=file._file.tell, truncate=file._file.truncate, close=file._file.close
            ),
        )
        with pytest.raises(NoSpaceError, match=f"^no space is left in {parts_of(tmp_path)}$"):
            file.add(piece_of([1]))
        assert path.stat().st_size == size
    with PieceFile(parts_of(tmp_path) / "b.pieces", about(task)) as file:
        file.add(piece_of([1, 2, 3], ["", "The result may be wrong.", ""]))
    found_status = merge_pieces(tmp_path, task)
    assert found_status == ("complete", "1 of 4 members have a warning (2)")
    assert size_of(task) > (tmp_path / "ensemble.h5").stat().st_size
    found = load_ensemble(tmp_path / "ensemble.h5")
    assert found["coning_angle"][:, 0, 0].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert not parts_of(tmp_path).exists()


@pytest.mark.nightly
def test_a_full_disk_keeps_the_pieces(finished, tmp_path, monkeypatch, capsys):
    """One line says that the disk is full, whether a piece or the whole ensemble does not fit. The pieces
    stay, and `--resume` completes the ensemble."""
    folder = tmp_path / "run"
    line, add = "; make room and use --resume\n", PieceFile.add

    def full_at_five(file, piece):
        if 5 in piece.members:
            raise NoSpaceError(f"no space is left in {file.path.parent}")
        add(file, piece)

    with monkeypatch.context() as patched:
        patched.setattr(PieceFile, "add", full_at_five)
        assert main([*arguments(folder), "--processes", "2"]) == 130
    assert capsys.readouterr().err == f"no space is left in {parts_of(folder)}{line}"
    before = computed(folder)
    assert before and not (folder / "ensemble.h5").exists()

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "posix_fallocate", full)
        assert main([*arguments(folder), "--resume"]) == 130
    assert capsys.readouterr().err == f"no space is left in {folder}{line}"
    assert computed(folder) == 12
    assert main([*arguments(folder), "--resume"]) == 0
    assert same(load_ensemble(folder / "ensemble.h5"), load_ensemble(finished))
    assert [path.name for path in folder.iterdir()] == ["ensemble.h5"]


# ---- progress and statistics ----------------------------------------------------------------------


def test_info_of_an_unfinished_ensemble(scene, tmp_path, capsys):
    """`esail info DIR` counts the members of the pieces, and tells whether a process is at work."""
    assert main(["info", str(tmp_path)]) == 2
    assert "is a folder without an ensemble" in capsys.readouterr().err
    task = task_of(scene, 12, VARY, 3, "random", ["coning_angle"])
    write_pieces(
        tmp_path, task, piece_of([0, 1, 2], ["", "The result may be wrong.", "At t = 1"], [1, 1, 0])
    )
    assert main(["info", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "interrupted, and not put together yet" in out and "--resume" in out
    assert "3 of 12 computed, 1 of them failed, 1 of them have a warning" in out
    lock = FolderLock(tmp_path)
    assert main(["info", str(tmp_path)]) == 0
    assert ": running" in capsys.readouterr().out
    lock.release()
    merge_pieces(tmp_path, task)
    found = load_ensemble(tmp_path / "ensemble.h5")
    assert found.warned.tolist() == [1] and found.failed.tolist() == list(range(2, 12))


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


def computed(folder):
    """Number of members in the pieces of a folder."""
    return sum(len(p.members) for path in files_in(parts_of(folder)) for p in pieces_of(path, arrays=False))


def test_a_writer_that_was_killed(scene, tmp_path):
    """Wherever the last record is cut off, the pieces before it are read, and are the same bit for bit."""
    task = task_of(scene, 5, VARY, 3, "random", ["coning_angle"])
    pieces = [piece_of([0, 1]), piece_of([3]), piece_of([2, 4])]
    write_pieces(tmp_path, task, *pieces[:2])
    path = parts_of(tmp_path) / "a.pieces"
    two = path.stat().st_size
    write_pieces(tmp_path, task, *pieces, name="b")
    whole = (parts_of(tmp_path) / "b.pieces").read_bytes()
    for end in (two, two + 1, two + 20, two + 200, len(whole) - 1):
        path.write_bytes(whole[:end])
        found = list(pieces_of(path))
        assert [p.members.tolist() for p in found] == [[0, 1], [3]]
        assert found[1].rows["coning_angle"].tolist() == pieces[1].rows["coning_angle"].tolist()
    for end in (0, 10, 30):
        path.write_bytes(whole[:end])
        assert identity_of(path) is None and not list(pieces_of(path))


def test_a_damaged_piece_is_no_piece(scene, tmp_path):
    """A byte that has changed in the numbers of a record is noticed when the pieces are put together."""
    task = task_of(scene, 2, VARY, 3, "random", ["coning_angle"])
    write_pieces(tmp_path, task, piece_of([0, 1]))
    path = parts_of(tmp_path) / "a.pieces"
    data = bytearray(path.read_bytes())
    data[-5] ^= 1
    path.write_bytes(data)
    with pytest.raises(esail.RunFileError, match="must have whole pieces, but is damaged"):
        merge_pieces(tmp_path, task)
    assert not (tmp_path / "ensemble.h5").exists() and path.exists()


def test_only_what_a_file_holds_is_computed(scene, tmp_path):
    """Three of five members are in a piece, and later in ensemble.h5; the other two are missing there."""
    task = task_of(scene, 5, VARY, 3, "random", ["coning_angle"])
    write_pieces(tmp_path, task, piece_of([0, 1, 3]))
    assert np.flatnonzero(computed_members(tmp_path, task)[0]).tolist() == [0, 1, 3]
    status, message = merge_pieces(tmp_path, task)
    assert (status, message) == ("interrupted", "2 of 5 members are missing (2, 4)")
    done, held = computed_members(tmp_path, task)
    assert np.flatnonzero(done).tolist() == [0, 1, 3] and held == 5
    other = task_of(scene, 5, VARY, 4, "random", ["coning_angle"])
    with pytest.raises(
        esail.RunFileError, match=r"`task` must go on with the same seed, but .* is of another"
    ):
        computed_members(tmp_path, other)
    assert load_ensemble(tmp_path / "ensemble.h5")["coning_angle"][3, 0, 0] == 3.0
    write_pieces(tmp_path, task, piece_of([4]), piece_of([2]))
    assert merge_pieces(tmp_path, task) == ("complete", "")
    found = load_ensemble(tmp_path / "ensemble.h5")
    assert found["coning_angle"][:, 0, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_pieces_of_a_larger_ensemble(scene, tmp_path):
    """`--resume` with fewer members than the pieces know is refused: nothing that is computed is lost."""
    write_pieces(tmp_path, task_of(scene, 5, VARY, 3, "random", ["coning_angle"]), piece_of([0, 4]))
    with pytest.raises(esail.RunFileError, match=r"`members` must not be less than the 5 of .*, but is 3"):
        computed_members(tmp_path, task_of(scene, 3, VARY, 3, "random", ["coning_angle"]))
