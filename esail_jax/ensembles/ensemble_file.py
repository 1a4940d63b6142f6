"""Files of an ensemble: the pieces that are computed, and the whole ensemble.

    DIR/parts/*.pieces        pieces that are computed (`ensembles/pieces.py`)
    DIR/ensemble.h5           a run file with `member` as first axis

One process writes to the folder, as long as it holds the folder's lock. ensemble.h5 is replaced as a whole
(`files/hdf5.py`). `ensembles/merging.py` puts the pieces into it.
"""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from esail_jax.array_types import Bool
from esail_jax.ensembles.ensemble import Ensemble
from esail_jax.ensembles.pieces import files_in, identity_of, pieces_of
from esail_jax.ensembles.task import Task
from esail_jax.files.opening import WHOLE, ArgumentError, RunFileError, intact, open_run, to_python
from esail_jax.files.reading import MISSING
from esail_jax.scenes.loading import parse

COMPLETE, FAILED = "complete", "failed"
"""Status of a member: it reached its end; it failed, and is NaN from there on. The third is `MISSING`."""


def parts_of(folder: Path) -> Path:
    """The folder of the pieces."""
    return folder / "parts"


def computed_members(folder: Path, task: Task) -> tuple[Bool[np.ndarray, " member"], int]:
    """Whether each member of a task is already computed, and the number of members of ensemble.h5, or 0.

    Raises RunFileError if a file in the folder belongs to another ensemble, and if ensemble.h5 has more
    members than the task."""
    done, held, whole = np.zeros(task.count, bool), 0, folder / WHOLE
    if whole.exists():
        with open_run(whole) as file, intact(whole):
            if "members" not in file:
                raise RunFileError(f"`{whole}` must be a file of an ensemble, but is of one run")
            attributes = {name: to_python(value) for name, value in file.attrs.items()}
            check_same(whole, {**attributes, "scene": file["scene"].asstr()[()]}, task)
            status = file["members/status"].asstr()[()]
        held = len(status)
        if held > task.count:
            raise ArgumentError("members", f"not be less than the {held} of {whole}", f"is {task.count}")
        done[:held] = status != MISSING
    for path in files_in(parts_of(folder)):
        found = identity_of(path)
        if found is None:
            continue
        check_same(path, found, task)
        for piece in pieces_of(path, arrays=False):
            if piece.members.max() >= task.count:
                must = f"not be less than the {found['count']} of {path}"
                raise ArgumentError("members", must, f"is {task.count}")
            done[piece.members] = True
    return done, held


def check_same(path: Path, found: dict[str, Any], task: Task) -> None:
    """Raises RunFileError unless what a file says of its ensemble is what the task says."""
    for name, value in {"reduce": None, **task.identity, "scene": task.text}.items():
        if found.get(name) != value:
            raise ArgumentError("task", f"go on with the same {name}", f"{path} is of another")


def unfinished(folder: Path) -> dict[str, Any] | None:
    """What the pieces in a folder say of their ensemble: the identity that was written last; None if there
    are none."""
    paths = sorted(files_in(parts_of(folder)), key=lambda path: path.stat().st_mtime)
    found = [x for x in map(identity_of, paths) if x is not None]
    return found[-1] if found else None


def status_of_pieces(folder: Path) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Status and messages of the members in the pieces of a folder, piece by piece."""
    for path in files_in(parts_of(folder)):
        for piece in pieces_of(path, arrays=False):
            status = np.where(piece.complete, COMPLETE, FAILED).astype(object)
            yield status, np.array(piece.messages, object)


def load_ensemble(path: str | os.PathLike, observables: Sequence[str] | None = None) -> Ensemble:
    """Reads an ensemble.h5, with all its observables, and numbers that stand for histories, or those of the
    given names that it has.

    Raises RunFileError."""
    with open_run(path) as file, intact(path):
        if "members" not in file:
            raise RunFileError(f"`{path}` must be a file of an ensemble, but is of one run")
        status = file["members/status"].asstr()[()]

        def wanted(name: str) -> bool:
            return observables is None or name in observables

        histories, numbers = (
            {name: data[()] for name, data in file.get(group, {}).items() if wanted(name)}
            for group in ("observables", "reduced")
        )
        return Ensemble(
            parse(file["scene"].asstr()[()], str(path)),
            np.arange(len(status)),
            file["time"][()],
            {key: data[()] for key, data in file.get("inputs", {}).items()},
            histories,
            status == COMPLETE,
            tuple(file["members/message"].asstr()[()]),
            file["numerics/steps"][()],
            numbers,
        )
