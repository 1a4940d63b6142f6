"""Saved rows of a run, or of the members of an ensemble, read alike from files and from memory. Files are
read without JAX."""

import contextlib
import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from esail_jax.calendar.instants import with_scale
from esail_jax.files.opening import ArgumentError, RunFileError, files_of, intact, open_run
from esail_jax.scenes.loading import parse
from esail_jax.scenes.own_terms import OWN_TERMS, AbsentTerms
from esail_jax.scenes.scene import Scene

MISSING = "missing"
"""Status of a member of an ensemble that is not computed yet."""

IN_MEMORY = Path("run")
"""Name of a run or an ensemble in memory, in messages and titles."""


class About(NamedTuple):
    """Unit and symbol of an observable, and the names of its axes after that of time."""

    unit: str
    symbol: str
    axes: tuple[str, ...]


class Members(NamedTuple):
    """The members of an ensemble. inputs: by scene key, member first; computed: whether a member has rows
    (member)."""

    inputs: Mapping[str, np.ndarray]
    computed: np.ndarray

    @property
    def count(self) -> int:
        """Number of members."""
        return len(self.computed)


class Results(NamedTuple):
    """What a run or an ensemble has saved.

    path: its file, or a name for one in memory; time: [s], (time); observables: by name, arrays or datasets
    of an open file, (time, ...) of a run and (member, time, ...) of an ensemble, NaN after a failure; of an
    ensemble without histories the numbers that stand for them, at the last instant; members: None for a
    run."""

    path: Path
    scene: Scene
    time: np.ndarray
    observables: Mapping[str, Any]
    about: Mapping[str, About]
    members: Members | None

    @property
    def epoch(self) -> str:
        """The date of t = 0 with its time scale. Raises RunFileError if there is none."""
        if self.scene.initial.epoch is None:
            got = "has none"
            raise RunFileError(f"`{self.path}` must have an epoch (`initial.epoch`) for dates, but {got}")
        return with_scale(self.scene.initial.epoch)

    def one_run(self) -> "Results":
        """The results themselves. Raises RunFileError for those of an ensemble."""
        if self.members is not None:
            raise RunFileError(f"`{self.path}` must be a file of one run, but is of an ensemble")
        return self


@contextlib.contextmanager
def open_results(run: Any) -> Iterator[Results]:
    """Context manager: the results of a file of a run or an ensemble, given by its path, or of a solution
    or an ensemble in memory. Raises RunFileError for a file that cannot be read and ArgumentError for
    anything else."""
    if not isinstance(run, str | os.PathLike):
        yield in_memory(run)
        return
    path = file_of(run)
    with open_run(path) as file, intact(path):
        yield in_file(file, path)


def file_of(path: str | os.PathLike) -> Path:
    """The file that a path stands for: that of an ensemble for its folder. Raises RunFileError for the
    folder of a design, which holds two runs, and for other folders."""
    files = files_of([Path(path)])
    if len(files) > 1:
        names = " and ".join(file.name for file in files)
        raise RunFileError(f"`{path}` must be one run, but is a design with {names}: give one of them")
    return files[0]


def in_file(file: h5py.File, path: Path) -> Results:
    """The results of an open file."""
    members, first = None, 1
    if "members" in file:
        inputs = {key: data[()] for key, data in file.get("inputs", {}).items()}
        members, first = Members(inputs, file["members/status"].asstr()[()] != MISSING), 2
    group, time = file["observables"], file["time"][()]
    observables = dict(group.items())
    if "reduced" in file:
        group, first = file["reduced"], 1
        observables, time = at_the_end({name: data[()] for name, data in group.items()}), time[-1:]
    about = {
        name: About(data.attrs["unit"], data.attrs["symbol"], tuple(data.attrs["axes"])[first:])
        for name, data in group.items()
    }
    return Results(path, scene_in(file, path), time, observables, about, members)


def at_the_end(reduced: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Numbers that stand for histories, as rows of one instant: the end of the history."""
    return {name: np.asarray(values)[:, None] for name, values in reduced.items()}


def in_memory(run: Any) -> Results:
    """The results of a solution or an ensemble. Raises ArgumentError for anything else, and for a solution
    that was computed under a trace."""
    from esail_jax.ensembles.ensemble import Ensemble
    from esail_jax.observables import described
    from esail_jax.simulation.solution import Solution

    if not isinstance(run, Solution | Ensemble):
        kinds = "be a solution, an ensemble or the path of a file"
        raise ArgumentError("run", kinds, f"is of type {type(run).__name__}")
    if run.scene is None:
        raise ArgumentError("run", "come from a run on concrete numbers", "was traced")
    of_chain = run.scene.chain is not None
    entries = {name: described(name.partition(".")[0], of_chain) for name in run.keys()}
    about = {name: About(entry.unit, entry.symbol, tuple(entry.axes)) for name, entry in entries.items()}
    observables = {name: np.asarray(run[name]) for name in entries}
    members, time = None, np.asarray(run.time)
    if isinstance(run, Ensemble):
        if run.reduced:
            observables, time = at_the_end(run.reduced), time[-1:]
        inputs = {key: np.asarray(values) for key, values in run.inputs.items()}
        members = Members(inputs, np.isfinite(run.steps))
    return Results(IN_MEMORY, run.scene, time, observables, about, members)


def scene_in(file: h5py.File, path: Path) -> Scene:
    """The scene of a file. Terms that a user wrote are not in it: the scene knows their names, and
    is no scene to run without them."""
    names = tuple(file.attrs.get("own_terms", ()))
    absent = {OWN_TERMS: AbsentTerms(names)} if names else None
    return parse(file["scene"].asstr()[()], str(path), absent)


# ---- the rows of one run ------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class SavedRun:
    """The saved rows of a run.

    path, member: what is read, with None for the member of one run; time: [s], (time); rows: observables by
    name, time first. Rows after a failure are left out."""

    path: Path
    member: int | None
    scene: Scene
    time: np.ndarray
    rows: Mapping[str, np.ndarray]
    about: Mapping[str, About]

    @property
    def name(self) -> str:
        """What is read, for titles: the name of the file, with that of its folder for an ensemble."""
        if self.member is None:
            return self.path.name
        return f"{self.path.parent.name}/{self.path.name}, member {self.member}".lstrip("/")

    def need(self, *names: str) -> None:
        """Raises RunFileError unless the file holds these observables."""
        for name in names:
            if name not in self.rows:
                raise RunFileError(f"`{self.path}` must hold the observable {name}, but lacks it")


def read_runs(run: Any, members: Sequence[int]) -> list[SavedRun]:
    """The run of a file or a solution, or the members of an ensemble with these numbers.

    Raises RunFileError for what cannot be read or has no rows, and for members that it lacks."""
    with open_results(run) as results:
        if results.members is None:
            if len(members):
                raise ArgumentError("member", "be left out with a file of one run", f"is {members[0]}")
            return [read_rows(results, None)]
        count = results.members.count
        if not len(members):
            raise ArgumentError("member", f"be given with an ensemble (0 to {count - 1})", "is not")
        for member in members:
            if not 0 <= member < count:
                raise ArgumentError("member", f"be between 0 and {count - 1}", f"is {member}")
        return [read_rows(results, member) for member in members]


def read_rows(results: Results, member: int | None) -> SavedRun:
    """A run, or a member of an ensemble. Raises RunFileError if it has no rows."""
    place = () if member is None else member
    rows = {name: values[place] for name, values in results.observables.items()}
    known = known_rows(rows, len(results.time))
    if not known:
        of = "" if member is None else f" of member {member}"
        raise RunFileError(f"`{results.path}` must hold saved instants{of}, but has none")
    leading = {name: values[:known] for name, values in rows.items()}
    return SavedRun(results.path, member, results.scene, results.time[:known], leading, results.about)


def known_rows(rows: Mapping[str, np.ndarray], count: int) -> int:
    """The number of leading instants at which the kinetic energy, or else any observable, is
    finite."""
    signals = [rows["kinetic_energy"]] if "kinetic_energy" in rows else list(rows.values())
    known = np.zeros(count, bool)
    for signal in signals:
        known |= np.isfinite(signal).reshape(count, -1).any(1)
    return count if known.all() else int(np.argmin(known))
