"""HDF5 files: atomic replacement, datasets with physical units, attributes.

A file of this package is never changed in place. The new content goes to a temporary file beside it,
which is flushed to the disk and then renamed. Whatever kills the writer, a reader finds the old file or
the new one, complete and closed.
"""

import contextlib
import errno
import os
import platform
import shutil
from collections.abc import Iterable, Iterator, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from esail_jax.atomic_file import PART, atomic_file
from esail_jax.errors import NoSpaceError, is_full
from esail_jax.files.seal import USER_BLOCK, write_seal
from esail_jax.observables import Observable, shape_of

ROWS_PER_CHUNK = 64
"""Number of instants in one HDF5 chunk of a dataset that grows."""

FILTERS = {"shuffle": True, "compression": "gzip", "compression_opts": 1, "fletcher32": True}
"""HDF5 filters of a dataset that grows: lossless compression, which every HDF5 reader knows, and a checksum
of every chunk, so that damaged numbers are not read. Runs of the baseline are a fifth smaller."""

LEAST_ROOM = 2**20
"""Number of bytes [B] that a file may need for its structure, texts and attributes."""

REUSED_SPACE = {"fs_strategy": "fsm", "fs_persist": True}
"""HDF5 keeps a list of the free space of a file. A chunk that has grown is written to a new place; without
this list the old place is lost, and a run with many checkpoints is 1.7 times as large."""


@contextlib.contextmanager
def atomic_hdf5(
    path: str | os.PathLike,
    update: bool = False,
    unique: bool = False,
    sealed: bool = False,
    room: int = LEAST_ROOM,
) -> Iterator[h5py.File]:
    """Context manager: gives an HDF5 file to write, which replaces `path` when the block ends.

    update: start from a copy of `path` instead of an empty file; unique: as for `atomic_file`; sealed:
    write the checksum of the whole file to its user block (`files/seal.py`); room: number of bytes by which
    the file may grow. Raises NoSpaceError before HDF5 writes anything if the disk has no room for the file.
    HDF5 itself cannot close a file on a full disk: it reports every dataset, and may crash the process.
    """
    with atomic_file(path, unique) as part:
        reserve(part, room + (os.path.getsize(path) if update else 0))
        if update:
            shutil.copyfile(path, part)
        block = {"userblock_size": USER_BLOCK} if sealed else {}
        with h5py.File(part, "r+") if update else h5py.File(part, "w", **block, **REUSED_SPACE) as file:
            yield file
        if sealed:
            write_seal(part)


@contextlib.contextmanager
def atomic_hdf5_in_memory(path: str | os.PathLike) -> Iterator[h5py.File]:
    """Context manager: gives an HDF5 file in memory, which is written to `path` as a whole when the block
    ends. The name of the temporary file is unique, as for `atomic_file`.

    Written by Python, the file raises one error on a full disk. Raises NoSpaceError if the disk is full."""
    with h5py.File(f"{path} in memory", "w", driver="core", backing_store=False) as file:
        yield file
        file.flush()
        image = file.id.get_file_image()
    with atomic_file(path, unique=True) as part:
        part.write_bytes(image)


def require_room(path: Path, size: int) -> None:
    """Raises NoSpaceError unless the disk, and the user's quota, have room for another file of `size` bytes
    at `path`: for a file that is too large for memory (`atomic_hdf5_in_memory`)."""
    part = path.with_name(f"{path.name}.room.{os.getpid()}{PART}")
    try:
        reserve(part, size)
    finally:
        part.unlink(missing_ok=True)


def reserve(path: Path, size: int) -> None:
    """Gives a new file `size` bytes of the disk, where the system can do so. Raises NoSpaceError if the
    disk, or the user's quota, has no room for them."""
    try:
        if not hasattr(os, "posix_fallocate"):
            if shutil.disk_usage(path.parent).free < size:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return
        with open(path, "wb") as file:
            os.posix_fallocate(file.fileno(), 0, size)
    except OSError as error:
        if is_full(error):
            raise NoSpaceError(f"no space is left in {path.parent}") from error
        # Other errors: this file system cannot reserve room.


def create_quantity(
    file: h5py.File,
    name: str,
    shape: tuple[int, ...],
    axes: Iterable[str],
    unit: str,
    symbol: str,
    equation: str = "",
    grows: bool = False,
) -> h5py.Dataset:
    """Creates a dataset of numbers with the attributes `unit`, `symbol`, `equation` and `axes`.

    grows: the first axis can be extended. Otherwise values that are never written are NaN.
    """
    storage: dict[str, Any] = {"fillvalue": np.nan}
    if grows:
        storage = {"maxshape": (None, *shape[1:]), "chunks": (ROWS_PER_CHUNK, *shape[1:]), **FILTERS}
    data = file.create_dataset(name, shape, float, **storage)
    data.attrs.update({"unit": unit, "symbol": symbol, "equation": equation})
    data.attrs["axes"] = list(axes)
    return data


def create_observables(
    file: h5py.File,
    observables: Iterable[Observable],
    sizes: Mapping[str, int],
    leading: dict[str, int],
    grows: bool = False,
) -> None:
    """Creates /observables/NAME for every observable, by `create_quantity`.

    sizes: lengths of an observable's own axes (`Scene.sizes`); leading: names and lengths of the axes that
    come before these.
    """
    for entry in observables:
        shape = (*leading.values(), *shape_of(entry.axes, sizes))
        name, axes = f"observables/{entry.name}", (*leading, *entry.axes)
        create_quantity(file, name, shape, axes, entry.unit, entry.symbol, entry.equation, grows)


def append(data: h5py.Dataset, values: np.ndarray) -> None:
    """Appends rows to a dataset that grows."""
    before = data.shape[0]
    data.resize(before + len(values), axis=0)
    data[before:] = values


def versions() -> dict[str, str]:
    """Attributes with the versions of Python and of the packages that compute a run."""
    packages = ("esail_jax", "jax", "jaxlib", "numpy", "h5py")
    attributes = {}
    for name in packages:
        try:
            attributes[f"version_{name}"] = metadata.version(name)
        except metadata.PackageNotFoundError:  # run from a source tree that is not installed
            attributes[f"version_{name}"] = "not installed"
    return attributes | {"version_python": platform.python_version()}
