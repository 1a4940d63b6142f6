"""Atomic replacement of a file or folder: a reader finds the old content or the new one, never a part."""

import contextlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from esail_jax.errors import NoSpaceError, is_full

PART = ".part"
"""Last suffix of a temporary file."""


@contextlib.contextmanager
def atomic_file(path: str | os.PathLike, unique: bool = False) -> Iterator[Path]:
    """Context manager: gives the path of a temporary file, which replaces `path` when the block ends.

    If the block raises, the temporary file is removed and `path` stays as it is. unique: the name of the
    temporary file holds the process number, for a file that several processes may write at the same time.
    Raises NoSpaceError if the disk is full.
    """
    path = Path(path)
    part = path.with_name(f"{path.name}.{os.getpid()}{PART}" if unique else f"{path.name}{PART}")
    try:
        yield part
        with open(part, "rb") as file:
            os.fsync(file.fileno())
        os.replace(part, path)
    except BaseException as error:
        with contextlib.suppress(OSError):  # it may be in no folder
            part.unlink(missing_ok=True)
        name_asked(error, part, path)
        raise


@contextlib.contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Context manager: gives the path of a temporary folder, which replaces the folder `path` when the
    block ends. If the block raises, the temporary folder is removed and `path` stays as it is. Raises
    NoSpaceError if the disk is full."""
    part = path.with_name(f"{path.name}{PART}")
    shutil.rmtree(part, ignore_errors=True)
    try:
        yield part
        target = path.resolve()  # of a link the folder behind it
        shutil.rmtree(target, ignore_errors=True)
        os.replace(part, target)
    except BaseException as error:
        shutil.rmtree(part, ignore_errors=True)
        name_asked(error, part, path)
        raise


def name_asked(error: BaseException, part: Path, path: Path) -> None:
    """Lets an error of the system name the path that was asked for in place of the temporary one. Raises
    NoSpaceError if the disk is full."""
    if is_full(error):
        raise NoSpaceError(f"no space is left in {path.parent}") from error
    if isinstance(error, OSError) and error.filename in (str(part), str(part.absolute())):
        error.filename = str(path)
