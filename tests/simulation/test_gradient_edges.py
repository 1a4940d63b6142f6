"""Derivatives of runs with a voltage law and a wind in time, also at states where a square root, an angle
or a maximum has no derivative of its own.

Such states have no voltage, straight tethers, or slack tethers. All tests of a method share one program:
the value of a short run, its derivative along a direction, and its gradient.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.scenes import build
from support.quick import jit

METHODS = ("collocation", "generalized-alpha", "energy-momentum")
SMALL = {"tethers.count": 3, "tethers.elements": 2}
LAW = {"voltage.law": "harmonic", "voltage.sine": [0.1, 0.05]}
WIND = {"solar_wind.time": [0.0, 4.0, 10.0], "solar_wind.number_density": [7.3e6] * 3}
STEPS = {
    "collocation": {"integrator.tolerance": 1e-11},
    "generalized-alpha": {"integrator.step": 0.2},
    "energy-momentum": {"integrator.step": 0.2},
}
"""Overrides by method: a step, or a tolerance by which collocation chooses its steps."""

OBSERVED = ("tip_position_I", "coning_angle", "root_coning_angle", "lagging_angle", "sailing_angle")
"""Observables of the end. Some are angles, whose square roots have no derivative at zero."""

SHORT = 0.99
"""Initial length of a slack tether divided by its undeformed length."""

LIGHT = 1.4
"""Tip mass [kg] below which tethers start slack in these tests, so that one program has both initial
states."""

CONTROL = [0.3, 4e5]
"""Amplitude of the voltage law, and speed [m/s] of the wind at the start, which has no effect after 4 s."""

ALONG = np.array([1e3, -5e2, 2e3, 1e-3, 0.1, 0.05, 1e4])
"""Direction of differentiation: three voltages [V], spin rate [rad/s], tip mass [kg], and CONTROL."""

AT_REST = np.where(np.arange(7) == 3, 0.0, ALONG)
"""The same for a sail without spin. Its lagging angles count in the sense of the spin, so that they have a
kink there: the sign of their derivatives by the spin rate is that of a rounding error."""


@pytest.fixture(scope="module", params=METHODS)
def both(request):
    """The compiled derivatives of the end of a short run, in forward and reverse mode.

    The variables are three voltages, the spin rate, the tip mass, and CONTROL.
    """
    # No other test has this t_end: programs with the usual and the shortened start must not be mixed up.
    overrides = SMALL | LAW | WIND | {"integrator.method": request.param} | STEPS[request.param]
    overrides |= {"integrator.t_end": 10.0, "output.interval": 10.0}
    steady = build.steady_line

    def shortened(tethers, *numbers):
        line, left = steady(tethers, *numbers)
        return jnp.where(tethers.tip_mass < LIGHT, SHORT, 1.0) * line, left

    def outcome(x):
        numbers = {"voltage.value": x[:3], "initial.spin_rate": x[3], "remote_units.mass": x[4]}
        numbers |= {"voltage.cosine": x[5] * jnp.array([1.0, 0.1])}
        numbers |= {"solar_wind.speed": jnp.append(x[6:], jnp.full(2, 4e5))}
        run = esail.simulate("baseline", overrides | numbers)
        end = [jnp.ravel(run[name][-1]) for name in OBSERVED]
        return jnp.concatenate(end) @ jnp.cos(jnp.arange(sum(x.size for x in end)))

    modes = jit(lambda x, along: (jax.jvp(outcome, (x,), (along,)), jax.grad(outcome)(x)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "steady_line", shortened)
        return modes.lower(jnp.zeros(7), jnp.zeros(7)).compile()


def check_modes(both, at):
    """Checks that both modes are finite and agree to 1e-9 of the sum of magnitudes; returns the
    outcomes."""
    values = []
    for x in at:
        along = ALONG if x[3] else AT_REST
        (value, forward), reverse = both(jnp.array([*x, *CONTROL]), along)
        assert np.isfinite(value) and np.isfinite(forward) and np.isfinite(reverse).all(), x
        parts = np.asarray(reverse * along)
        assert abs(parts.sum() - forward) < 1e-9 * np.abs(parts).sum(), x
        values.append(float(value))
    return values


@pytest.mark.nightly
def test_a_steered_run_and_an_early_control(both, request):
    """Derivatives of the end are fourth-order difference quotients of the run itself, to 2e-5.

    They are taken by the amplitude of a voltage law, whose phase follows the attitude; by the wind at the
    start; and by all numbers together, where the spin changes the phase. Truncation is below 1e-7: the run
    is nearly linear in amplitude and wind, which change the end by some 1e-4 m. Collocation takes other
    steps for other numbers: their errors, 1e-11 of 10 km, add 5e-7 m to the bound.
    """
    noise = 5e-7 if request.node.callspec.params["both"] == "collocation" else 0.0
    x = jnp.array([20e3, 18e3, 22e3, 4e-3, 1.5, *CONTROL])
    (_, forward), reverse = both(x, ALONG)

    def quotient(change):
        ends = [float(both(x + k * change, ALONG)[0][0]) for k in (-2, -1, 1, 2)]
        return (8.0 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / 12.0

    unit = jnp.eye(7)
    for found, change, size in (
        (reverse[5], unit[5], 0.2),
        (reverse[6], unit[6], 8e4),
        (forward, ALONG, 0.02),
    ):
        np.testing.assert_allclose(size * found, quotient(size * change), rtol=2e-5, atol=noise)


@pytest.mark.nightly
def test_no_voltage_no_spin_and_straight_tethers(both):
    """Derivatives are finite for straight tethers, without voltage and without spin.

    Every run starts with straight tethers. They stay straight without voltage or with a voltage below the
    energy of the protons, and they are not stretched without spin.
    """
    check_modes(both, [
        [20e3, 20e3, 20e3, 4e-3, 1.5],
        [0.0, 0.0, 0.0, 4e-3, 1.5],
        [500.0, 0.0, 20e3, 4e-3, 1.5],
        [20e3, 20e3, 20e3, 0.0, 1.5],
        [0.0, 0.0, 0.0, 0.0, 1.5],
    ])  # fmt: skip


@pytest.mark.nightly
def test_slack_tethers(both):
    """Derivatives are finite for tethers that start 1 % shorter than undeformed, and so in compression.

    These tethers end metres away from taut tethers of nearly the same tip mass.
    """
    light, heavy = LIGHT - 1e-6, LIGHT + 1e-6
    slack, taut = check_modes(both, [[20e3, 18e3, 22e3, 4e-3, x] for x in (light, heavy)])
    assert abs(slack - taut) > 1.0
    check_modes(both, [[0.0, 0.0, 0.0, 0.0, light]])
