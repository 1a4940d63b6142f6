"""Locks on the output of a run: one process writes it.

A lock is one of the operating system (flock) on a small file. It ends with the process that holds it, also
with one that is killed, so that nothing has to be cleaned up. Some file systems of clusters have no such
locks, and Windows has none; the output is not guarded there.
"""

import contextlib
import os
import time
from pathlib import Path
from typing import IO

from esail_jax.files.opening import ArgumentError, RunFileError

try:
    import fcntl
except ImportError:  # Windows has no flock
    fcntl = None  # type: ignore[assignment]

NAME = "in-use.lock"
"""Name of the file that is locked in a folder."""

LOOK_SECONDS = 0.5
"""Time for which a lock that is held is asked for again [s]: `in_use` holds it for a moment."""


class Lock:
    """A lock that this process holds on a path until `release`. Small files beside the output are locked,
    never the output itself.

    output: the output, for the message; patience: time to wait for it [s]. Raises RunFileError if another
    process holds the lock."""

    def __init__(self, path: Path, output: Path, patience: float = LOOK_SECONDS):
        self.path, end = path, time.monotonic() + patience
        while True:
            self._file = opened(self.path, output)
            if not taken(self._file):
                self._file.close()
                if time.monotonic() > end:
                    raise ArgumentError("output", "not be in use by another process", f"{output} is")
                time.sleep(LOOK_SECONDS / 10.0)
                continue
            if is_file_at(self._file, self.path):
                return
            self._file.close()  # the process that held the lock has just removed the file

    def __enter__(self) -> "Lock":
        return self

    def __exit__(self, *error: object) -> None:
        self.release()

    def release(self) -> None:
        """Ends the lock, and removes the file."""
        if is_file_at(self._file, self.path):
            self.path.unlink(missing_ok=True)
        self._file.close()


class FolderLock(Lock):
    """A lock on a folder, which is created if it does not exist, with those above it; if nothing is in them
    in the end, they are removed again."""

    def __init__(self, folder: Path, patience: float = LOOK_SECONDS):
        self._made = [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        super().__init__(folder / NAME, folder, patience)

    def release(self) -> None:
        """Ends the lock."""
        super().release()
        with contextlib.suppress(OSError):  # one has something in it
            for path in self._made:
                path.rmdir()


class FileLock(Lock):
    """A lock on a run file, which may not exist yet. The file that is locked lies beside it, and is hidden:
    .run.h5.lock."""

    def __init__(self, path: Path):
        super().__init__(path.with_name(f".{path.name}.lock"), path)


def opened(path: Path, output: Path) -> IO:
    """The file that is locked. Raises RunFileError if it cannot be made."""
    try:
        return open(path, "a+")
    except OSError as error:
        got = f"{output} is not ({error.strerror})"
        raise ArgumentError("output", "be where files can be made", got) from error


def is_file_at(file: IO, path: Path) -> bool:
    """Tells whether an open file is still the one at a path."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


def taken(file: IO) -> bool:
    """Takes the lock on an open file. False if another process holds it; true also where there are no
    locks."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # the file system has no locks
        pass
    return True


def in_use(folder: Path) -> bool:
    """Tells whether a process holds a lock on a folder."""
    if not (folder / NAME).exists():
        return False
    try:
        FolderLock(folder, patience=0.0).release()
    except RunFileError:
        return True
    return False
