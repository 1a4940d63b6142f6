"""Derivatives of runs at states where a square root, an angle or a maximum has no derivative of its own.

Such states have no voltage, straight tethers, or slack tethers. Another test differentiates the end of a
run with respect to an early control.
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
LAW = {"voltage.law": "piecewise-linear", "voltage.time": [0.0, 60.0, 120.0]}


def steps_of(method):
    """Returns overrides for a method with a given step, which does not depend on the scene's numbers."""
    sizes = {"collocation": 5.0, "generalized-alpha": 0.2, "energy-momentum": 0.2}
    return {"integrator.method": method, "integrator.step": sizes[method]}


# ---- an early control ---------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS[:2])
def test_an_early_control_changes_the_end(method):
    """The derivative of the sailing angle at 240 s by an early voltage is the difference quotient, to 2e-5.

    The voltage is that of the first instant of a piecewise linear law and has no effect after 60 s. The
    quotient is of fourth order and uses concrete runs. A change of 2 % gives a truncation error of 1e-8;
    iterations end at 1e-8 m, while the tips move by metres.
    """
    times = {"integrator.t_end": 240.0, "output.interval": 240.0}

    def end(first):
        table = jnp.stack([jnp.asarray(first), jnp.asarray(1.0), jnp.asarray(0.8)])
        run = esail.simulate("baseline", SMALL | LAW | times | steps_of(method) | {"voltage.table": table})
        return run["sailing_angle"][-1]

    found = jit(jax.grad(end))(jnp.asarray(0.9))
    change = 0.02

    def at(steps):
        return np.asarray(end(0.9 + steps * change))

    quotient = (8.0 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12.0 * change)
    assert abs(quotient) > 1e-6
    np.testing.assert_allclose(found, quotient, rtol=2e-5)


# ---- states without a derivative of their own ---------------------------------------------------

OBSERVED = ("tip_position_I", "coning_angle", "root_coning_angle", "lagging_angle", "sailing_angle")
"""Observables of the end. Some are angles, whose square roots have no derivative at zero."""

SHORT = 0.99
"""Initial length of a slack tether divided by its undeformed length."""

LIGHT = 1.4
"""Tip mass [kg] below which tethers start slack in these tests, so that one program has both initial
states."""

ALONG = jnp.array([1e3, -5e2, 2e3, 1e-3, 0.1])
"""Direction of differentiation: three voltages [V], spin rate [rad/s] and tip mass [kg]."""


@pytest.fixture(scope="module", params=METHODS)
def both(request):
    """The compiled derivatives of the end of a short run, in forward and reverse mode.

    The variables are three voltages, the spin rate and the tip mass.
    """
    # No other test has this t_end: programs with the usual and the shortened start must not be mixed up.
    overrides = SMALL | steps_of(request.param) | {"integrator.t_end": 10.0, "output.interval": 10.0}
    if request.param == "collocation":
        del overrides["integrator.step"]  # collocation chooses its steps
    steady = build.steady_line

    def shortened(tethers, *numbers):
        line, left = steady(tethers, *numbers)
        return jnp.where(tethers.tip_mass < LIGHT, SHORT, 1.0) * line, left

    def outcome(x):
        numbers = {"voltage.value": x[:3], "initial.spin_rate": x[3], "remote_units.mass": x[4]}
        run = esail.simulate("baseline", overrides | numbers)
        end = [jnp.ravel(run[name][-1]) for name in OBSERVED]
        return jnp.concatenate(end) @ jnp.cos(jnp.arange(sum(x.size for x in end)))

    modes = jit(lambda x: (jax.jvp(outcome, (x,), (ALONG,)), jax.grad(outcome)(x)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "steady_line", shortened)
        return modes.lower(jnp.zeros(5)).compile()


def check_modes(both, at):
    """Checks that both modes are finite and agree to 1e-9 of the sum of magnitudes; returns the
    outcomes."""
    values = []
    for x in at:
        (value, forward), reverse = both(jnp.array(x))
        assert np.isfinite(value) and np.isfinite(forward) and np.isfinite(reverse).all(), x
        parts = np.asarray(reverse * ALONG)
        assert abs(parts.sum() - forward) < 1e-9 * np.abs(parts).sum(), x
        values.append(float(value))
    return values


@pytest.mark.slow
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


@pytest.mark.slow
def test_slack_tethers(both):
    """Derivatives are finite for tethers that start 1 % shorter than undeformed, and so in compression.

    These tethers end metres away from taut tethers of nearly the same tip mass.
    """
    light, heavy = LIGHT - 1e-6, LIGHT + 1e-6
    slack, taut = check_modes(both, [[20e3, 18e3, 22e3, 4e-3, x] for x in (light, heavy)])
    assert abs(slack - taut) > 1.0
    check_modes(both, [[0.0, 0.0, 0.0, 0.0, light]])
