"""A small sail whose telemetry is fitted: one program of its run, with the derivatives by all parameters,
for many fits.

Three tethers of one truss element on a hub without symmetry, for 60 s. `served` puts the program in the
place of those that a problem with some of the parameters and some of the cells would compile.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np

import esail_jax as esail
from esail_jax.identification.fit import Problem
from esail_jax.identification.model import Cells, Prediction, measurable, predictor
from esail_jax.identification.parameters import Parameter, parameters_of

SAIL = {
    "tethers.count": 3, "tethers.elements": 1, "tethers.length": 300.0, "remote_units.mass": 0.5,
    "voltage.value": 20e3, "initial.spin_rate": 0.05,
    "hub.height": None, "hub.radius": None, "hub.density": None, "hub.mass": 40.0,
    "hub.inertia": np.array([[8.0, 0.5, 0.2], [0.5, 6.0, -0.3], [0.2, -0.3, 5.0]]),
    "hub.centre": np.array([0.01, -0.02, 0.015]),
    "hub.roots": np.array([[0.02, 0.5, 0.0], [-0.01, -0.25, 0.43], [0.0, -0.25, -0.43]]),
    "integrator.t_end": 60.0, "integrator.tolerance": 1e-10, "output.interval": 5.0,
}  # fmt: skip
"""The hub swings by three degrees. With two tethers it would tumble within this time."""

FREE = (
    "solar_wind.thrust_factor", "solar_wind.number_density", "tethers.length[*]", "hub.inertia[1,2]",
    "hub.centre[1]", "hub.torque[*]", "bias.spin_rate[*]", "misalignment.angular_velocity_B[*]",
    "initial.spin_rate", "hub.roots[2,2]",
)  # fmt: skip
"""All parameters of the program."""

NOISE = {"spin_rate": 1e-6, "angular_velocity_B": 1e-6, "coning_angle": 1e-5}
"""Standard deviations [rad/s, rad/s, rad]: ten to a hundred times less than what the sail does in 60 s."""

TIMES = np.sort(np.concatenate([np.arange(0.0, 61.0, 4.0), [1.3, 7.7, 33.3, 58.9]]))
"""Instants of the measurements [s], also within steps and between saved instants."""


@functools.cache
def sail() -> esail.Scene:
    """The scene."""
    return esail.load_scene("truss", SAIL)


@functools.cache
def shapes() -> dict[str, tuple[int, ...]]:
    """The shapes of the observables of its run."""
    return measurable(sail())


@functools.cache
def whole() -> Problem:
    """The problem with all parameters and cells. The measurements are zero."""
    data = {name: np.zeros((len(TIMES), *shapes()[name])) for name in NOISE}
    problem = Problem.of(sail(), {"time": TIMES, **data}, FREE, NOISE)
    problem.__dict__["models"] = [predictor(sail(), problem.parameters, problem.cells[0])]
    return problem


@functools.lru_cache(maxsize=4)
def shown_at(point: tuple[float, ...]) -> Prediction:
    """What the program gives at values of all parameters; several runs at one point are one call."""
    return whole().models[0](np.array(point))


def cell_names(cells: Cells) -> list[tuple[float, str, tuple[int, ...]]]:
    """The instant, observable and place of every cell."""
    return list(zip(np.array(cells.times)[cells.row].tolist(), cells.name, cells.place, strict=True))


def served(
    scene: esail.Scene, parameters: Sequence[Parameter], cells: Cells
) -> Callable[[np.ndarray], Prediction]:
    """What `predictor` gives for some of the parameters and cells, from the program of all."""
    own = {parameter.name: k for k, parameter in enumerate(whole().parameters)}
    column = [own[parameter.name] for parameter in parameters]
    place = {name: k for k, name in enumerate(cell_names(whole().cells[0]))}
    row = [place[name] for name in cell_names(cells)]
    base = np.array([parameter.start for parameter in parameters_of(scene, FREE, shapes())])

    def at(values: np.ndarray) -> Prediction:
        point = base.copy()
        point[column] = values
        found = shown_at(tuple(point.tolist()))
        return Prediction(found.values[row], found.jacobian[np.ix_(row, column)])

    return at


def telemetry(
    change: Mapping[str, Any] | None = None, names: Sequence[str] = tuple(NOISE), times: Any = TIMES
) -> dict[str, np.ndarray]:
    """What a run of the sail with changes shows, without noise."""
    run = esail.simulate(sail(), change, times=list(times), save=tuple(names))
    return {"time": np.asarray(times, float), **{name: np.asarray(run[name]) for name in names}}


def with_noise(data: Mapping[str, np.ndarray], seed: int) -> dict[str, np.ndarray]:
    """Telemetry with the noise of `NOISE`."""
    random = np.random.default_rng(seed)
    return {
        name: x if name == "time" else x + NOISE[name] * random.standard_normal(x.shape)
        for name, x in data.items()
    }


# ---- models without a run --------------------------------------------------------------------------


def with_model(problem: Problem, *models: Callable[[Any], Any]) -> Problem:
    """The problem with functions of the parameters in the place of runs; they are differentiated by
    forward mode."""

    def of(model: Callable[[Any], Any]) -> Callable[[np.ndarray], Prediction]:
        both = jax.jit(lambda x: (model(x), jax.jacfwd(model)(x)))
        return lambda x: Prediction(*map(np.asarray, both(x)))

    problem.__dict__["models"] = [of(model) for model in models]
    return problem
