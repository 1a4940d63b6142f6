"""The program cache: a folder of compiled programs, kept from one process to the next.

The folder is `programs` in the user's cache folder, or what the environment variable `ESAIL_CACHE` names;
`ESAIL_CACHE=off` switches the cache off. A program is machine code, which a process runs with its user's
rights. Only that user may therefore write to the folder (mode 0700), and a folder that others can write to
is not used. Every file carries a checksum: a damaged file is read as missing. Nothing here raises an error
because of the disk: a program that cannot be read or written is compiled again.
"""

import contextlib
import hashlib
import os
import stat
import warnings
from pathlib import Path
from typing import NamedTuple

from esail_jax.atomic_file import PART, atomic_file

VARIABLE = "ESAIL_CACHE"
"""Environment variable: the path of the folder, or `off`."""

SUFFIX = ".program"
"""Suffix of the files."""

HEADER = b"esail_jax program\n"
"""First bytes of a file. The SHA-256 checksum of the rest follows."""

MOST_BYTES = 2**30
"""Largest size of all files together (1 GiB, some hundred scenes). Those used longest ago are removed."""


class Usage(NamedTuple):
    """What the cache holds. files: number of programs; size: bytes of all of them."""

    files: int
    size: int


def location() -> Path | None:
    """Returns the folder of the cache, which may not exist yet, or None if the cache is off."""
    given = os.environ.get(VARIABLE)
    if given is not None and given.lower() in ("off", "0", "no", "false", ""):
        return None
    if given is not None:
        return Path(given).expanduser().absolute()
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(base) / "esail_jax" / "programs"


def switch_off() -> None:
    """Switches the cache off for this process and those that it starts. Measurements of the compile time
    need this: otherwise they would measure the time of loading."""
    os.environ[VARIABLE] = "off"


def load(name: str) -> bytes | None:
    """Returns the content of a file, or None if it is missing or damaged."""
    folder = private_folder()
    if folder is None:
        return None
    path = folder / (name + SUFFIX)
    try:
        content = path.read_bytes()
        os.utime(path)  # used now
    except OSError:
        return None
    start = len(HEADER) + hashlib.sha256().digest_size
    data = content[start:]
    good = content[:start] == HEADER + hashlib.sha256(data).digest()
    return data if good else None


def has(name: str) -> bool:
    """Tells whether there is a file of this name."""
    folder = private_folder()
    return folder is not None and (folder / (name + SUFFIX)).exists()


def save(name: str, data: bytes) -> None:
    """Writes a file, and removes old ones if the cache becomes too large."""
    folder = private_folder(create=True)
    if folder is None:
        return
    with contextlib.suppress(OSError), atomic_file(folder / (name + SUFFIX), unique=True) as part:
        part.write_bytes(HEADER + hashlib.sha256(data).digest() + data)
    remove_old(folder)


def usage() -> Usage:
    """Returns number and size of the programs in the cache."""
    sizes = [file.size for file in files(private_folder())]
    return Usage(len(sizes), sum(sizes))


def clear() -> int:
    """Removes all programs of the cache. Returns their number."""
    found = files(private_folder())
    for file in found:
        file.path.unlink(missing_ok=True)
    return len(found)


# ---- the folder ----------------------------------------------------------------------------------


class File(NamedTuple):
    """A file of the cache. used: time of its last use [s since the epoch]; size: in bytes."""

    used: float
    size: int
    path: Path


def private_folder(create: bool = False) -> Path | None:
    """Returns the folder if there is one that only this user can write to, otherwise None."""
    folder = location()
    if folder is None:
        return None
    try:
        if create:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.stat()
    except OSError:
        return None
    if not stat.S_ISDIR(found.st_mode):
        return None
    mine = not hasattr(os, "getuid") or found.st_uid == os.getuid()
    if not mine or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        warnings.warn(
            f"`{VARIABLE}` must be a folder that only you can write to, but {folder} is open to others; "
            "compiled programs are not kept",
            stacklevel=2,
        )
        return None
    return folder


def files(folder: Path | None) -> list[File]:
    """Returns all files, the one used longest ago first, including what a killed process left behind."""
    found = []
    for path in folder.iterdir() if folder is not None else ():
        if path.name.endswith((SUFFIX, PART)):
            with contextlib.suppress(OSError):  # another process may have removed it
                seen = path.stat()
                found.append(File(seen.st_mtime, seen.st_size, path))
    return sorted(found)


def remove_old(folder: Path) -> None:
    """Removes the files used longest ago until the others fit into MOST_BYTES."""
    with contextlib.suppress(OSError):
        found = files(folder)
        excess = sum(file.size for file in found) - MOST_BYTES
        for file in found:
            if excess <= 0:
                break
            file.path.unlink(missing_ok=True)
            excess -= file.size
