"""Run files: HDF5, written while the run goes on.

    /time, /observables/NAME, /numerics/NAME (time first), /state/* (enough to resume), /scene

A file is never written in place: a copy gets the new rows and is renamed over the old one, so that
whatever kills the writer leaves a complete, closed file. Copies are rationed in time, which keeps
their cost below a few per cent whatever the length of the run.
"""

import os
import platform
import shutil
import time
from importlib import metadata
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import h5py
import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.observables import listed, shape_of
from esail_jax.observables.run_warning import run_warning
from esail_jax.scenes.scene import Scene, parse, to_toml
from esail_jax.simulation.march import numerics_of
from esail_jax.simulation.prepare import Prepared, empty_carry, prepare, require_64_bit
from esail_jax.simulation.results import RESULTS, Checkpoint, Piece, join, result_of
from esail_jax.simulation.simulate import Solution, final_state

SCHEMA_VERSION = 1

CHECKPOINT_SECONDS = 1.0
"""Least time between two writes."""

COPY_SHARE = 0.03
"""Most part of the run time that copying may take: large files are written less often."""


@runtime_checkable
class Progressed(Protocol):
    """A march or a solution: how many steps are done, and where to go on from."""

    steps: int
    checkpoint: Checkpoint


class RunFileError(ValueError):
    """A run file that cannot be used as asked."""


def versions() -> dict[str, str]:
    """Versions of what computed a run."""
    packages = ("esail_jax", "jax", "jaxlib", "numpy", "h5py")
    found = {}
    for name in packages:
        try:
            found[f"version_{name}"] = metadata.version(name)
        except metadata.PackageNotFoundError:  # run from a source tree that is not installed
            found[f"version_{name}"] = "not installed"
    return found | {"version_python": platform.python_version()}


def scene_of_run(scene: Scene) -> str:
    """The scene's text without `t_end`: what must agree for a run to be resumed."""
    return to_toml(scene.replace({"integrator.t_end": 1.0}))


def create(path: Path, prepared: Prepared) -> None:
    """An empty run file: everything but rows. Replaces nothing: the caller has looked."""
    with h5py.File(path, "w") as file:
        file["scene"] = to_toml(prepared.scene)
        attributes = versions() | {
            "schema_version": SCHEMA_VERSION,
            "device": jax.devices()[0].device_kind,
            "status": "running",
            "message": "",
            "steps": 0,
            "wall_time": 0.0,
            "compile_time": 0.0,
        }
        file.attrs.update(attributes)
        growing(file, "time", (), "s", "t", (), "")
        for entry in listed(prepared.problem.system):
            shape = shape_of(entry.axes, prepared.scene.members.count)
            name = f"observables/{entry.name}"
            growing(file, name, shape, entry.unit, entry.symbol, entry.axes, entry.equation)
        for name, unit in numerics_of(prepared).items():
            growing(file, f"numerics/{name}", (), unit, name, (), "")
        file["numerics"].attrs["terms"] = list(prepared.problem.terms)


def growing(
    file: h5py.File,
    name: str,
    shape: tuple[int, ...],
    unit: str,
    symbol: str,
    axes: tuple[str, ...],
    equation: str,
) -> None:
    """A dataset that grows along its first axis, time."""
    data = file.create_dataset(name, (0, *shape), dtype=float, maxshape=(None, *shape), chunks=(64, *shape))
    data.attrs.update({"unit": unit, "symbol": symbol, "equation": equation})
    data.attrs["axes"] = ["time", *axes]


class RunWriter:
    """Appends pieces to a run file.

    path: the file; `resume` continues an existing file from its checkpoint, dropping rows beyond it.
    """

    def __init__(self, path: Path, prepared: Prepared, resume: bool):
        self.path, self.part = path, path.with_name(path.name + ".part")
        self.prepared = prepared
        self._pending: list[Piece] = []
        self._dropped_to: int | None = None
        self._next_write = 0.0
        self._before = (0.0, 0.0)
        if resume:
            with h5py.File(path) as file:
                self._dropped_to = int(file["state"].attrs["rows"])
                self._before = (float(file.attrs["wall_time"]), float(file.attrs["compile_time"]))
        else:
            create(self.part, prepared)
            os.replace(self.part, path)

    def add(self, piece: Piece, progress: Progressed, times: tuple[float, float]) -> None:
        """Keep a piece; write when it is time to."""
        self._pending.append(piece)
        if time.perf_counter() >= self._next_write:
            self.write(progress, times)

    def write(
        self,
        progress: Progressed,
        times: tuple[float, float],
        status: str = "running",
        message: str = "",
    ) -> None:
        """Write what is pending. progress: a march or a solution; times: compiling and running
        [s] of this process."""
        began = time.perf_counter()
        shutil.copyfile(self.path, self.part)
        with h5py.File(self.part, "r+") as file:
            if self._dropped_to is not None:
                for data in rows_of(file):
                    data.resize(self._dropped_to, axis=0)
            if self._pending:
                self._append(file)
            if status == "complete":
                seen = ({name: x[()] for name, x in file[of].items()} for of in ("observables", "numerics"))
                message = run_warning(*seen)
            save_checkpoint(file, progress.checkpoint)
            if self.prepared.plan is not None:
                file["state"].attrs["steps_per_entry"] = self.prepared.plan.steps_per_entry
            file.attrs.update({"status": status, "message": message, "steps": progress.steps})
            file.attrs["compile_time"] = self._before[1] + times[0]
            file.attrs["wall_time"] = self._before[0] + times[1]
            del file["scene"]
            file["scene"] = to_toml(self.prepared.scene)
        with open(self.part, "rb") as file:
            os.fsync(file.fileno())
        os.replace(self.part, self.path)
        self._pending, self._dropped_to = [], None
        cost = time.perf_counter() - began
        self._next_write = time.perf_counter() + max(CHECKPOINT_SECONDS, cost / COPY_SHARE)

    def _append(self, file: h5py.File) -> None:
        append(file["time"], np.concatenate([piece.time for piece in self._pending]))
        for name, values in join([piece.rows for piece in self._pending]).items():
            append(file["observables"][name], values)
        for name, values in join([piece.numerics for piece in self._pending]).items():
            append(file["numerics"][name], values)


def append(data: h5py.Dataset, values: np.ndarray) -> None:
    """Rows at the end of a growing dataset."""
    before = data.shape[0]
    data.resize(before + len(values), axis=0)
    data[before:] = values


def rows_of(file: h5py.File) -> list[h5py.Dataset]:
    """Every dataset with time as first axis."""
    return [file["time"], *file["observables"].values(), *file["numerics"].values()]


def save_checkpoint(file: h5py.File, checkpoint: Checkpoint) -> None:
    """/state: the leaves of the carry under their path."""
    if "state" in file:
        del file["state"]
    group = file.create_group("state")
    for path, leaf in jax.tree_util.tree_leaves_with_path(checkpoint.carry):
        group["/".join(str(getattr(key, "name", key)) for key in path)] = np.asarray(leaf)
    group["tally"] = np.array(checkpoint.tally)
    group["energy"] = np.array(checkpoint.energy)
    group.attrs.update(
        {"position": checkpoint.position, "rows": checkpoint.rows, "steps": checkpoint.steps}
    )


def load_checkpoint(file: h5py.File, like: Any) -> Checkpoint:
    """The checkpoint of a run file, in the layout of the scene's carry (arrays or their shapes): zeros for
    what an older version did not keep."""
    group = file["state"]
    leaves, structure = jax.tree_util.tree_flatten_with_path(like)
    names = ("/".join(str(getattr(key, "name", key)) for key in path) for path, _ in leaves)
    values = [
        jnp.asarray(group[name][()]) if name in group else jnp.zeros(leaf.shape, leaf.dtype)
        for name, (_, leaf) in zip(names, leaves, strict=True)
    ]
    carry = jax.tree_util.tree_unflatten(structure, values)
    counts = (int(group.attrs[name]) for name in ("position", "rows", "steps"))
    energy = tuple(group["energy"][()]) if "energy" in group else Checkpoint._field_defaults["energy"]
    return Checkpoint(carry, *counts, tuple(group["tally"][()]), energy)


def holds_ensemble(path: str | os.PathLike) -> bool:
    """Is a run file one of many runs? Raises RunFileError if it is none at all."""
    with open_run(path) as file:
        return "members" in file


def open_single(path: str | os.PathLike) -> h5py.File:
    """A file of one run for reading. Raises RunFileError in one line."""
    file = open_run(path)
    if "members" in file:
        file.close()
        raise RunFileError(f"`{path}` must be a file of one run, but is of an ensemble")
    return file


def open_run(path: str | os.PathLike) -> h5py.File:
    """A run file for reading. Raises RunFileError in one line."""
    try:
        file = h5py.File(path)
    except OSError as error:
        reason = "does not exist" if not os.path.exists(path) else "cannot be read as HDF5"
        raise RunFileError(f"`{path}` must be a run file, but {reason}") from error
    if "schema_version" not in file.attrs or "scene" not in file:
        file.close()
        raise RunFileError(f"`{path}` must be a run file, but has no scene")
    if file.attrs["schema_version"] > SCHEMA_VERSION:
        found = file.attrs["schema_version"]
        file.close()
        raise RunFileError(f"`{path}` must have schema version {SCHEMA_VERSION} or lower, but has {found}")
    return file


def save(solution: Solution, path: str | os.PathLike, overwrite: bool = False) -> None:
    """Write a solution as a run file.

    Raises FileExistsError unless `overwrite`, and ValueError for a solution made under a trace.
    """
    path = Path(path)
    if solution.scene is None:
        raise ValueError("`solution` must come from a run on concrete numbers, but was traced")
    if path.exists() and not overwrite:
        raise FileExistsError(f"`{path}` must not exist (or pass overwrite=True), but does")
    prepared = prepare(solution.scene)
    temporary = path.with_name(path.name + ".new")
    writer = RunWriter(temporary, prepared, resume=False)
    reached = float(solution.time[-1])
    writer._pending.append(Piece(solution.rows, solution.time, solution.numerics, reached))
    stats = solution.stats
    times = (stats["compile_time"], stats["wall_time"])
    status = "complete" if solution.result == RESULTS.successful else "failed"
    writer.write(solution, times, status, stats["message"])
    os.replace(temporary, path)


def load(path: str | os.PathLike) -> Solution:
    """A run file as a solution; its `final_state` is the one a longer run would go on from.

    Raises RunFileError, and RuntimeError in 32-bit mode.
    """
    require_64_bit()
    with open_single(path) as file:
        scene = parse(file["scene"][()].decode(), str(path))
        rows = {name: data[()] for name, data in file["observables"].items()}
        numerics = {name: data[()] for name, data in file["numerics"].items()}
        stats: dict[str, Any] = {name: plain(value) for name, value in file.attrs.items()}
        stats["terms"] = tuple(file["numerics"].attrs["terms"])
        checkpoint = load_checkpoint(file, empty_carry(scene)) if "state" in file else None
        times = file["time"][()]
    result = RESULTS.successful if stats["status"] != "failed" else result_of(stats["message"])
    state = final_state(checkpoint.carry) if checkpoint else None
    return Solution(times, rows, result, state, stats, numerics, checkpoint, scene)


def plain(value: Any) -> Any:
    """An HDF5 attribute as a Python value."""
    return value.item() if hasattr(value, "item") else value
