"""What a run predicts for the cells of the data, and its derivative by the parameters.

    r(p) = (h(p) - y) / s,    J = dh/dp / s

with the measurements y, their standard deviations s, and what instruments show, h. A run is traced once for
a set of measurements; the derivatives by all parameters are one batch of forward mode.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float
from esail_jax.compilation.jit import jit
from esail_jax.ensembles.member_program import system_of
from esail_jax.identification.parameters import Parameter, overrides_of, shown_by
from esail_jax.identification.telemetry import Telemetry
from esail_jax.observables import chain, is_chain, sail
from esail_jax.observables.entry import shape_of
from esail_jax.scenes.scene import Scene
from esail_jax.simulation.simulate import simulate

ROOM = 3
"""Steps that a run with other parameters may need, as a multiple of those of the scene."""

LEAST_STEPS = 100
"""Steps of a short run, of which a multiple is allowed."""

LOOKS = 500
"""Instants of the run of the scene between which its steps are counted."""

STEPS_PER_WINDOW = 12
"""Most steps in a window of the derivative: each may be a block, of which a window has 16."""

STEPS_OF_WINDOW = 64
"""Steps in `max_steps` for which the derivative has a window (`simulation/under_trace.py`)."""


def measurable(scene: Scene) -> dict[str, tuple[int, ...]]:
    """The shapes of all observables that a run of the scene can have, those on request included, by
    name."""
    system = system_of(scene)
    if is_chain(system):
        entries = chain.listed(system)
    else:
        requested = [x for x in sail.ON_REQUEST if not x.needs or x.needs in system.parts]
        entries = [*sail.listed(system), *requested]
    return {entry.name: shape_of(entry.axes, scene.sizes) for entry in entries}


class Prediction(NamedTuple):
    """What a run predicts. values: of the measured cells (cell); jacobian: their derivatives (cell,
    parameter)."""

    values: Float[np.ndarray, " cell"]
    jacobian: Float[np.ndarray, "cell parameter"]


class Cells(NamedTuple):
    """The cells of one run that are measured. times: the instants of the run that have one [s], increasing;
    row: the instant of a cell, by index; name, place: its observable, and where in it; values: (cell);
    deviations: (cell)."""

    times: tuple[float, ...]
    row: np.ndarray
    name: tuple[str, ...]
    place: tuple[tuple[int, ...], ...]
    values: Float[np.ndarray, " cell"]
    deviations: Float[np.ndarray, " cell"]

    @property
    def names(self) -> tuple[str, ...]:
        """The observables that are measured."""
        return tuple(dict.fromkeys(self.name))

    @classmethod
    def of(cls, data: Telemetry, deviations: Float[np.ndarray, " column"]) -> "Cells":
        """Those of telemetry. deviations: of its columns."""
        known = np.isfinite(data.values)
        rows, columns = np.nonzero(known)
        times, row = np.unique(data.time[rows], return_inverse=True)
        names = tuple(data.columns[k].name for k in columns)
        places = tuple(tuple(i - 1 for i in data.columns[k].place or ()) for k in columns)
        return cls(tuple(times.tolist()), row, names, places, data.values[known], deviations[columns])

    def picked_from(self, shown: Mapping[str, Array]) -> Float[Array, " cell"]:
        """The cells of observables (time, ...) at the instants of the run."""
        parts = []
        order = []
        for name in self.names:
            mine = np.flatnonzero([x == name for x in self.name])
            index = (self.row[mine], *np.array([self.place[k] for k in mine]).T.astype(int))
            parts.append(shown[name][index])
            order.append(mine)
        return jnp.concatenate(parts)[np.argsort(np.concatenate(order))]


def steps_with_room(scene: Scene, cells: Cells) -> int:
    """A bound of the steps of runs whose parameters differ from those of the scene, from its own run, which
    is made: a multiple of its steps, and so many that the derivative has windows in which few steps are,
    also where they crowd at the edges of a voltage. Raises SimulationError if the run fails."""
    grid = np.linspace(0.0, cells.times[-1], LOOKS)[1:]
    times = np.union1d(grid, cells.times)
    run = simulate(scene, save=cells.names[:1], times=times.tolist())
    steps = np.asarray(run.numerics["steps"])
    count = np.array([steps[times <= end].sum() for end in grid])
    windows = windows_for(np.diff(count, prepend=0.0))
    return int(max(ROOM * max(run.steps, LEAST_STEPS), windows * STEPS_OF_WINDOW))


def windows_for(count: Float[np.ndarray, " part"]) -> int:
    """The number of equal windows of a run of which none has more than STEPS_PER_WINDOW steps. count: of
    the steps in equal parts of the run. A window that begins anywhere meets one part more than it is long.
    """
    parts = len(count)
    before = np.concatenate([np.zeros(1), np.cumsum(count)])
    for long in range(parts - 1, 0, -1):
        if (before[long + 1 :] - before[: -long - 1]).max() <= STEPS_PER_WINDOW:
            return int(np.ceil(parts / long))
    return int(np.ceil(count.max() * parts / STEPS_PER_WINDOW))


def predicted(
    scene: Scene, parameters: Sequence[Parameter], cells: Cells, max_steps: int
) -> Callable[[Float[Array, " parameter"]], Float[Array, " cell"]]:
    """The function from the values of the parameters to what the instruments show; it may be traced.
    max_steps: of a run, which its derivative needs to know; one that needs more is NaN."""
    overrides = overrides_of(scene, parameters)
    names = cells.names

    def shown(values: Float[Array, " parameter"]) -> Float[Array, " cell"]:
        run = simulate(scene, overrides(values), save=names, times=list(cells.times), max_steps=max_steps)
        signals = {name: shown_by(parameters, values, name, jnp.asarray(run[name])) for name in names}
        return cells.picked_from(signals)

    return shown


def predictor(
    scene: Scene, parameters: Sequence[Parameter], cells: Cells
) -> Callable[[Float[np.ndarray, " parameter"]], Prediction]:
    """The compiled function from the values of the parameters to a prediction. Entries are NaN if the run
    fails. The run of the scene itself is made at once: raises SimulationError if that fails."""
    shown = predicted(scene, parameters, cells, steps_with_room(scene, cells))

    @jit
    def both(values: Any) -> Any:
        directions = jnp.eye(len(parameters))
        push = lambda direction: jax.jvp(shown, (values,), (direction,))  # noqa: E731
        return jax.vmap(push, out_axes=(None, -1))(directions)

    def at(values: Float[np.ndarray, " parameter"]) -> Prediction:
        return Prediction(*map(np.asarray, both(jnp.asarray(values, float))))

    return at
