"""A user's law that jumps is said: the run warns, and a derivative is refused.

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
from esail_jax.ensembles import simulate_members
from esail_jax.errors import SimulationError
from esail_jax.files.run_file import save
from esail_jax.simulation.law_jumps import (
    DERIVATIVE,
    JUMPS,
    jump_warning,
    jump_within,
    without_derivative,
)
from support.own_laws import SAIL

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


# ---- what a jump is -----------------------------------------------------------------------------


def sign(x):
    return x / jnp.abs(x)


VOLTS = {
    "a jump": (lambda t: jnp.where(t > 0.4, 2.0, 1.0), 0.5),
    "in the first part": (lambda t: jnp.where(t > 0.01, 2.0, 1.0), 0.5),
    "in the second part": (lambda t: jnp.where(t > 0.13, 2.0, 1.0), 0.5),
    "in the last part": (lambda t: jnp.where(t > 0.99, 2.0, 1.0), 0.5),
    "down": (lambda t: jnp.where(t > 0.4, 0.0, 1.0), 1.0),
    "there and back": (lambda t: jnp.where(abs(t - 0.5) < 0.1, 4.0, 1.0), 0.75),
    "by a quotient": (lambda t: 3.0 + sign(t - 0.437), 0.5),
    "beside a straight line": (lambda t: t + jnp.where(t > 0.4, 1.0, 0.0), 0.5),
    "a small one beside a wave": (lambda t: jnp.cos(0.1 * t) + jnp.where(t > 0.7, 1e-4, 0.0), 1e-4),
    "stairs": (lambda t: 1.0 + jnp.round(37.3 * t) / 4000.0, 2.5e-4 / 1.00925),
    "half precision": (lambda t: lax.reduce_precision(1.0 + 0.9 * t**2, 5, 10), 2.0**-10 / 1.9),
    "a transition of 1e-9": (lambda t: 2.0 + jnp.tanh(1e9 * (t - 0.437)), 2.0 / 3.0),
    "constant": (lambda t: 3.0 + 0.0 * t, 0.0),
    "zero": (lambda t: 0.0 * t, 0.0),
    "a straight line": (lambda t: 1.0 + t, 0.0),
    "a wave": (lambda t: jnp.sin(0.3 * t + 0.2), 0.0),
    "half a wave": (lambda t: jnp.sin(3.1 * t), 0.0),
    "a quartic": (lambda t: (2.0 * t - 1.0) ** 4, 0.0),
    "an exponential function": (lambda t: jnp.exp(8.0 * t), 0.0),
    "a transition that steps resolve": (lambda t: 2.0 + jnp.tanh(5.0 * (t - 0.47)), 0.0),
    "a kink": (lambda t: jnp.maximum(t, 0.437), 0.0),
    "a kink in the last part": (lambda t: 20e3 + 600.0 * jnp.maximum(t - 0.95, 0.0), 0.0),
    "a short ramp": (lambda t: 1.0 + jnp.clip(10.0 * (t - 0.43), 0.0, 1.0), 0.0),
    "single precision": (lambda t: (1.0 + t).astype(jnp.float32).astype(float), 0.0),
    "infinite": (lambda t: jnp.inf + t, 0.0),
}


@pytest.mark.parametrize("name", VOLTS)
def test_a_jump_is_a_change_that_is_left_in_the_smallest_part_of_a_step(name):
    """However small, relative to the largest voltage; in one of several tethers, for either sign, and late
    in a long run. Kinks and steep transitions, which shrink with the part, are none. Neither are the
    roundings of single precision, 6e-8."""
    law, expected = VOLTS[name]

    @jax.jit
    def found(sign, begin):
        return jump_within(
            lambda t: jnp.stack([0.0 * law(t - begin), sign * law(t - begin)]), begin, jnp.ones(())
        )

    for sign, begin in ((1.0, 0.0), (-1.0, 0.0), (1.0, 2.0**20)):
        np.testing.assert_allclose(found(sign, begin), expected, rtol=1e-3)


def test_a_jump_at_a_knot_does_not_count():
    """Steps end there: the jump is just behind the begin of a step. Another one in the same step counts,
    and next to the knot it does not."""

    @jax.jit
    def found(knot, place):
        def law(t):
            return 1.0 + jnp.where(t < knot, 0.0, 1.0) + jnp.where(t < place, 0.0, 0.5)

        return jump_within(lambda t: law(t)[None], jnp.asarray(5.0), jnp.ones(()), knot[None])

    for knot in (5.0 + 6e-12, 5.4, 6.0):
        assert found(knot, 9.0) == 0.0
    np.testing.assert_allclose(found(5.0 + 6e-12, 5.7), 0.2, rtol=1e-12)


def test_derivatives_after_a_jump_are_undefined_and_values_are_not():
    """In both modes, in a batch, and in second order."""

    def f(x, jumped):
        return without_derivative(jnp.sin(x), jumped)

    for jumped in map(jnp.asarray, (False, True)):
        expected = [np.nan if jumped else value for value in (np.cos(0.3), -np.sin(0.3))]
        assert f(0.3, jumped) == np.sin(0.3)
        np.testing.assert_allclose(jax.grad(f)(0.3, jumped), expected[0], rtol=1e-15)
        tangent = jax.jvp(f, (0.3, jumped), (1.0, np.zeros((), jax.dtypes.float0)))[1]
        np.testing.assert_allclose(tangent, expected[0], rtol=1e-15)
        np.testing.assert_allclose(jax.hessian(f)(0.3, jumped), expected[1], rtol=1e-15)
    mixed = jax.vmap(jax.grad(f))(jnp.array([0.3, 0.3]), jnp.array([True, False]))
    np.testing.assert_allclose(mixed, [np.nan, np.cos(0.3)], rtol=1e-15)


# ---- runs ---------------------------------------------------------------------------------------


@pytest.mark.nightly
def test_a_run_says_that_a_law_jumps():
    """The voltage falls from 30 to 20 kV as the cosine passes the edge: a third of the largest. A kink
    there, or a jump that the sail does not reach, is no jump. Members of an ensemble say it, too."""
    assert simulate(Beam(jump=0.5)).stats["message"].startswith(jump_warning(1.0 / 3.0))
    assert simulate(Beam(slope=0.5)).stats["message"] == ""
    assert simulate(Beam(jump=0.5, edge=2.0)).stats["message"] == ""
    assert simulate(Beam(jump=0.5), {"integrator.t_end": 60.0}).stats["message"] == ""
    assert "33 %" in jump_warning(1.0 / 3.0) and jump_warning(0.0) == ""
    each = {"voltage_law": Beam(jump=0.5), "integrator.t_end": 80.0}
    found = simulate_members(
        esail.load_scene("baseline", SAIL | each), {"initial.spin_rate": np.array([4e-3, 2e-3])}
    )
    assert found.messages == (JUMPS, "")


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

    for mode in (jax.grad(f), lambda x, law: jax.jvp(lambda x: f(x, law), (x,), (1.0,))):
        with pytest.raises(SimulationError) as caught:
            mode(SPIN, Beam(jump=0.5))
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
    """A run that went on from a checkpoint after the jump warns as the whole run does. Laws of the package
    have no place for it."""
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
    assert esail.simulate("baseline", SAIL | {"integrator.t_end": 10.0}).checkpoint.motion.jump is None
