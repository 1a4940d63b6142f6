"""Run files: the results of one run in HDF5, written while the run goes on.

    /time, /observables/NAME, /numerics/NAME (time first), /state/* (enough to resume), /scene

New rows are added to a copy of the file, which then replaces the file (`hdf5.atomic_hdf5`). Large files are
copied less often, which keeps the cost below a few per cent of the run time, however long the run is.
"""

import os
import time
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import h5py
import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.files.hdf5 import (
    append,
    atomic_file,
    atomic_hdf5,
    create_observables,
    create_quantity,
    to_python,
    versions,
)
from esail_jax.observables import listed
from esail_jax.observables.run_warning import run_warning
from esail_jax.scenes.scene import Scene, parse, to_toml
from esail_jax.simulation.march import numerics_of
from esail_jax.simulation.prepare import Prepared, empty_carry, prepare, require_64_bit
from esail_jax.simulation.results import RESULTS, Checkpoint, Piece, join, result_of
from esail_jax.simulation.simulate import Solution, final_state

SCHEMA_VERSION = 1

CHECKPOINT_SECONDS = 1.0
"""Least time between two writes [s]."""

COPY_SHARE = 0.03
"""Largest part of the run time that copying the file may take."""


@runtime_checkable
class Progressed(Protocol):
    """A run in progress or a solution: number of steps taken, and the checkpoint to continue from."""

    steps: int
    checkpoint: Checkpoint


class RunFileError(ValueError):
    """A run file that cannot be used as asked."""


def scene_of_run(scene: Scene) -> str:
    """The scene's text without `t_end`. It must be the same for a run to be resumed."""
    return to_toml(scene.replace({"integrator.t_end": 1.0}))


def create(file: h5py.File, prepared: Prepared) -> None:
    """Fills a new run file with everything but rows: scene, attributes, empty datasets."""
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
    create_quantity(file, "time", (0,), ["time"], "s", "t", grows=True)
    members = prepared.scene.members.count
    create_observables(file, listed(prepared.problem.system), members, {"time": 0}, grows=True)
    for name, unit in numerics_of(prepared).items():
        create_quantity(file, f"numerics/{name}", (0,), ["time"], unit, name, grows=True)
    file["numerics"].attrs["terms"] = list(prepared.problem.terms)


class RunWriter:
    """Writes the pieces of a run to a run file while the run goes on.

    path: the file; resume: continue an existing file from its checkpoint and drop the rows after it.
    """

    def __init__(self, path: Path, prepared: Prepared, resume: bool):
        self.path, self.prepared = path, prepared
        self._pending: list[Piece] = []
        self._dropped_to: int | None = None
        self._next_write = 0.0
        self._before = (0.0, 0.0)
        if resume:
            with h5py.File(path) as file:
                self._dropped_to = int(file["state"].attrs["rows"])
                self._before = (float(file.attrs["wall_time"]), float(file.attrs["compile_time"]))
        else:
            with atomic_hdf5(path) as file:
                create(file, prepared)

    def add(self, piece: Piece, progress: Progressed, times: tuple[float, float]) -> None:
        """Keeps a piece in memory, and writes all of them once the last write is long enough ago."""
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
        """Writes the pieces kept in memory. progress: a run in progress or a solution; times: seconds that
        this process has spent on compiling and on running."""
        began = time.perf_counter()
        with atomic_hdf5(self.path, update=True) as file:
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
        self._pending, self._dropped_to = [], None
        cost = time.perf_counter() - began
        self._next_write = time.perf_counter() + max(CHECKPOINT_SECONDS, cost / COPY_SHARE)

    def _append(self, file: h5py.File) -> None:
        append(file["time"], np.concatenate([piece.time for piece in self._pending]))
        for name, values in join([piece.rows for piece in self._pending]).items():
            append(file["observables"][name], values)
        for name, values in join([piece.numerics for piece in self._pending]).items():
            append(file["numerics"][name], values)


def rows_of(file: h5py.File) -> list[h5py.Dataset]:
    """All datasets whose first axis is time."""
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
    """True if a file holds an ensemble, false if one run. Raises RunFileError if it is no run file."""
    with open_run(path) as file:
        return "members" in file


def open_single(path: str | os.PathLike) -> h5py.File:
    """Opens the file of one run for reading. Raises RunFileError, with one line."""
    file = open_run(path)
    if "members" in file:
        file.close()
        raise RunFileError(f"`{path}` must be a file of one run, but is of an ensemble")
    return file


def open_run(path: str | os.PathLike) -> h5py.File:
    """Opens the file of a run or an ensemble for reading. Raises RunFileError, with one line."""
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
    """Writes a solution to a run file.

    Raises FileExistsError unless `overwrite`, and ValueError for a solution made under a trace.
    """
    path = Path(path)
    if solution.scene is None:
        raise ValueError("`solution` must come from a run on concrete numbers, but was traced")
    if path.exists() and not overwrite:
        raise FileExistsError(f"`{path}` must not exist (or pass overwrite=True), but does")
    prepared = prepare(solution.scene)
    reached, stats = float(solution.time[-1]), solution.stats
    times = (stats["compile_time"], stats["wall_time"])
    status = "complete" if solution.result == RESULTS.successful else "failed"
    with atomic_file(path) as temporary:
        writer = RunWriter(temporary, prepared, resume=False)
        writer._pending.append(Piece(solution.rows, solution.time, solution.numerics, reached))
        writer.write(solution, times, status, stats["message"])


def load(path: str | os.PathLike) -> Solution:
    """Reads a run file as a solution; `final_state` is the state that a longer run continues from.

    Raises RunFileError, and RuntimeError in 32-bit mode.
    """
    require_64_bit()
    with open_single(path) as file:
        scene = parse(file["scene"][()].decode(), str(path))
        rows = {name: data[()] for name, data in file["observables"].items()}
        numerics = {name: data[()] for name, data in file["numerics"].items()}
        stats: dict[str, Any] = {name: to_python(value) for name, value in file.attrs.items()}
        stats["terms"] = tuple(file["numerics"].attrs["terms"])
        checkpoint = load_checkpoint(file, empty_carry(scene)) if "state" in file else None
        times = file["time"][()]
    result = RESULTS.successful if stats["status"] != "failed" else result_of(stats["message"])
    state = final_state(checkpoint.carry) if checkpoint else None
    return Solution(times, rows, result, state, stats, numerics, checkpoint, scene)
