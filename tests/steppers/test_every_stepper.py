"""Every stepper, the package's and one from outside, in all that a run offers.

CASES is a table with one entry per method. A new method becomes one more entry, and then passes through
order of convergence, output between steps, resuming, events, derivatives, batches and failures. Every case
compiles three programs: the run on the host, a batch of traced runs, and a run with its derivatives."""

import dataclasses
import functools
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.rod_chain import error_scale
from esail_jax.scenes.build import build_chain
from esail_jax.scenes.scene import Scene, parse
from esail_jax.scenes.structure import split
from esail_jax.simulation.host import HostRun, compile_scene, paths
from esail_jax.simulation.results import join
from esail_jax.steppers.collocation import Collocation
from esail_jax.steppers.energy_momentum import EnergyMomentum
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.steppers.results import name_of
from esail_jax.steppers.runge_kutta import RungeKutta
from esail_jax.steppers.stepper import AbstractStepper
from support.own_stepper import RungeKutta4
from support.quick import jit

SAIL = """
[tethers]
count = 2
length = 1000.0
area = 4.28e-9
density = 7653.0
youngs_modulus = 5e7
elements = 1
axial_damping_time = [0.3, 0.4]

[remote_units]
mass = 0.5

[solar_wind]
speed = 4e5
number_density = 7.3e6
cutoff_voltage = 1e3

[voltage]
value = [2e6, 1e6]

[initial]
spin_rate = 0.01
sailing_angle_deg = 60.0
coning_angle_deg = 5.0

[integrator]
t_end = 16.0

[output]
interval = 1.0

[[event]]
time = 9.3
release = 2
"""
"""Two soft tethers on a turning frame. With EA = 0.2 N the fastest modes stay near 1 rad/s, so that every
method resolves them. The second tether is released within a step."""

HUB = """
[hub]
height = 2.0
radius = 1.0
density = 884.0
"""

CHAIN = """
[chain]
rods = 2
mass = 0.1
length = 1.0
area = 1e-6
youngs_modulus = 1e7
axial_damping_time = 1e-3

[gravity]
acceleration = [0.0, -9.81, 0.0]

[initial]
rod_vector = [0.0, -1.0, 0.0]
rod_rate = [1.0, 0.0, 0.0]

[integrator]
t_end = 1.6

[output]
interval = 0.1
"""

LATE = {"event.time": [100.0]}
"""Override that moves the release behind the end of the run. It leaves the programs as they are."""


@dataclasses.dataclass(frozen=True)
class Case:
    """A method on a scene.

    scene; stepper: the method with a fineness, which is a step size [s] or a tolerance; fineness: three of
    them; order: the order of convergence and how far it may be missed; between: the largest error between
    steps, relative to the largest at their ends; max_steps: a bound that the coarsest run keeps and the
    finest does not; failures: results by input, a factor of the first number or a fineness."""

    scene: Scene
    stepper: Callable[[Any], AbstractStepper]
    fineness: tuple[float, float, float]
    order: tuple[float, float]
    max_steps: int
    failures: Mapping[tuple[str, float], str]
    between: float = 3.0

    @property
    def chain(self) -> bool:
        return self.scene.chain is not None

    @property
    def end(self) -> float:
        return self.scene.integrator.t_end

    @property
    def names(self) -> tuple[str, ...]:
        """Observables that are compared."""
        if self.chain:
            return ("joint_position", "dissipated_energy", "tension")
        return ("tip_position_I", "dissipated_energy", "external_work", "reaction_B")

    def numbers(self, x: Any) -> dict[str, Any]:
        """Overrides of four numbers of the scene; x: factors."""
        if self.chain:
            return {
                "initial.rod_rate": np.array([1.0, 0.0, 0.2]) * x[0],
                "chain.mass": 0.1 * x[1],
                "chain.axial_damping_time": 1e-3 * x[2],
                "chain.youngs_modulus": 1e7 * x[3],
            }
        return {
            "voltage.value": np.array([2e6, 1e6]) * x[0],
            "initial.spin_rate": 0.01 * x[1],
            "remote_units.mass": 0.5 * x[2],
            "tethers.youngs_modulus": 5e7 * x[3],
        }

    def run(self, fineness: Any, x: Any = (1.0,) * 4, times: Any = None, late: bool = False, **more: Any):
        """The run with this fineness and these factors, with a release unless it is to be late."""
        overrides = self.numbers(x) | (LATE if late and not self.chain else {})
        stepper = self.stepper(jnp.asarray(fineness))
        return esail.simulate(
            self.scene, overrides, stepper=stepper, save=self.names, times=times, **more
        )


FRAME, SMALL_SAIL, SMALL_CHAIN = parse(SAIL, "frame"), parse(HUB + SAIL, "sail"), parse(CHAIN, "chain")
NONFINITE = {("number", 1e200): "nonfinite"}


@functools.cache
def chain_scale() -> Any:
    """Magnitudes of the chain's coordinates, by which an error control measures."""
    return error_scale(*build_chain(*split(SMALL_CHAIN)))


CASES = {
    "own": Case(FRAME, RungeKutta4, (0.4, 0.2, 0.1), (4.0, 0.3), 100, NONFINITE),
    "tsit5": Case(
        SMALL_CHAIN, lambda h: RungeKutta(h, None, None, "tsit5"), (4e-3, 2e-3, 1e-3), (5.0, 0.3), 500, NONFINITE
    ),
    "dopri8": Case(
        SMALL_CHAIN,
        lambda tolerance: RungeKutta(None, tolerance, chain_scale(), "dopri8"),
        (1e-5, 1e-7, 1e-9),
        (8.0, 2.0),
        100,
        {},
    ),
    "collocation": Case(
        SMALL_SAIL, lambda tolerance: Collocation(None, tolerance), (1e-4, 1e-6, 1e-8), (7.0, 1.5), 24, NONFINITE
    ),
    "collocation-fixed": Case(
        SMALL_SAIL,
        lambda h: Collocation(h, jnp.asarray(1e-8)),
        (1.0, 0.5, 0.25),
        (7.0, 0.6),
        24,
        NONFINITE | {("fineness", 1e4): "newton_diverged"},
    ),
    "generalized-alpha": Case(
        SMALL_SAIL,
        lambda h: GeneralizedAlpha(h, jnp.asarray(0.8)),
        (0.2, 0.1, 0.05),
        (2.0, 0.1),
        200,
        NONFINITE | {("fineness", 1e4): "newton_diverged"},
    ),
    "energy-momentum": Case(
        SMALL_SAIL, EnergyMomentum, (0.2, 0.1, 0.05), (2.0, 0.1), 200, NONFINITE
    ),
}  # fmt: skip


def cases(quick: str):
    """The names of CASES for `parametrize`; all but `quick` are marked slow."""
    marks = lambda name: [] if name == quick else [pytest.mark.slow]  # noqa: E731
    return pytest.mark.parametrize("name", [pytest.param(name, marks=marks(name)) for name in CASES])


def difference(one: Any, other: Any, name: str, rows: Any = slice(None)) -> float:
    """The largest difference of an observable between two runs, relative to its largest magnitude."""
    a, b = np.asarray(one[name])[rows], np.asarray(other[name])[rows]
    return float(np.abs(a - b).max() / np.abs(np.asarray(other[name])).max())
