"""A store of compiled programs: a folder that is kept from one process to the next.

A program is machine code, which a process runs with its user's rights. Only that user may therefore write
to the folder (mode 0700), and a folder that others can write to is not used. Every file carries a checksum:
a damaged file is read as missing. Nothing here raises an error because of the disk: a program that cannot
be read or written is compiled again.
"""

import contextlib
import hashlib
import os
import shutil
import stat
import warnings
from pathlib import Path
from typing import NamedTuple

SUFFIX = ".program"
"""Suffix of the files."""

PART = ".part"
"""Last suffix of a file that is being written."""

CACHE_OF_JAX = "jax"
"""Folder within that of the store in which JAX keeps what it compiles, where this package does not."""

OFF = ("off", "0", "no", "false")
"""Values of environment variables that switch something off."""


class Usage(NamedTuple):
    """What a store holds. files: number of programs; size: bytes of all of them."""

    files: int
    size: int


class File(NamedTuple):
    """A file of a store. used: time of its last use [s since the epoch]; size: in bytes."""

    used: float
    size: int
    path: Path


class Store:
    """Programs by name, in a folder of the user's.

    name: of the folder in the user's cache folder, with `/` between its parts; variable: the environment
    variable that names another folder, or switches the store off by `off`; header: the first bytes of every
    file; most_bytes: the largest size of all files together, above which those used longest ago are
    removed."""

    def __init__(self, name: str, variable: str, header: bytes, most_bytes: int = 2**30):
        self.name, self.variable, self.header, self.most_bytes = name, variable, header, most_bytes

    def location(self) -> Path | None:
        """The folder, which may not exist yet, or None if the store is off."""
        given = os.environ.get(self.variable)
        if given is not None and given.lower() in (*OFF, ""):
            return None
        if given is not None:
            return Path(given).expanduser().absolute()
        base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
        return Path(base, *self.name.split("/"))

    def switch_off(self) -> None:
        """Switches the store off for this process and those that it starts. Measurements of the compile
        time need this: otherwise they would measure the time of loading."""
        os.environ[self.variable] = "off"

    def load(self, name: str) -> bytes | None:
        """The content of a file, or None if it is missing or damaged."""
        folder = self.private_folder()
        if folder is None:
            return None
        path = folder / (name + SUFFIX)
        try:
            content = path.read_bytes()
            os.utime(path)  # used now
        except OSError:
            return None
        start = len(self.header) + hashlib.sha256().digest_size
        data = content[start:]
        good = content[:start] == self.header + hashlib.sha256(data).digest()
        return data if good else None

    def has(self, name: str) -> bool:
        """Tells whether there is a file of this name."""
        folder = self.private_folder()
        return folder is not None and (folder / (name + SUFFIX)).exists()

    def save(self, name: str, data: bytes) -> None:
        """Writes a file, and removes old ones if the store becomes too large."""
        folder = self.private_folder(create=True)
        if folder is None:
            return
        with contextlib.suppress(OSError):
            replace(folder / (name + SUFFIX), self.header + hashlib.sha256(data).digest() + data)
        self.remove_old(folder)

    def usage(self) -> Usage:
        """Number and size of the programs."""
        sizes = [file.size for file in files(self.private_folder())]
        return Usage(len(sizes), sum(sizes))

    def clear(self) -> int:
        """Removes all programs, and what JAX keeps here. Returns the number of programs that were there.
        Windows does not remove a file that a process uses."""
        folder = self.private_folder()
        stored = files(folder)
        for file in stored:
            with contextlib.suppress(OSError):
                file.path.unlink()
        if folder is not None:
            shutil.rmtree(folder / CACHE_OF_JAX, ignore_errors=True)
        return len(stored)

    def private_folder(self, create: bool = False) -> Path | None:
        """The folder if there is one that only this user can write to, otherwise None."""
        folder = self.location()
        if folder is None:
            return None
        try:
            if create:
                folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            status = folder.stat()
        except OSError:
            return None
        if not stat.S_ISDIR(status.st_mode):
            return None
        # Windows has neither user numbers nor these bits: there the folder is that of the user's profile.
        if hasattr(os, "getuid"):
            open_to_others = status.st_uid != os.getuid() or status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
            if open_to_others:
                warnings.warn(
                    f"`{self.variable}` must be a folder that only you can write to, but {folder} is open "
                    "to others; compiled programs are not kept",
                    stacklevel=2,
                )
                return None
        return folder

    def remove_old(self, folder: Path) -> None:
        """Removes the files used longest ago until the others fit into `most_bytes`."""
        with contextlib.suppress(OSError):
            stored = files(folder)
            excess = sum(file.size for file in stored) - self.most_bytes
            for file in stored:
                if excess <= 0:
                    break
                file.path.unlink(missing_ok=True)
                excess -= file.size


def replace(path: Path, content: bytes) -> None:
    """Writes a file that a reader finds whole or not at all. Raises OSError if it cannot be written."""
    part = path.with_name(f"{path.name}.{os.getpid()}{PART}")
    try:
        with open(part, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def files(folder: Path | None) -> list[File]:
    """All files of a folder, the one used longest ago first, including what a killed process left
    behind."""
    stored = []
    for path in folder.iterdir() if folder is not None else ():
        if path.name.endswith((SUFFIX, PART)):
            with contextlib.suppress(OSError):  # another process may have removed it
                seen = path.stat()
                stored.append(File(seen.st_mtime, seen.st_size, path))
    return sorted(stored)
