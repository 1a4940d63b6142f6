"""Second derivatives of runs, and derivatives of batches, are those of difference quotients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from support.quick import jit
from support.truss_sail import METHODS, SPIN, angle


def quotient(f):
    """The derivative of a function of the spin rate, of fourth order."""
    h = 4e-5
    y = np.array([float(f(SPIN + k * h)) for k in (-2, -1, 1, 2)])
    return (y[0] - 8 * y[1] + 8 * y[2] - y[3]) / (12 * h)


PAIRS = {
    "jvp of jvp": lambda f: jax.jacfwd(jax.jacfwd(f)),
    "jvp of grad": lambda f: jax.jacfwd(jax.grad(f)),
    "grad of jvp": lambda f: jax.grad(jax.jacfwd(f)),
    "grad of grad": lambda f: jax.grad(jax.grad(f)),
    "batch of Hessians": lambda f: lambda x: jax.vmap(jax.hessian(f))(jnp.array([1.0, 1.1]) * x)[0],
    "jvp of a batch of gradients": lambda f: lambda x: jax.jacfwd(jax.vmap(jax.grad(f)))(x[None])[0, 0],
}
"""Second derivatives of a function of one number."""


@pytest.mark.nightly
@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("method", METHODS)
def test_second_derivatives_of_a_run(method, pair):
    """A second derivative is the quotient of first ones to 1e-6, which is the error of the quotient."""
    f = angle(method)
    slope = jit(jax.jacfwd(f))
    found = float(jit(PAIRS[pair](f))(jnp.asarray(SPIN)))
    assert found == pytest.approx(quotient(slope), rel=1e-6)


@pytest.mark.nightly
@pytest.mark.parametrize("method", METHODS)
def test_first_derivatives_of_a_run(method):
    """The quotient of runs to 1e-6, with which the test above ends at the runs themselves."""
    f = angle(method)
    assert float(jit(jax.jacfwd(f))(SPIN)) == pytest.approx(quotient(jit(f)), rel=1e-6)
