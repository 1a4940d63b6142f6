"""A lock on a folder of results: one process writes there alone, or several processes share the folder.

The lock is one of the operating system (flock) on a small file. It ends with the process that holds it,
also with one that is killed, so that nothing has to be cleaned up. Some file systems of clusters have no
such locks; there `works` is false, and the folder is not guarded.
"""

import os
from pathlib import Path
from typing import IO

from esail_jax.files.opening import RunFileError

try:
    import fcntl
except ImportError:  # Windows has no flock
    fcntl = None  # type: ignore[assignment]

NAME = "in-use.lock"
"""Name of the file that is locked."""


class FolderLock:
    """A lock that this process holds on a folder, alone or shared, until `release`.

    works: false if the file system has no locks. The folder is created if it does not exist. Raises
    RunFileError if another process holds a lock that does not agree with this one."""

    def __init__(self, folder: Path, shared: bool = False):
        folder.mkdir(parents=True, exist_ok=True)
        self.path, self.works = folder / NAME, True
        while True:
            self._file: IO = open(self.path, "a+")
            if not self._take(shared):
                self._file.close()
                raise RunFileError(f"`-o` must not be in use by another process, but {folder} is")
            if is_file_at(self._file, self.path):
                return
            self._file.close()  # the process that held the lock has just removed the file

    def share(self) -> None:
        """Lets other processes share the folder."""
        self._take(shared=True)

    def try_alone(self) -> bool:
        """Gives up a shared lock and tries to hold the folder alone. False as long as another process holds
        a lock."""
        return self._take(shared=False)

    def release(self, remove: bool = True) -> None:
        """Ends the lock. remove: remove the file, which only a process that holds the folder alone may
        do."""
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
