"""A user's voltage law that jumps is said: the run warns, and a derivative is refused.

The laws of the runs are one law with other numbers, so that they share their programs.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

import esail_jax as esail
from esail_jax.errors import SimulationError
from esail_jax.files.run_file import save
from esail_jax.simulation.voltage_jumps import (
    DERIVATIVE,
    jump_among,
    jump_warning,
    may_jump,
    operations,
    without_derivative,
)
from support.own_laws import SAIL, Waves

SPIN = 4e-3


class Beam(eqx.Module):
    """More voltage where the root's cosine is above an edge: by a part of the voltage, and by a slope."""

    jump: float = 0.0
    slope: float = 0.0
    edge: float = 0.7

    def commanded(self, measurements):
        above = measurements.root_phase[0] - self.edge
        return 20e3 * (1.0 + jnp.where(above > 0.0, self.jump + self.slope * above, 0.0))


def simulate(law, overrides=None, **options):
    return esail.simulate("baseline", SAIL | (overrides or {}), voltage_law=law, **options)


# ---- which laws are looked at -------------------------------------------------------------------


OPERATIONS = {
    "comparison": (lambda m, k: jnp.where(m > 0.2, 1.0, 2.0), True),
    "choice of branches": (lambda m, k: lax.cond(m > 0.2, lambda: 1.0, lambda: 2.0), True),
    "sign": (lambda m, k: jnp.sign(m), True),
    "rounding": (lambda m, k: jnp.round(3.0 * m), True),
    "remainder": (lambda m, k: m % 1.0, True),
    "angle": (lambda m, k: jnp.arctan2(m, -1.0), True),
    "integers": (lambda m, k: jnp.arange(4.0)[(2.0 * m).astype(int)], True),
    "within a compiled function": (lambda m, k: jax.jit(lambda x: jnp.where(x > 0.2, 1.0, x))(m), True),
    "limits": (lambda m, k: jnp.clip(m, 0.0, 0.5) + jnp.maximum(m, 0.3) + jnp.abs(m), False),
    "smooth": (lambda m, k: jnp.tanh(9.0 * m) + jnp.sin(m) / (1.0 + m**2), False),
    "comparison of its own numbers": (lambda m, k: jnp.where(k > 0.2, m, 2.0 * m), False),
}


@pytest.mark.parametrize("name", OPERATIONS)
def test_a_law_is_looked_at_if_it_may_jump(name):
    """If an operation that may jump depends on a measurement m. One that depends on numbers k of the law
    only does not jump in time, and limits have kinks, no jumps."""
    law, expected = OPERATIONS[name]

    def found(k):
        nonlocal traced
        traced = jax.make_jaxpr(lambda m: law(m, k))(0.1)
        return k

    traced = None
    jax.eval_shape(found, 1.0)
    assert any(map(may_jump, operations(traced))) == expected


# ---- what a jump is -----------------------------------------------------------------------------


X = np.linspace(0.0, 1.0, 9)
CHANGES = {
    "none": (0.0 * X + 3.0, 0.0),
    "in the middle": (np.where(X > 0.4, 2.0, 1.0), 0.5),
    "at the end": (np.where(X == 1.0, 2.0, 1.0), 0.5),
    "there and back": (np.where(abs(X - 0.5) < 0.1, 4.0, 1.0), 0.75),
    "beside a straight line": (0.01 * X + np.where(X > 0.4, 2.0, 1.0), 1.00125 / 2.01),
    "a straight line": (1.0 + X, 0.0),
    "a kink": (np.maximum(X, 0.55), 0.0),
    "a steep transition": (np.tanh(5.0 * (X - 0.47)), 0.0),
    "less than a thousandth": (1.0 + 0.0009 * (X > 0.4), 0.0),
    "from zero": (1.0 * (X > 0.4), 1.0),
    "all zero": (0.0 * X, 0.0),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_jump_is_a_change_that_is_sudden_within_the_step(name):
    """More than half of the change within an eighth of a step, relative to the largest voltage; in one of
    several tethers, for either sign."""
    volts, expected = CHANGES[name]
    still = np.full_like(volts, volts[0])
    for rows in ([volts], [still, volts], [-volts]):
        np.testing.assert_allclose(jump_among(jnp.stack(rows, 1)), expected, rtol=1e-12)


def test_derivatives_after_a_jump_are_undefined_and_values_are_not():
    """In both modes, in a batch, and in second order."""

    def f(x, jumped):
        return without_derivative(jnp.sin(x), jumped)

    for jumped in (False, True):
        expected = [np.nan if jumped else value for value in (np.cos(0.3), -np.sin(0.3))]
        assert f(0.3, jumped) == np.sin(0.3)
        np.testing.assert_allclose(jax.grad(f)(0.3, jumped), expected[0], rtol=1e-15)
        tangent = jax.jvp(f, (0.3, jumped), (1.0, np.zeros((), jax.dtypes.float0)))[1]
        np.testing.assert_allclose(tangent, expected[0], rtol=1e-15)
        np.testing.assert_allclose(jax.hessian(f)(0.3, jumped), expected[1], rtol=1e-15)
    mixed = jax.vmap(jax.grad(f))(jnp.array([0.3, 0.3]), jnp.array([True, False]))
    np.testing.assert_allclose(mixed, [np.nan, np.cos(0.3)], rtol=1e-15)


# ---- runs ---------------------------------------------------------------------------------------


def test_a_run_says_that_a_voltage_jumps():
    """The voltage falls from 30 to 20 kV as the cosine passes the edge: a third of the largest. A kink
    there, or a jump that the sail does not reach, is no jump; a law that compares nothing is not looked
    at."""
    assert simulate(Beam(jump=0.5)).stats["message"].startswith(jump_warning(1.0 / 3.0))
    assert simulate(Beam(slope=0.5)).stats["message"] == ""
    assert simulate(Beam(jump=0.5, edge=2.0)).stats["message"] == ""
    assert simulate(Beam(jump=0.5), {"integrator.t_end": 60.0}).stats["message"] == ""
    assert "33 %" in jump_warning(1.0 / 3.0) and jump_warning(0.0) == ""


@pytest.mark.nightly
@pytest.mark.parametrize("method", ["collocation", "generalized-alpha"])
def test_a_derivative_through_a_jump_is_refused(method):
    """As an error where it can be said, as NaN in a compiled function. Where nothing jumps it is right to
    1e-6, and through a kink, at which no step ends, to 1e-4 at this tolerance."""
    how = {"integrator.tolerance": 1e-11} if method == "collocation" else {"integrator.step": 0.5}
    given = {"integrator.method": method} | how

    def f(spin, law):
        scene = given | {"initial.spin_rate": spin}
        return simulate(law, scene, max_steps=800)["coning_angle"][-1, 0]

    with pytest.raises(SimulationError) as caught:
        jax.grad(f)(SPIN, Beam(jump=0.5))
    assert str(caught.value) == DERIVATIVE
    value, slope = jax.jit(jax.value_and_grad(f))(SPIN, Beam(jump=0.5))
    assert np.isfinite(value) and np.isnan(slope)
    for law in (Beam(slope=0.5), Beam(jump=0.5, edge=2.0)):
        h = 1e-5
        ends = [float(f(SPIN + k * h, law)) for k in (-2, -1, 1, 2)]
        quotient = (8.0 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12.0 * h)
        bound = 3e-4 if law.slope else 1e-6
        np.testing.assert_allclose(jax.grad(f)(SPIN, law), quotient, rtol=bound)


@pytest.mark.nightly
def test_the_jump_is_known_after_the_run_goes_on(tmp_path):
    """A run that went on from a checkpoint after the jump warns as the whole run does. A law that is not
    looked at has no place for it."""
    law, path = Beam(jump=0.5), tmp_path / "run.h5"
    whole = simulate(law, {"integrator.t_end": 120.0})
    run = simulate(law, {"integrator.t_end": 110.0})
    slack = dataclasses.replace(run, stats=run.stats | {"message": "It is computed anew."})
    save(slack, path)
    assert float(run.checkpoint.motion.jump) == pytest.approx(1.0 / 3.0, rel=1e-6)
    read = esail.load(path)
    assert read.stats["message"] == run.stats["message"] != ""
    save(read, tmp_path / "again.h5")
    assert esail.load(tmp_path / "again.h5").stats["message"] == run.stats["message"]
    assert whole.stats["message"] == run.stats["message"]
    assert simulate(Waves()).checkpoint.motion.jump is None
