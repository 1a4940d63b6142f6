"""The result of a run: a mapping from names of observables to arrays."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal, TypedDict

import equinox as eqx
import jax
import numpy as np

from esail_jax.array_types import Array, Float, Maybe
from esail_jax.calendar.instants import dated, without_leap_seconds, written
from esail_jax.html import html_table
from esail_jax.observables import described, hint_at, known_names
from esail_jax.observables.entry import Observable
from esail_jax.scenes.scene import Scene
from esail_jax.simulation.rectification import AnyPoint
from esail_jax.simulation.results import Checkpoint
from esail_jax.steppers.results import RESULTS
from esail_jax.steppers.stepper import AbstractStepper


class Stats(TypedDict, total=False):
    """What a run says of itself, by name.

    Every run has steps and rejected_steps, their numbers. A run on the host has compile_time and wall_time
    [s]; terms: the names of what was built; numerics_units: the unit of each statistic of the steps;
    method; and message, which is empty unless something is to be said; jump: the largest jump of what a
    law of a user commands, over its largest value; stability: with `simulate(stability=True)`. Under a
    trace there are jumped: whether such a law has jumped; and step_errors: the estimates on which warnings
    rest. A run from a file also has the attributes of that file, such as schema_version and the versions
    of libraries."""

    steps: Any
    rejected_steps: Any
    compile_time: float
    wall_time: float
    terms: tuple[str, ...]
    numerics_units: dict[str, str]
    method: str
    message: str
    jump: float
    stability: Any
    jumped: Any
    step_errors: Any


Source = Literal["run", "trace", "file"]
"""Where a solution comes from: a run on the host, a run under a trace, or a run file."""


class Solution(eqx.Module, Mapping):
    """The result of a run: a mapping from names of observables to arrays with time as first axis.

        solution = esail.simulate("baseline")
        solution["coning_angle"]             # (time, tether) [rad]
        list(solution), len(solution)        # names, number of observables
        solution.units()["coning_angle"]     # "rad"
        solution.at(12.3)["coning_angle"]    # between two saved instants

    time: saved instants [s]; observables: the mapping itself; result: a member of `RESULTS`; final_state:
    the point at the last saved instant, for `simulate(scene, start=...)`. A failed run may have a later
    point, at an instant where something was switched, or None if it has no instant; stats: what the run
    says of itself (`Stats`), such as `steps`, `wall_time` and `message`, which is empty unless the run
    failed, its energy balance has a large error, or its step is too long; numerics: statistics of the steps
    by name, with the axis `time`; checkpoint: the state from which a longer run continues (None if `times`,
    `save`, `start` or `stepper` was given); save, start and stepper: these arguments of `simulate`; again:
    the function behind `at`; source: where it comes from.

    After a failure with `throw=False` the arrays are NaN from the failure on. Under a trace `numerics`,
    `checkpoint`, `again` and `scene` are None, and `stats` has the numbers of steps only. Two solutions
    are equal only if they are the same object."""

    time: Float[Array, " time"] | Float[np.ndarray, " time"]
    observables: Mapping[str, Array | np.ndarray]
    result: RESULTS
    final_state: AnyPoint | None
    stats: Stats
    numerics: Maybe[dict[str, np.ndarray]] = None
    checkpoint: Checkpoint | None = None
    scene: Maybe[Scene] = eqx.field(static=True, default=None)
    save: tuple[str, ...] | None = eqx.field(static=True, default=None)
    start: AnyPoint | None = None
    stepper: AbstractStepper | None = None
    again: Callable[["Solution", Any], dict[str, np.ndarray]] | None = eqx.field(static=True, default=None)
    source: Source = eqx.field(static=True, default="run")

    def __getitem__(self, name: str) -> Array | np.ndarray:
        if name not in self.observables:
            of_chain = self.scene is not None and self.scene.chain is not None
            hint = hint_at(name, self.observables, of_chain)
            if self.save is not None and name in known_names(of_chain):
                hint = " (it is not among those of `save`)"
            raise KeyError(f"{name!r} is no observable of this run{hint}")
        return self.observables[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.observables)

    def __len__(self) -> int:
        return len(self.observables)

    def __contains__(self, name: object) -> bool:
        return name in self.observables

    def __hash__(self) -> int:
        return id(self)

    def __eq__(self, other: object) -> bool:
        return self is other

    @property
    def steps(self) -> Any:
        """Number of steps taken: a Python integer, or a tracer under a trace."""
        steps = self.stats["steps"]
        return steps if isinstance(steps, jax.core.Tracer) else int(steps)

    def about(self, name: str) -> Observable:
        """The description of an observable: `unit`, `symbol`, `axes` (after time), `equation` and
        `meaning`.

        Raises KeyError for an unknown name, with the nearest one."""
        return described(name, None if self.scene is None else self.scene.chain is not None)

    def units(self) -> dict[str, str]:
        """The unit of every observable by name."""
        return {name: self.about(name).unit for name in self}

    def at(self, time: float | Sequence[float]) -> dict[str, np.ndarray]:
        """Runs the scene again up to the last of these times [s], and gives the observables there: without
        the axis `time` for a number, and with it for a list, in the order of the list.

        The second run takes the same steps as the first, with the programs that are compiled already, and
        the times between saved instants are those of its dense output. It costs what the run did. Raises
        ValueError for a time outside the run, a run made under a trace, and a run from a file that does not
        hold all of its arguments."""
        if self.again is None:
            raise ValueError("`solution` must come from a run on concrete numbers, but was traced")
        return self.again(self, time)

    def dates(self, digits: int = 3) -> list[str]:
        """The dates of the saved instants in the form of ISO 8601, in the time scale of the epoch, UTC or
        TDB, with decimals of the second. Raises ValueError for a run without an epoch, and under a
        trace."""
        if self.scene is None or isinstance(self.time, jax.core.Tracer):
            raise ValueError("`solution` must come from a run on concrete numbers, but was traced")
        if self.scene.initial.epoch is None:
            raise ValueError("`initial.epoch` must be given for a run with dates, but is missing")
        return dated(self.scene.initial.epoch, np.asarray(self.time), digits)

    def to_xarray(self) -> Any:
        """The run as an `xarray.Dataset` with units, symbols, equations and named axes.

        Raises ImportError if xarray is not installed."""
        import xarray

        data = {name: labelled(self.about(name), np.asarray(self[name]), ("time",)) for name in self}
        time = ("time", np.asarray(self.time), time_attributes(self.scene))
        return xarray.Dataset(
            data, coords={"time": time}, attrs={"message": str(self.stats.get("message", ""))}
        )

    def __repr__(self) -> str:
        if self.scene is None or isinstance(self.time, jax.core.Tracer):
            return f"Solution({len(self)} observables at {len(self.time)} instants, under a trace)"
        stats = self.stats
        outcome = RESULTS[self.result] if not stats["message"] else stats["message"]
        return (
            f"Solution: {len(self)} observables at {len(self.time)} instants "
            f"from {self.time[0]:g} to {self.time[-1]:g} s\n"
            f"  {stats.get('method', '')}: {self.steps} steps in {stats['wall_time']:.2f} s, "
            f"compiling {stats['compile_time']:.2f} s\n"
            f"  {outcome}"
        )

    def _repr_html_(self) -> str:
        """The run as a table of its observables, which a notebook shows."""
        if self.scene is None or isinstance(self.time, jax.core.Tracer):
            return html_table(repr(self), ("observable", "unit"), self.units().items())
        rows = []
        for name in self:
            entry, values = self.about(name), np.asarray(self[name])
            finite = values[np.isfinite(values)]
            ends = (f"{finite.min():.6g}", f"{finite.max():.6g}") if finite.size else ("", "")
            rows.append((name, entry.unit, ", ".join(("time", *entry.axes)), *ends, entry.meaning))
        heads = ("observable", "unit", "axes", "smallest", "largest", "meaning")
        return html_table(repr(self), heads, rows)


def time_attributes(scene: Scene | None) -> dict[str, str]:
    """The attributes of the axis `time` of a dataset. With an epoch they are those of the CF conventions,
    by which programs show dates; their calendar has no leap seconds."""
    epoch = None if scene is None else scene.initial.epoch
    if epoch is None:
        return {"units": "s"}
    start = without_leap_seconds(epoch)
    units = f"seconds since {written(start, 6)[0].replace('T', ' ')}"
    return {"standard_name": "time", "units": units, "calendar": "standard", "time_scale": start.scale}


def labelled(
    entry: Observable, values: np.ndarray, leading: tuple[str, ...]
) -> tuple[list[str], np.ndarray, dict[str, str]]:
    """Names of all axes, values and attributes of an observable, as `xarray.Dataset` takes them. leading:
    the axes before those of the observable."""
    axes = [*leading, *(f"{entry.name}_{axis}" if axis in OWN_AXES else axis for axis in entry.axes)]
    return axes, values, {"units": entry.unit, "symbol": entry.symbol, "equation": entry.equation}


OWN_AXES = ("angle", "row", "col")
"""Axes whose entries have another meaning in every observable: in xarray their names contain the
observable."""
