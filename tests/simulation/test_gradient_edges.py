"""Derivatives of runs where a root, an angle or a maximum has none: at no voltage, of straight tethers, of
slack ones; and of what happens early by what is done last."""

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
    """The method, with steps that do not depend on the numbers."""
    sizes = {"collocation": 5.0, "generalized-alpha": 0.2, "energy-momentum": 0.2}
    return {"integrator.method": method, "integrator.step": sizes[method]}


# ---- an early control ---------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS[:2])
def test_an_early_control_changes_the_end(method):
    """d(sailing angle at 240 s)/d(voltage of the first instant, whose share in the law is gone at 60 s),
    against the difference quotient of fourth order of concrete runs: 2e-5. The change of 2 % leaves a
    truncation of 1e-8, and iterations 1e-8 m of the metres by which tips move."""
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
"""Angles among them, whose roots have no derivative of their own at zero."""

SHORT = 0.99
"""Part of its length that a slack tether starts with."""

LIGHT = 1.4
"""Tip mass [kg] below which tethers start slack here: so one program serves for both starts."""

ALONG = jnp.array([1e3, -5e2, 2e3, 1e-3, 0.1])
"""Of three voltages, spin and tip mass."""


@pytest.fixture(scope="module", params=METHODS)
def both(request):
    """Forward and reverse mode of what a short run ends with, by voltages, spin and tip mass: compiled."""
    # Times of its own: nothing that was compiled with the usual start serves here, or the other way round.
    overrides = SMALL | steps_of(request.param) | {"integrator.t_end": 10.0, "output.interval": 10.0}
    if request.param == "collocation":
        del overrides["integrator.step"]  # which steps it needs is its own matter
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
    """Finite, and equal to 1e-9 of the sum of the magnitudes (rounding). The outcomes."""
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
    """Every run starts exactly straight; without voltage, or with one that the wind's protons do not feel,
    tethers stay so; without spin they are not stretched either. None of it is a NaN."""
    check_modes(both, [
        [20e3, 20e3, 20e3, 4e-3, 1.5],
        [0.0, 0.0, 0.0, 4e-3, 1.5],
        [500.0, 0.0, 20e3, 4e-3, 1.5],
        [20e3, 20e3, 20e3, 0.0, 1.5],
        [0.0, 0.0, 0.0, 0.0, 1.5],
    ])  # fmt: skip


@pytest.mark.slow
def test_slack_tethers(both):
    """Tethers that start a hundredth shorter than they are, and so in compression: metres from where taut
    ones of nearly that tip mass end."""
    light, heavy = LIGHT - 1e-6, LIGHT + 1e-6
    slack, taut = check_modes(both, [[20e3, 18e3, 22e3, 4e-3, x] for x in (light, heavy)])
    assert abs(slack - taut) > 1.0
    check_modes(both, [[0.0, 0.0, 0.0, 0.0, light]])
