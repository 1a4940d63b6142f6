"""Batches of runs under `jax.vmap`, their derivatives, derivatives at rest, and failures of derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.errors import SimulationError
from support.quick import jit, quickly
from support.truss_sail import SAIL, SPIN, angle

coning = angle()


@pytest.mark.nightly
@pytest.mark.parametrize("how", quickly(["program", "traced"]))
def test_the_gradient_of_a_batch_is_that_of_its_members(how):
    """The gradient of a mean over `jax.vmap` is the mean of single gradients, to 1e-9: with kept programs
    outside of `jax.jit`, and as part of a traced program."""
    shares = jnp.array([1.0, 0.9])

    def mean(spin):
        return jax.vmap(lambda share: coning(spin * share))(shares).mean()

    compiled = jit(jax.grad(coning))
    expected = np.mean([s * float(compiled(SPIN * s)) for s in shares])
    found = jax.grad(mean)(SPIN) if how == "program" else jit(jax.grad(mean))(SPIN)
    assert float(found) == pytest.approx(expected, rel=1e-9)


@pytest.mark.nightly
def test_a_batch_has_the_rows_of_its_members():
    """On a CPU `jax.vmap` computes one member after the other. Other options of the compiler have other
    rounding, 2e-12."""
    spins = jnp.array([3e-3, 4e-3, 5e-3])
    one_by_one = jax.lax.map(coning, spins)
    np.testing.assert_allclose(jax.vmap(coning)(spins), one_by_one, rtol=1e-10)


@pytest.mark.nightly
def test_a_derivative_without_room_for_its_steps_says_so():
    """Outside of `jax.jit` the derivative of a run that fails raises what the run would raise."""
    long = SAIL | {"integrator.t_end": 8000.0, "output.interval": 4000.0, "integrator.tolerance": 1e-12}

    def f(spin):
        return esail.simulate("baseline", long | {"initial.spin_rate": spin}, max_steps=50)["coning_angle"][
            -1, 0
        ]

    with pytest.raises(SimulationError, match="needs more steps than `max_steps` allows"):
        jax.jvp(f, (SPIN,), (1.0,))


@pytest.mark.nightly
def test_debugging_of_nan_lets_healthy_runs_pass():
    """Places of buffers that no instant has reached are NaN on purpose."""
    with jax.debug_nans(True):
        assert np.isfinite(esail.simulate("baseline", SAIL)["coning_angle"]).all()


@pytest.mark.nightly
@pytest.mark.parametrize("spin", [0.0, 1e-12, 1e-9])
def test_reverse_mode_at_rest_is_forward_mode(spin):
    """A truss that is not stretched by spin has a singular matrix at its free end, which nothing needs."""
    forward, reverse = (float(jit(mode(coning))(spin)) for mode in (jax.jacfwd, jax.grad))
    assert reverse == pytest.approx(forward, rel=1e-8, abs=1e-12)
