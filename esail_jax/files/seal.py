"""The seal of a run file: a checksum of the whole file, in the user block before the HDF5 part.

A run file is written as a whole and replaced as a whole, so one checksum covers all of it: rows, state,
attributes, and the structure of HDF5 itself. A file in which a bit has changed, or that was cut short, is
refused before HDF5 reads it. HDF5 programs skip the user block.
"""

import hashlib
import os
from pathlib import Path
from typing import BinaryIO

USER_BLOCK = 512
"""Size [bytes] of the user block, the smallest that HDF5 allows."""

MAGIC = b"esail_jax run file, SHA-256 of what follows this block: "
"""Text before the checksum."""


def seal_of(file: BinaryIO) -> bytes:
    """The user block that belongs to the content of an open file: the text, the SHA-256 of what
    follows the block as hexadecimal digits, and zeros."""
    file.seek(USER_BLOCK)
    digest = hashlib.file_digest(file, "sha256").hexdigest()  # type: ignore[arg-type]
    return (MAGIC + digest.encode() + b"\n").ljust(USER_BLOCK, b"\0")


def write_seal(path: Path) -> None:
    """Writes the checksum of a closed file into its user block."""
    with open(path, "r+b") as file:
        seal = seal_of(file)
        file.seek(0)
        file.write(seal)


def is_sealed(path: str | os.PathLike) -> bool:
    """Tells whether the checksum of a file is right. False for a file without one. The file is opened once:
    a running simulation may replace it by the next one at any moment."""
    with open(path, "rb") as file:
        return file.read(USER_BLOCK) == seal_of(file)


def has_seal(path: str | os.PathLike) -> bool:
    """Tells whether a file begins like a sealed one. False for a file that does not exist."""
    try:
        with open(path, "rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False
