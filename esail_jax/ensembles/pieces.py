"""The pieces of an ensemble that is being computed, on the disk.

A file of pieces is a sequence of records that only grows, so that whatever kills the writer, all records
but the last are whole; a reader stops before a last one that is not. The first record of a file says which
ensemble it belongs to. A record is its length, the length and the checksum of its head, the checksum of
what follows, the head (JSON: what the arrays are), and the arrays.
"""

import json
import os
import struct
import time
import uuid
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from esail_jax.array_types import Bool, Float, Int
from esail_jax.errors import NoSpaceError, is_full
from esail_jax.files.opening import RunFileError

SUFFIX = ".pieces"
"""Suffix of a file of pieces."""

FRAME = struct.Struct("<QIII")
"""Bytes of the arrays, bytes of the head, checksum of the head, checksum of the arrays."""

SYNC_SECONDS = 1.0
"""Time between two requests to the system to bring records to the disk [s]. They outlive a killed process
without it, but not a machine that loses its power."""


class Piece(NamedTuple):
    """Results of some members.

    members: their numbers; complete, messages, steps: as in `Ensemble`; rows: observables by name, (member,
    time, ...), or reduced ones, (member, ...); seconds: spent on preparing programs and on running; device:
    what computed them."""

    members: Int[np.ndarray, " member"]
    complete: Bool[np.ndarray, " member"]
    messages: tuple[str, ...]
    steps: Float[np.ndarray, " member"]
    rows: dict[str, Float[np.ndarray, "member ..."]]
    seconds: tuple[float, float]
    device: str


class PieceFile:
    """A new file of pieces, to which this process alone appends.

    identity: what the ensemble is, which a reader gets back from `identity_of`; empty: whether it has no
    piece. Raises FileNotFoundError if its folder is gone, NoSpaceError if the disk is full."""

    def __init__(self, path: Path, identity: dict[str, Any]):
        self.path, self.empty, self._synced = path, True, time.monotonic()
        self._file = open(path, "xb", buffering=0)
        self._append(encode(identity, {}))

    def __enter__(self) -> "PieceFile":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def add(self, piece: Piece) -> None:
        """Appends a piece. Raises NoSpaceError if the disk is full."""
        head = {"messages": piece.messages, "seconds": piece.seconds, "device": piece.device}
        fixed = {"members": piece.members, "complete": piece.complete, "steps": piece.steps}
        self._append(encode(head, fixed | piece.rows))
        self.empty = False

    def _append(self, record: bytes) -> None:
        end = self._file.tell()
        try:
            written = 0
            while written < len(record):
                written += self._file.write(memoryview(record)[written:])
            if time.monotonic() - self._synced > SYNC_SECONDS:
                os.fsync(self._file.fileno())
                self._synced = time.monotonic()
        except OSError as error:
            self._file.truncate(end)
            if is_full(error):
                raise NoSpaceError(f"no space is left in {self.path.parent}") from error
            raise


def new_path(parts: Path) -> Path:
    """The path of a new file of pieces."""
    return parts / f"{uuid.uuid4().hex}{SUFFIX}"


def files_in(parts: Path) -> list[Path]:
    """Paths of the files of pieces in a folder."""
    return sorted(parts.glob(f"*{SUFFIX}"))


def encode(head: dict[str, Any], arrays: dict[str, np.ndarray]) -> bytes:
    """A record."""
    contiguous = {name: np.ascontiguousarray(x) for name, x in arrays.items()}
    described = {name: (x.dtype.str, x.shape) for name, x in contiguous.items()}
    text = json.dumps({**head, "arrays": described}).encode()
    data = b"".join(x.tobytes() for x in contiguous.values())
    return FRAME.pack(len(data), len(text), zlib.crc32(text), zlib.crc32(data)) + text + data


def records_of(path: Path, arrays: bool = True) -> Iterator[tuple[dict[str, Any], bytes]]:
    """Head and arrays of the whole records of a file. arrays: read the arrays of every record, or only
    those in FIXED, without their checksum. Raises RunFileError for a damaged record."""
    size = path.stat().st_size
    with open(path, "rb") as file:
        while True:
            frame = file.read(FRAME.size)
            if len(frame) < FRAME.size:
                return
            data_size, text_size, text_sum, data_sum = FRAME.unpack(frame)
            if file.tell() + text_size + data_size > size:
                return
            text = file.read(text_size)
            if zlib.crc32(text) != text_sum:
                raise damaged(path)
            head = json.loads(text)
            if arrays:
                data = file.read(data_size)
                if zlib.crc32(data) != data_sum:
                    raise damaged(path)
            else:
                data = file.read(min(data_size, bytes_of(head, FIXED)))
                file.seek(data_size - len(data), os.SEEK_CUR)
            yield head, data


def damaged(path: Path) -> RunFileError:
    """The error for a file whose numbers have changed."""
    todo = "remove it, and --resume computes its members again"
    return RunFileError(f"`{path}` must have whole pieces, but is damaged: {todo}")


FIXED = ("members", "complete", "steps")
"""The arrays of every piece, which come first."""


def bytes_of(head: dict[str, Any], names: tuple[str, ...]) -> int:
    """Bytes of the named arrays of a record."""
    arrays = [head["arrays"][name] for name in names if name in head["arrays"]]
    return sum(np.dtype(kind).itemsize * int(np.prod(shape)) for kind, shape in arrays)


def identity_of(path: Path) -> dict[str, Any] | None:
    """What the ensemble of a file is; None if the file was not begun when its writer was killed."""
    for head, _ in records_of(path, arrays=False):
        del head["arrays"]
        return head
    return None


def pieces_of(path: Path, arrays: bool = True) -> Iterator[Piece]:
    """The pieces of a file, one after the other. arrays: with their rows, or without. Raises
    RunFileError."""
    records = records_of(path, arrays)
    next(records, None)
    for head, data in records:
        found, place = {}, 0
        for name, (kind, shape) in head["arrays"].items():
            if not arrays and name not in FIXED:
                break
            end = place + np.dtype(kind).itemsize * int(np.prod(shape))
            found[name] = np.frombuffer(data[place:end], kind).reshape(shape)
            place = end
        members, complete, steps = (found.pop(name) for name in FIXED)
        seconds = (float(head["seconds"][0]), float(head["seconds"][1]))
        yield Piece(members, complete, tuple(head["messages"]), steps, found, seconds, head["device"])
