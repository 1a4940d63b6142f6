"""Second derivatives of runs in which an instant with a kink of the thrust moves with the numbers.

The thrust has a kink where a voltage passes the cutoff voltage (1 kV here) or a limit, and where a table
has a row. The first derivative of the motion is continuous there, but its rate is not, so that a second
derivative that is computed with the instant held is wrong: for `voltage.on` it had the wrong sign and the
twentyfold size."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from support.quick import jit
from support.truss_sail import SAIL

RUN = SAIL | {"integrator.t_end": 200.0, "output.interval": 50.0, "integrator.tolerance": 1e-12}
STEPS = {"integrator.tolerance": None, "integrator.step": 0.25}
ON_OFF = {"voltage.law": "on-off", "voltage.on": 60.0, "voltage.off": 160.0, "voltage.rise_time": 5.0}
WINDOW = {
    "voltage.law": "phase-window", "voltage.on_phase_deg": 30.0, "voltage.off_phase_deg": 150.0,
    "voltage.rise_phase_deg": 20.0,
}  # fmt: skip
HARMONIC = {"voltage.law": "harmonic", "voltage.sine": [0.6]}


def instants(x):
    """Instants of a table of four rows whose second and third move."""
    return jnp.stack([jnp.zeros_like(x), x, x + 20.0, jnp.full_like(x, 200.0)])


class Case(NamedTuple):
    """A second derivative by one number. scene: overrides; key: of the number; at: its value; h: step of
    the quotient; rel: tolerance; of: what the scene is given for the number, or, without a key, further
    overrides; second: the second derivative."""

    scene: dict
    key: str
    at: float
    h: float
    rel: float
    of: Callable = lambda x: x
    second: Callable = lambda f: jax.jacfwd(jax.jacfwd(f))


FREE, SWAPPED, FORESEEN, JAGGED, WITHIN = 2e-8, 1e-3, 1e-3, 1e-2, 2e-2
"""Tolerances. Of kinks at known instants: the error of the quotients. Of two kinks that pass each other:
the quotients' error is of the order of their distance, 1 % for half a second. Of kinks in a window of
the phase: steps end about them by 1e-4 of the rise only. Of slopes of first derivatives that jump by 1e-3
of their range where the kink passes a step (the second derivatives of the three methods agree to 2e-4).
Of a kink within a step of a ramp, whose quadrature there has an error of a part of the step: over the
whole ramp the second derivative of the voltage has the mean zero, and its effect is what remains."""

CASES = {
    "on": Case(ON_OFF, "voltage.on", 60.0, 0.2, FREE),
    "off": Case(ON_OFF, "voltage.off", 160.0, 0.2, FREE),
    "rise": Case(ON_OFF, "voltage.rise_time", 5.0, 0.1, 1e-6),
    "rows of voltages": Case(
        {"voltage.law": "piecewise-linear", "voltage.table": [0.0, 1.0, 0.8, 1.0]},
        "voltage.time", 60.0, 0.5, FREE, instants,
    ),
    "rows of the wind": Case(
        {"solar_wind.speed": [4e5, 4e5, 5e5, 5e5], "solar_wind.number_density": [5e6, 5e6, 8e6, 8e6]},
        "solar_wind.time", 60.0, 0.5, FREE, instants,
    ),
    "rows of temperatures": Case(
        {"thermal.temperature": [300.0, 300.0, 330.0, 330.0], "thermal.reference_temperature": 300.0,
         "thermal.expansion": 2e-5},
        "thermal.time", 60.03, 1.0, 1e-5, instants,
    ),
    "rows of both": Case(
        {"voltage.law": "piecewise-linear", "voltage.table": [0.0, 1.0, 0.8, 1.0],
         "solar_wind.speed": [4e5, 4e5, 5e5, 5e5], "solar_wind.number_density": [5e6, 5e6, 8e6, 8e6]},
        "", 60.0, 0.02, SWAPPED,
        lambda x: {"voltage.time": instants(x), "solar_wind.time": instants(120.0 - x)},
    ),
    "window's phase": Case(WINDOW, "voltage.on_phase_deg", 30.0, 2.0, FORESEEN),
    "window's voltage": Case(WINDOW, "voltage.value", 20e3, 400.0, FORESEEN),
    "spin in a window": Case(WINDOW, "initial.spin_rate", 4e-3, 4e-5, FORESEEN),
    "harmonic": Case(HARMONIC, "voltage.cosine", 1.2, 0.1, JAGGED, lambda x: jnp.stack([x])),
    "limit": Case(
        HARMONIC | {"voltage.maximum": 14e3}, "voltage.cosine", 0.3, 0.05, JAGGED,
        lambda x: jnp.stack([x]),
    ),
    "power": Case(
        ON_OFF | {"voltage.rise_time": 30.0, "tethers.wire_radius": 12.5e-6, "tethers.wires": 4,
         "voltage.power_limit": 3.0},
        "voltage.on", 60.0, 1.0, WITHIN,
    ),
    "power in reverse mode": Case(
        HARMONIC | {"tethers.wire_radius": 12.5e-6, "tethers.wires": 4, "voltage.power_limit": 6.38},
        "voltage.cosine", 0.3, 0.02, JAGGED,
        lambda x: jnp.stack([x]), lambda f: jax.jacfwd(jax.grad(f)),
    ),
    "fixed steps": Case(
        HARMONIC | STEPS | {"integrator.method": "generalized-alpha"},
        "voltage.cosine", 1.2, 0.1, JAGGED, lambda x: jnp.stack([x]),
    ),
    "conserving steps": Case(
        HARMONIC | STEPS | {"integrator.method": "energy-momentum"},
        "voltage.cosine", 1.2, 0.1, JAGGED, lambda x: jnp.stack([x]),
    ),
}  # fmt: skip


@pytest.mark.nightly
@pytest.mark.parametrize("name", CASES)
def test_second_derivative_where_a_kink_moves(name):
    """The derivative of the first derivative is the slope of a polynomial of fifth degree through eleven
    first derivatives, which evens out the small jumps where the steps of error control change."""
    scene, key, at, h, rel, of, second = CASES[name]

    def angle(x):
        given = {key: of(x)} if key else of(x)
        return esail.simulate("baseline", RUN | scene | given)["coning_angle"][-1, 0]

    slope = jit(jax.jacfwd(angle))
    x = np.linspace(-1.0, 1.0, 11)
    fitted = np.polyfit(x, [float(slope(at + h * part)) for part in x], 5)[-2] / h
    assert float(jit(second(angle))(at)) == pytest.approx(fitted, rel=rel)


@pytest.mark.nightly
def test_second_derivatives_at_instants_within_the_step_of_a_kink():
    """A harmonic voltage passes the cutoff at 52.2 s, within a step that ends behind 54 s. The rows from
    there on have the second derivative of a run with shorter steps, which grows from 1e-7 to 1e-4 behind
    the kink; to 3e-2, the error of the place of the kink in the long step."""

    def angles(amplitude, tolerance):
        shorter = {"integrator.t_end": 60.0, "output.interval": 1.0, "integrator.tolerance": tolerance}
        number = {"voltage.cosine": jnp.stack([amplitude])}
        return esail.simulate("baseline", RUN | HARMONIC | shorter | number)["coning_angle"][50:, 0]

    second = jit(jax.jacfwd(jax.jacfwd(angles)))
    long, short = (np.asarray(second(1.2, tolerance)) for tolerance in (1e-9, 1e-13))
    assert short[4] > 1e3 * short[1]
    np.testing.assert_allclose(long, short, rtol=3e-2)
