"""Opening run files and files of ensembles, with the checks that every reader needs. This module needs no
JAX, which takes longer to import than a file to read."""

import contextlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import h5py

from esail_jax.errors import InputError
from esail_jax.files.seal import has_seal, is_sealed

SCHEMA_VERSION = 3
"""Version of the layout of run files and ensemble files. Files of another version are refused: their
checkpoints and results have other names."""


WHOLE = "ensemble.h5"
"""Name of the file of a whole ensemble in its folder."""

DESIGN = "design.h5"
"""Name of the history of a design in its folder."""

RUNS_OF_DESIGN = "before.h5", "after.h5"
"""Names of the runs with constant voltage and with the design, in the same folder."""


class RunFileError(InputError):
    """A run file that cannot be used as asked."""


class ArgumentError(RunFileError):
    """An argument that does not suit a file. The message names it, what it must be, and what it is."""

    def __init__(self, key: str, must: str, got: str):
        super().__init__(f"`{key}` must {must}, but {got}")
        self.key, self.must, self.got = key, must, got

    def __reduce__(self) -> tuple[type, tuple[str, str, str]]:
        return type(self), (self.key, self.must, self.got)


def files_of(paths: Iterable[Path]) -> list[Path]:
    """The run files that paths stand for: of the folder of an ensemble its file, of the folder of a
    design its two runs, otherwise the path itself. Raises RunFileError for another folder."""
    files = []
    for path in paths:
        if not path.is_dir():
            files.append(path)
        elif (path / DESIGN).exists():
            files += [path / name for name in RUNS_OF_DESIGN]
        elif (path / WHOLE).exists():
            files.append(path / WHOLE)
        else:
            raise RunFileError(f"`{path}` must be a run file, but is a folder without an {WHOLE}")
    return files


def holds_ensemble(path: str | os.PathLike) -> bool:
    """Tells whether a file contains an ensemble rather than one run. Raises RunFileError for other
    files."""
    with open_run(path) as file:
        return "members" in file


def open_single(path: str | os.PathLike) -> h5py.File:
    """Opens the file of one run for reading. Raises RunFileError for any other file."""
    file = open_run(path)
    if "members" in file:
        file.close()
        raise RunFileError(f"`{path}` must be a file of one run, but is of an ensemble")
    return file


def open_run(path: str | os.PathLike) -> h5py.File:
    """Opens the file of a run or an ensemble for reading. Raises RunFileError for any other file, and for
    the file of one run whose checksum is wrong."""
    if has_seal(path) and not is_sealed(path):
        raise damaged(path, "its checksum is wrong")
    try:
        file = h5py.File(path)
    except OSError as error:
        reason = "cannot be read as HDF5"
        if not os.path.exists(path):
            reason = "does not exist"
        elif os.path.isdir(path):
            reason = "is a folder"
        elif str(path).endswith(".toml"):
            reason = "is a scene"
        elif h5py.is_hdf5(path):
            raise damaged(path, error) from error
        raise RunFileError(f"`{path}` must be a run file, but {reason}") from error
    if "schema_version" not in file.attrs or "scene" not in file:
        reason = "is the history of a design: give its folder" if "memory" in file else "has no scene"
        file.close()
        raise RunFileError(f"`{path}` must be a run file, but {reason}")
    if file.attrs["schema_version"] != SCHEMA_VERSION:
        version = file.attrs["schema_version"]
        file.close()
        raise RunFileError(
            f"`{path}` must have schema version {SCHEMA_VERSION}, but has {version}: "
            "read it with the version of esail_jax that wrote it"
        )
    if "members" not in file and not has_seal(path):
        file.close()
        raise damaged(path, "its checksum is missing")
    return file


def damaged(path: str | os.PathLike, reason: Any) -> RunFileError:
    """The error for a file that was damaged, or changed by another program, after it was written."""
    return RunFileError(f"`{path}` must be an intact run file, but is damaged ({reason})")


@contextlib.contextmanager
def intact(path: str | os.PathLike) -> Iterator[None]:
    """Context manager: raises RunFileError if HDF5 cannot read data of an open file, for example because
    the checksum of a chunk is wrong. An error of the system, which names its file, is passed on."""
    try:
        yield
    except OSError as error:
        if error.filename is not None:
            raise
        raise damaged(path, error) from error


def to_python(value: Any) -> Any:
    """An HDF5 attribute as a plain Python value, a list of several."""
    return value.tolist() if hasattr(value, "tolist") else value
