"""Locks on the output of a run: one process writes it alone, or several processes share a folder.

A lock is one of the operating system (flock) on a small file. It ends with the process that holds it, also
with one that is killed, so that nothing has to be cleaned up. Some file systems of clusters have no such
locks; there `works` is false, and the output is not guarded.
"""

import os
from pathlib import Path
from typing import IO

from esail_jax.files.opening import ArgumentError, RunFileError

try:
    import fcntl
except ImportError:  # Windows has no flock
    fcntl = None  # type: ignore[assignment]

NAME = "in-use.lock"
"""Name of the file that is locked in a folder."""


class Lock:
    """A lock that this process holds on a path, alone or shared, until `release`. Small files beside the
    output are locked, never the output itself.

    output: the output, for the message; works: false if the file system has no locks. Raises RunFileError
    if another process holds a lock that does not agree with this one."""

    def __init__(self, path: Path, output: Path, shared: bool = False):
        self.path, self.works = path, True
        while True:
            self._file = opened(self.path, output)
            if not self._take(shared):
                self._file.close()
                raise ArgumentError("output", "not be in use by another process", f"{output} is")
            if is_file_at(self._file, self.path):
                return
            self._file.close()  # the process that held the lock has just removed the file

    def __enter__(self) -> "Lock":
        return self

    def __exit__(self, *error: object) -> None:
        self.release()

    def share(self) -> None:
        """Lets other processes share the folder."""
        self._take(shared=True)

    def try_alone(self) -> bool:
        """Gives up a shared lock and tries to hold the folder alone. False as long as another process holds
        a lock."""
        return self._take(shared=False)

    def release(self, remove: bool = True) -> None:
        """Ends the lock. remove: remove the file, which only a process that holds the lock alone may do."""
        if remove and is_file_at(self._file, self.path):
            self.path.unlink(missing_ok=True)
        self._file.close()

    def _take(self, shared: bool) -> bool:
        if fcntl is None:
            self.works = False
            return True
        try:
            fcntl.flock(self._file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:
            self.works = False
        return True


class FolderLock(Lock):
    """A lock on a folder, which is created if it does not exist."""

    def __init__(self, folder: Path, shared: bool = False):
        folder.mkdir(parents=True, exist_ok=True)
        super().__init__(folder / NAME, folder, shared)


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


def in_use(folder: Path) -> bool:
    """Tells whether a process holds a lock on a folder."""
    if not (folder / NAME).exists():
        return False
    try:
        FolderLock(folder).release(remove=False)
    except RunFileError:
        return True
    return False
