"""Run files: the results of one run in HDF5, written while the run goes on.

    /time, /observables/NAME, /numerics/NAME (time first), /state/* (enough to resume), /scene

New rows are added to a copy of the file, which then replaces the file (`hdf5.atomic_hdf5`). Large files are
copied less often, which keeps the cost below a few per cent of the run time, however long the run is.
"""

import os
import time
from pathlib import Path
from typing import Any, NamedTuple, cast

import h5py
import jax
import numpy as np

from esail_jax.atomic_file import atomic_file
from esail_jax.calendar.instants import with_scale
from esail_jax.files.hdf5 import (
    LEAST_ROOM,
    ROWS_PER_CHUNK,
    append,
    atomic_hdf5,
    create_observables,
    create_quantity,
    versions,
)
from esail_jax.files.opening import SCHEMA_VERSION, intact, open_single, to_python
from esail_jax.files.reading import scene_in
from esail_jax.files.state import load_checkpoint, load_point, save_checkpoint, save_point
from esail_jax.loads.law_structure import identity_of
from esail_jax.observables import Observable, described
from esail_jax.observables.run_warning import run_warning
from esail_jax.scenes.method_choice import accuracy_of, with_method
from esail_jax.scenes.own_terms import AbsentTerms
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.toml_text import to_toml
from esail_jax.simulation.host import CompiledScene, HostRun
from esail_jax.simulation.law_jumps import jump_warning
from esail_jax.simulation.problem import require_64_bit
from esail_jax.simulation.rectification import AnyPoint
from esail_jax.simulation.results import Checkpoint, Chunk, join
from esail_jax.simulation.simulate import observables_at
from esail_jax.simulation.solution import Solution, Stats
from esail_jax.simulation.stability import Stability
from esail_jax.steppers.results import RESULTS, name_of

CHECKPOINT_SECONDS = 1.0
"""Least time between two writes [s]."""

COPY_SHARE = 0.03
"""Largest part of the run time that copying the file may take."""


def scene_of_run(scene: Scene) -> str:
    """The scene's text with a fixed `t_end`. A run can be resumed if this text is the same."""
    return to_toml(scene.replace({"integrator.t_end": 1.0}))


def names_of_terms(scene: Scene) -> list[str]:
    """module, name and checksum of every term that a user added to a scene, each as one text."""
    if isinstance(scene.terms, AbsentTerms):
        return list(scene.terms.names)
    return [identity_of(term) for term in scene.terms]


class Content(NamedTuple):
    """The description of a run in its file.

    observables: their descriptions; numerics: units of the statistics by name; terms: names of the terms of
    the model; method: name of the stepper; accuracy: its tolerance or step, in words."""

    scene: Scene
    observables: list[Observable]
    numerics: dict[str, str]
    terms: tuple[str, ...]
    method: str
    accuracy: str

    @classmethod
    def of_run(cls, compiled: CompiledScene) -> "Content":
        """The description of a compiled scene."""
        problem = compiled.problem
        return cls(
            compiled.scene,
            [described(name, compiled.scene.chain is not None) for name in compiled.programs.shapes],
            compiled.numerics,
            problem.terms,
            problem.stepper.name,
            accuracy_of(compiled.resolved.integrator),
        )

    @classmethod
    def of_solution(cls, solution: Solution) -> "Content":
        """The description of a solution."""
        stats = solution.stats
        return cls(
            solution.scene,
            [solution.about(name) for name in solution],
            stats["numerics_units"],
            stats["terms"],
            stats["method"],
            accuracy_of(with_method(solution.scene).integrator) if solution.stepper is None else "",
        )


def create(file: h5py.File, content: Content) -> None:
    """Fills a new run file: scene, attributes, and datasets without rows."""
    file["scene"] = to_toml(content.scene)
    attributes = versions() | {
        "schema_version": SCHEMA_VERSION,
        "device": jax.devices()[0].device_kind,
        "method": content.method,
        "accuracy": content.accuracy,
        "status": "running",
        "message": "",
        "result": "successful",
        "steps": 0,
        "rejected_steps": 0,
        "wall_time": 0.0,
        "compile_time": 0.0,
    }
    if content.scene.voltage_law is not None:
        attributes["voltage_law"] = identity_of(content.scene.voltage_law)
    if content.scene.initial.epoch is not None:
        attributes["epoch"] = with_scale(content.scene.initial.epoch)
    if content.scene.terms:
        attributes["own_terms"] = names_of_terms(content.scene)
    file.attrs.update(attributes)
    create_quantity(file, "time", (0,), ["time"], "s", "t", grows=True)
    create_observables(file, content.observables, content.scene.sizes, {"time": 0}, grows=True)
    for name, unit in content.numerics.items():
        create_quantity(file, f"numerics/{name}", (0,), ["time"], unit, name, grows=True)
    file["numerics"].attrs["terms"] = list(content.terms)


class Progress(NamedTuple):
    """The progress of a run.

    checkpoint: where it continues; point: the last saved instant; steps, rejected: numbers of steps; times:
    seconds for compiling and for running; status: "running", "complete", "interrupted" or "failed"; message
    and result: as in a solution; jump: as in `HostRun`."""

    checkpoint: Checkpoint | None
    point: AnyPoint | None
    steps: int
    rejected: int
    times: tuple[float, float]
    status: str = "running"
    message: str = ""
    result: RESULTS = RESULTS.successful
    jump: float | None = None


def progress_of(run: HostRun, times: tuple[float, float], *ended: Any) -> Progress:
    """The progress of a run on the host. ended: status, message and result, if it has ended."""
    counts = run.counts
    progress = Progress(run.checkpoint, run.point, int(counts[0]), int(counts[1]), times, *ended)
    return progress._replace(jump=run.jump)


class RunWriter:
    """Writes the chunks of a run to a run file during the run.

    path: the file; resume: continue an existing file from its checkpoint and drop the rows after it.
    """

    def __init__(self, path: Path, content: Content, resume: bool):
        self.path, self.scene = path, content.scene
        self._pending: list[Chunk] = []
        self._dropped_to: int | None = None
        self._next_write = 0.0
        self._before = (0.0, 0.0)
        if resume:
            with h5py.File(path) as file:
                self._dropped_to = int(file["state"].attrs["rows"])
                self._before = (float(file.attrs["compile_time"]), float(file.attrs["wall_time"]))
        else:
            with atomic_hdf5(path, sealed=True) as file:
                create(file, content)

    def add(self, chunk: Chunk) -> bool:
        """Stores a chunk in memory. Returns whether it is time to write."""
        self._pending.append(chunk)
        return time.perf_counter() >= self._next_write

    def write(self, progress: Progress) -> None:
        """Writes the chunks in memory and the progress."""
        began = time.perf_counter()
        with atomic_hdf5(self.path, update=True, sealed=True, room=self._room(progress)) as file:
            if self._dropped_to is not None:
                for data in rows_of(file):
                    data.resize(self._dropped_to, axis=0)
            if self._pending:
                self._append(file)
            message = progress.message
            if progress.status == "complete":
                rows, numerics = (
                    {name: x[()] for name, x in file[of].items()} for of in ("observables", "numerics")
                )
                said = jump_warning(progress.jump), run_warning(rows, numerics, self.scene)
                message = " ".join(filter(None, said))
            if progress.checkpoint is not None:
                save_checkpoint(file, progress.checkpoint)
            if progress.point is not None:
                save_point(file, progress.point)
            attributes = {
                "status": progress.status,
                "message": message,
                "result": name_of(progress.result),
                "steps": progress.steps,
                "rejected_steps": progress.rejected,
                "compile_time": self._before[0] + progress.times[0],
                "wall_time": self._before[1] + progress.times[1],
            }
            if progress.jump is not None:
                attributes["jump"] = progress.jump
            file.attrs.update(attributes)
            del file["scene"]
            file["scene"] = to_toml(self.scene)
        self._pending, self._dropped_to = [], None
        cost = time.perf_counter() - began
        self._next_write = time.perf_counter() + max(CHECKPOINT_SECONDS, cost / COPY_SHARE)

    def _room(self, progress: Progress) -> int:
        """Number of bytes by which the file may grow: the rows in memory without compression, a last chunk
        of every dataset that is written to a new place, and the state."""
        rows = jax.tree.leaves([(c.time, c.observables, c.numerics) for c in self._pending])
        added = sum(x.nbytes for x in rows)
        count = max(sum(len(chunk.time) for chunk in self._pending), 1)
        state = sum(np.asarray(x).nbytes for x in jax.tree.leaves((progress.checkpoint, progress.point)))
        return LEAST_ROOM + added + ROWS_PER_CHUNK * added // count + state

    def _append(self, file: h5py.File) -> None:
        append(file["time"], np.concatenate([chunk.time for chunk in self._pending]))
        for part in ("observables", "numerics"):
            for name, values in join([getattr(chunk, part) for chunk in self._pending]).items():
                append(file[part][name], values)


def rows_of(file: h5py.File) -> list[h5py.Dataset]:
    """All datasets whose first axis is time."""
    return [file["time"], *file["observables"].values(), *file["numerics"].values()]


def save_stability(path: Path, stability: Stability) -> None:
    """Adds the growth of a small perturbation to a finished run file: the attributes `growth_rate` [1/s]
    and `growth`, and the warning in `message`."""
    with atomic_hdf5(path, update=True, sealed=True) as file:
        message = " ".join(filter(None, (str(file.attrs["message"]), stability.warning)))
        growth = {"growth_rate": stability.growth_rate, "growth": stability.growth}
        file.attrs.update(growth | {"message": message})


def save(solution: Solution, path: str | os.PathLike, overwrite: bool = False) -> None:
    """Writes a solution to a run file.

    Raises FileExistsError unless `overwrite`, TypeError for anything but a solution, such as an ensemble,
    and ValueError for a solution made under a trace.
    """
    path = Path(path)
    if not isinstance(solution, Solution):
        raise TypeError(f"`solution` must be a Solution, but is of type {type(solution).__name__}")
    if solution.scene is None:
        raise ValueError("`solution` must come from a run on concrete numbers, but was traced")
    if path.exists() and not overwrite:
        raise FileExistsError(f"`{path}` must not exist (or pass overwrite=True), but does")
    stats = solution.stats
    reached = float(solution.time[-1])
    status = "complete" if solution.result == RESULTS.successful else "failed"
    times = (stats["compile_time"], stats["wall_time"])
    steps = (int(stats["steps"]), int(stats["rejected_steps"]))
    progress = Progress(
        solution.checkpoint, solution.final_state, *steps, times, status, stats["message"], solution.result
    )
    with atomic_file(path) as temporary:
        writer = RunWriter(temporary, Content.of_solution(solution), resume=False)
        rows = {name: np.asarray(x) for name, x in solution.observables.items()}
        writer.add(Chunk(np.asarray(solution.time), rows, solution.numerics, reached))
        writer.write(progress._replace(jump=stats.get("jump")))
        if "stability" in stats:
            save_stability(temporary, stats["stability"])


def load(path: str | os.PathLike) -> Solution:
    """Reads a run file as a solution. Its `final_state` is the last saved instant, its `stepper` None.

    Raises RunFileError if the file is not that of one run, and RuntimeError in 32-bit mode.
    """
    require_64_bit()
    with open_single(path) as file, intact(path):
        scene = scene_in(file, Path(path))
        rows = {name: data[()] for name, data in file["observables"].items()}
        numerics = {name: data[()] for name, data in file["numerics"].items()}
        stats: dict[str, Any] = {name: to_python(value) for name, value in file.attrs.items()}
        stats["terms"] = tuple(file["numerics"].attrs["terms"])
        stats["numerics_units"] = {name: data.attrs["unit"] for name, data in file["numerics"].items()}
        checkpoint = load_checkpoint(file) if "state" in file else None
        point, times = load_point(file), file["time"][()]
    result = getattr(RESULTS, stats["result"])
    return Solution(
        time=times,
        observables=rows,
        result=result,
        final_state=point,
        stats=cast(Stats, stats),
        numerics=numerics,
        checkpoint=checkpoint,
        scene=scene,
        again=observables_at,
        source="file",
    )
