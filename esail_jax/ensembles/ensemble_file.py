"""Files of an ensemble: a task, what every process has computed of it, and all of it together.

    DIR/parts/task.h5         what is to be computed: scene, inputs, members
    DIR/parts/NUMBER.claim    of a process that computes this piece of the task
    DIR/parts/NUMBER.h5       a piece that is computed
    DIR/ensemble.h5           a run file with `member` as first axis

Processes share nothing but this folder. Every file is written beside its place and renamed, so that
whatever kills a process leaves whole files; `gather` puts the pieces into ensemble.h5.
"""

import dataclasses
import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import h5py
import jax
import numpy as np

from esail_jax.ensembles.members import Ensemble, system_of
from esail_jax.ensembles.sampling import Inputs
from esail_jax.files.run_file import SCHEMA_VERSION, RunFileError, open_run, plain, versions
from esail_jax.observables import listed, shape_of
from esail_jax.scenes.scene import Scene, parse, to_toml
from esail_jax.simulation.schedule import save_times

COMPLETE, FAILED, MISSING = "complete", "failed", "missing"
"""Of a member: at its end; stopped before, NaN from there on; not computed yet."""

TEXT = h5py.string_dtype()


@dataclasses.dataclass(frozen=True)
class Task:
    """An ensemble to be computed. count: members in the end; inputs: of all of them; vary: as it was asked
    for."""

    scene: Scene
    count: int
    inputs: Inputs
    vary: tuple[str, ...]
    sampling: str
    seed: int
    observables: tuple[str, ...]

    @property
    def identity(self) -> dict[str, Any]:
        """Attributes by which, beside the scene, a file is known to be of this ensemble."""
        # A Latin hypercube is laid out for all its members together.
        sampling = f"latin of {self.count}" if self.sampling == "latin" else self.sampling
        return {
            "vary": "\n".join(self.vary),
            "sampling": sampling,
            "seed": self.seed,
            "observables": "\n".join(self.observables),
        }


# ---- the task -----------------------------------------------------------------------------------


def parts_of(folder: Path) -> Path:
    """Where the pieces are."""
    return folder / "parts"


def write_task(folder: Path, task: Task, pieces: Sequence[np.ndarray]) -> None:
    """Leave a task for processes to take pieces of (members still to be computed); what an earlier one
    claimed and did not finish is free again."""
    parts = parts_of(folder)
    parts.mkdir(parents=True, exist_ok=True)
    for claim in parts.glob("*.claim"):
        claim.unlink()
    with Replacing(parts / "task.h5") as file:
        put_identity(file, task)
        file.attrs["count"] = task.count
        for key, values in task.inputs.items():
            file[f"inputs/{key}"] = values
        for number, members in enumerate(pieces):
            file[f"pieces/{number:06d}"] = members


def read_task(folder: Path) -> tuple[Task, list[np.ndarray]]:
    """The task that was left in a folder, and its pieces."""
    with h5py.File(parts_of(folder) / "task.h5") as file:
        a = {name: plain(value) for name, value in file.attrs.items()}
        inputs = {key: data[()] for key, data in file.get("inputs", {}).items()}
        pieces = [data[()] for data in file.get("pieces", {}).values()]
        scene = parse(file["scene"].asstr()[()], str(folder))
    vary, observables = (tuple(a[name].split("\n")) if a[name] else () for name in ("vary", "observables"))
    sampling = a["sampling"].partition(" ")[0]
    return Task(scene, a["count"], inputs, vary, sampling, a["seed"], observables), pieces


def put_identity(file: h5py.File, task: Task) -> None:
    """What a file is known by."""
    file["scene"] = to_toml(task.scene)
    file.attrs.update(task.identity)


def claim(folder: Path, name: str) -> bool:
    """Is this process the first to take a piece (or to gather them)?"""
    try:
        os.close(os.open(parts_of(folder) / f"{name}.claim", os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return False
    return True


def unclaimed(folder: Path, pieces: Sequence[np.ndarray]) -> Iterator[tuple[str, np.ndarray]]:
    """Names and members of the pieces that this process is the first to take, one after the other."""
    for number, members in enumerate(pieces):
        name = f"{members[0]:08d}-{members[-1]:08d}-{number:06d}"
        if claim(folder, name):
            yield name, members


# ---- pieces -------------------------------------------------------------------------------------


def write_piece(folder: Path, name: str, task: Task, found: Ensemble, seconds: tuple[float, float]) -> None:
    """What was computed of a piece. seconds: of compiling and of running."""
    with Replacing(parts_of(folder) / f"{name}.h5") as file:
        put_identity(file, task)
        file.attrs.update({"compile_time": seconds[0], "wall_time": seconds[1]})
        file.attrs["device"] = jax.devices()[0].device_kind
        file["member"], file["time"], file["steps"] = found.members, found.time, found.steps
        file["complete"] = found.complete
        file.create_dataset("message", data=list(found.messages), dtype=TEXT)
        for observable, values in found.rows.items():
            file[f"observables/{observable}"] = values


def pieces_in(folder: Path) -> list[Path]:
    """The files of computed pieces."""
    return sorted(path for path in parts_of(folder).glob("*-*.h5"))


def computed(folder: Path, task: Task) -> tuple[np.ndarray, int]:
    """Numbers of the members that are computed already, and how many ensemble.h5 is for. Raises
    RunFileError where a file in the folder is of another ensemble."""
    done: list[np.ndarray] = []
    held = 0
    whole = folder / "ensemble.h5"
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


def check_same(path: Path, file: h5py.File, task: Task) -> None:
    """Raise RunFileError unless a file is of this ensemble."""
    if "members" not in file and "member" not in file:
        raise RunFileError(f"`{path}` must be a file of an ensemble, but is of one run")
    same = {name: plain(file.attrs[name]) == value for name, value in task.identity.items()}
    same["scene"] = file["scene"].asstr()[()] == to_toml(task.scene)
    for name, agrees in same.items():
        if not agrees:
            raise RunFileError(f"`--resume` must go on with the same {name}, but {path} is of another")


# ---- all of it ----------------------------------------------------------------------------------


def gather(folder: Path, task: Task) -> tuple[str, str]:
    """ensemble.h5 from what was there before and the pieces, which then go: its status and message."""
    whole, pieces = folder / "ensemble.h5", pieces_in(folder)
    with Replacing(whole) as file:
        create(file, task)
        sources = ([whole] if whole.exists() else []) + pieces
        for path in sources:
            with h5py.File(path) as source:
                copy_members(file, source)
        status, message = summary(file)
        file.attrs.update({"status": status, "message": message})
    shutil.rmtree(parts_of(folder))
    for left in folder.glob("ensemble.h5.*.part"):  # by a process that was killed while it gathered
        left.unlink()
    return status, message


def create(file: h5py.File, task: Task) -> None:
    """Everything but results: a run file, `member` first."""
    system = system_of(task.scene)
    put_identity(file, task)
    file.attrs.update(versions() | {"schema_version": SCHEMA_VERSION, "device": ""})
    file.attrs.update({"members": task.count, "steps": 0, "wall_time": 0.0, "compile_time": 0.0})
    for key, values in task.inputs.items():
        data = file.create_dataset(f"inputs/{key}", data=values)
        data.attrs["axes"] = ["member", task.scene.members.name][: values.ndim]
    file["time"] = save_times(task.scene.integrator.t_end, task.scene.output.interval)
    file["time"].attrs.update({"unit": "s", "symbol": "t"})
    for entry in listed(system):
        if entry.name in task.observables:
            shape = (task.count, len(file["time"]), *shape_of(entry.axes, task.scene.members.count))
            data = file.create_dataset(f"observables/{entry.name}", shape, float, fillvalue=np.nan)
            data.attrs.update({"unit": entry.unit, "symbol": entry.symbol, "equation": entry.equation})
            data.attrs["axes"] = ["member", "time", *entry.axes]
    file.create_dataset("numerics/steps", (task.count,), float, fillvalue=np.nan)
    file["numerics"].attrs["terms"] = list(system.terms)
    file.create_dataset("members/status", data=[MISSING] * task.count, dtype=TEXT)
    file.create_dataset("members/message", data=[""] * task.count, dtype=TEXT)


def copy_members(file: h5py.File, source: h5py.File) -> None:
    """The members of a piece, or those that an earlier ensemble.h5 has, into the new one."""
    if "member" in source:
        members, steps, messages = (source[name][()] for name in ("member", "steps", "message"))
        status = np.where(source["complete"][()], COMPLETE, FAILED)
        rows = np.arange(len(members))
    else:
        status = source["members/status"].asstr()[()]
        rows = members = np.flatnonzero(status != MISSING)
        status, steps = status[rows], source["numerics/steps"][()][rows]
        messages = source["members/message"][()][rows]
    if not len(members):
        return
    file["members/status"][members] = status.astype(object)
    file["members/message"][members] = messages
    file["numerics/steps"][members] = steps
    for name, data in source["observables"].items():
        for row, member in zip(rows, members, strict=True):
            file["observables"][name][member] = data[row]
    for name in ("compile_time", "wall_time"):
        file.attrs[name] += source.attrs[name]
    file.attrs["steps"] += int(np.nansum(steps))
    file.attrs["device"] = source.attrs["device"]


def summary(file: h5py.File) -> tuple[str, str]:
    """Status and message of an ensemble."""
    status = file["members/status"].asstr()[()]
    failed, missing = (np.flatnonzero(status == name) for name in (FAILED, MISSING))
    said = file["members/message"].asstr()[()]
    warned = np.flatnonzero((status == COMPLETE) & (said != ""))
    parts = [
        f"{len(members)} of {len(status)} members {what} ({some(members)})"
        for members, what in ((missing, "are missing"), (failed, "failed"), (warned, "carry a warning"))
        if len(members)
    ]
    return "interrupted" if len(missing) else "complete", "; ".join(parts)


def some(members: Sequence[int]) -> str:
    """The first numbers of a list, as text."""
    first = ", ".join(str(member) for member in members[:5])
    return first + (", ..." if len(members) > 5 else "")


def load_ensemble(path: str | os.PathLike, observables: Sequence[str] | None = None) -> Ensemble:
    """An ensemble.h5, with all its observables or those named that it has. Raises RunFileError."""
    with open_run(path) as file:
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


class Replacing:
    """An HDF5 file that is written beside its place, and put there when it is whole."""

    def __init__(self, path: Path):
        self.path, self.part = path, path.with_name(f"{path.name}.{os.getpid()}.part")

    def __enter__(self) -> h5py.File:
        self.file = h5py.File(self.part, "w")
        return self.file

    def __exit__(self, kind: Any, *_: object) -> None:
        self.file.close()
        if kind is None:
            os.replace(self.part, self.path)
        else:
            self.part.unlink()
