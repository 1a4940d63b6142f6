"""Files of an ensemble: the task, the pieces that processes have computed, and the whole ensemble.

    DIR/parts/task.h5         the task: scene, inputs, members of every piece
    DIR/parts/NUMBER.claim    a mark: a process has taken this piece
    DIR/parts/NUMBER.h5       a piece that is computed
    DIR/ensemble.h5           a run file with `member` as first axis

Processes share nothing but this folder. Files are replaced as a whole (`files/hdf5.py`), so a process
that is killed leaves no damaged file. `ensembles/merging.py` puts the pieces into ensemble.h5.
"""

import dataclasses
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import h5py
import jax
import numpy as np

from esail_jax.ensembles.ensemble import Ensemble
from esail_jax.ensembles.sampling import Inputs
from esail_jax.files.hdf5 import atomic_hdf5_in_memory
from esail_jax.files.opening import (
    WHOLE,
    ArgumentError,
    RunFileError,
    intact,
    open_run,
    to_python,
)
from esail_jax.files.reading import MISSING
from esail_jax.scenes.loading import parse
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.toml_text import to_toml

COMPLETE, FAILED = "complete", "failed"
"""Status of a member: it reached its end; it failed, and is NaN from there on. The third is `MISSING`."""

TEXT = h5py.string_dtype()

TASK = "task.h5"
"""Name of the file of the task, beside the pieces."""


@dataclasses.dataclass(frozen=True)
class Task:
    """An ensemble to be computed.

    count: number of members; inputs: of all members; vary: the variations, as on the command line;
    sampling, seed: as for `draw`; observables: names to keep; max_steps: largest number of steps of a
    member, which may change when the ensemble is resumed."""

    scene: Scene
    count: int
    inputs: Inputs
    vary: tuple[str, ...]
    sampling: str
    seed: int
    observables: tuple[str, ...]
    max_steps: int | None = None

    @property
    def identity(self) -> dict[str, Any]:
        """Attributes that, with the scene, identify the ensemble a file belongs to."""
        # The points of a Latin hypercube depend on the number of members.
        sampling = f"latin of {self.count}" if self.sampling == "latin" else self.sampling
        return {
            "vary": "\n".join(self.vary),
            "sampling": sampling,
            "seed": self.seed,
            "observables": "\n".join(self.observables),
        }


# ---- the task -----------------------------------------------------------------------------------


def parts_of(folder: Path) -> Path:
    """The folder of the task and its pieces."""
    return folder / "parts"


def publish(folder: Path, task: Task, pieces: Sequence[np.ndarray]) -> None:
    """Writes a task to its folder, for processes to take its pieces.

    pieces: numbers of the members of every piece. Claims of earlier processes are removed."""
    parts = parts_of(folder)
    parts.mkdir(parents=True, exist_ok=True)
    for claim in parts.glob("*.claim"):
        claim.unlink()
    with atomic_hdf5_in_memory(parts / TASK) as file:
        write_identity(file, task)
        file.attrs.update({"count": task.count, "max_steps": task.max_steps or 0})
        for key, values in task.inputs.items():
            file[f"inputs/{key}"] = values
        for number, members in enumerate(pieces):
            file[f"pieces/{number:06d}"] = members


def read_task(folder: Path) -> tuple[Task, list[np.ndarray]]:
    """Reads the task of a folder and its pieces."""
    with h5py.File(parts_of(folder) / TASK) as file:
        a = {name: to_python(value) for name, value in file.attrs.items()}
        inputs = {key: data[()] for key, data in file.get("inputs", {}).items()}
        pieces = [data[()] for data in file.get("pieces", {}).values()]
        scene = parse(file["scene"].asstr()[()], str(folder))
    vary, names = (tuple(a[name].split("\n")) if a[name] else () for name in ("vary", "observables"))
    sampling = a["sampling"].partition(" ")[0]
    most = a["max_steps"] or None
    return Task(scene, a["count"], inputs, vary, sampling, a["seed"], names, most), pieces


def write_identity(file: h5py.File, task: Task) -> None:
    """Writes scene and attributes that identify the ensemble."""
    file["scene"] = to_toml(task.scene)
    file.attrs.update(task.identity)


def try_claim(folder: Path, name: str) -> bool:
    """Takes a piece (or the merging of all pieces); false if another process has taken it."""
    try:
        os.close(os.open(parts_of(folder) / f"{name}.claim", os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return False
    return True


def take_pieces(folder: Path, pieces: Sequence[np.ndarray]) -> Iterator[tuple[str, np.ndarray]]:
    """Yields name and members of the pieces that no other process has taken, and takes them one by one."""
    for number, members in enumerate(pieces):
        name = f"{members[0]:08d}-{members[-1]:08d}-{number:06d}"
        if try_claim(folder, name):
            yield name, members


# ---- pieces -------------------------------------------------------------------------------------


def write_piece(folder: Path, name: str, task: Task, piece: Ensemble, seconds: tuple[float, float]) -> None:
    """Writes a computed piece. seconds: spent on compiling and on running."""
    with atomic_hdf5_in_memory(parts_of(folder) / f"{name}.h5") as file:
        write_identity(file, task)
        file.attrs.update({"compile_time": seconds[0], "wall_time": seconds[1]})
        file.attrs["device"] = jax.devices()[0].device_kind
        file["member"], file["time"], file["steps"] = piece.members, piece.time, piece.steps
        file["complete"] = piece.complete
        file.create_dataset("message", data=list(piece.messages), dtype=TEXT)
        for observable, values in piece.observables.items():
            file[f"observables/{observable}"] = values


def pieces_in(folder: Path) -> list[Path]:
    """Paths of the computed pieces."""
    return sorted(path for path in parts_of(folder).glob("*-*.h5"))


def computed_members(folder: Path, task: Task) -> tuple[np.ndarray, int]:
    """Numbers of the members that are already computed, and the number of members of ensemble.h5, or 0.

    Raises RunFileError if a file in the folder belongs to another ensemble."""
    done: list[np.ndarray] = []
    held = 0
    whole = folder / WHOLE
    if whole.exists():
        with open_run(whole) as file:
            check_same(whole, file, task)
            status = file["members/status"].asstr()[()]
            done.append(np.flatnonzero(status != MISSING))
            held = len(status)
    for path in pieces_in(folder):
        with h5py.File(path) as file:
            check_same(path, file, task)
            done.append(file["member"][()])
    return np.unique(np.concatenate([*done, np.empty(0, int)])), held


def outcome_counts(folder: Path) -> tuple[int, int]:
    """Numbers of members that failed, and that have a warning, in the pieces and in ensemble.h5."""
    failed = warned = 0
    whole = folder / WHOLE
    for path in [*pieces_in(folder), *([whole] if whole.exists() else [])]:
        with h5py.File(path) as file:
            status, messages, _ = status_of(file)
        failed += int((status == FAILED).sum())
        warned += int(((status == COMPLETE) & (messages != "")).sum())
    return failed, warned


def status_of(file: h5py.File) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Status and message of the members that a piece or an ensemble.h5 holds, and their numbers of
    steps."""
    if "member" in file:
        status = np.where(file["complete"][()], COMPLETE, FAILED).astype(object)
        return status, file["message"].asstr()[()], file["steps"][()]
    places = (file["members/status"].asstr(), file["members/message"].asstr(), file["numerics/steps"])
    status, messages, steps = (place[()] for place in places)
    held = status != MISSING
    return status[held], messages[held], steps[held]


def check_same(path: Path, file: h5py.File, task: Task) -> None:
    """Raises RunFileError unless a file belongs to this ensemble."""
    if "members" not in file and "member" not in file:
        raise RunFileError(f"`{path}` must be a file of an ensemble, but is of one run")
    same = {name: to_python(file.attrs[name]) == value for name, value in task.identity.items()}
    same["scene"] = file["scene"].asstr()[()] == to_toml(task.scene)
    for name, agrees in same.items():
        if not agrees:
            raise ArgumentError("task", f"go on with the same {name}", f"{path} is of another")


# ---- the whole ensemble -------------------------------------------------------------------------


def load_ensemble(path: str | os.PathLike, observables: Sequence[str] | None = None) -> Ensemble:
    """Reads an ensemble.h5, with all its observables or those of the given names that it has.

    Raises RunFileError."""
    with open_run(path) as file, intact(path):
        if "members" not in file:
            raise RunFileError(f"`{path}` must be a file of an ensemble, but is of one run")
        status = file["members/status"].asstr()[()]
        return Ensemble(
            parse(file["scene"].asstr()[()], str(path)),
            np.arange(len(status)),
            file["time"][()],
            {key: data[()] for key, data in file.get("inputs", {}).items()},
            {
                name: data[()]
                for name, data in file["observables"].items()
                if observables is None or name in observables
            },
            status == COMPLETE,
            tuple(file["members/message"].asstr()[()]),
            file["numerics/steps"][()],
        )
