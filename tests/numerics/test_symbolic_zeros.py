"""Tangents that are symbolic zeros: derivatives are right, and a scan is traced once."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from esail_jax.numerics.symbolic_zeros import bundled, jvp_of_perturbed, with_tangents


def oscillation(stiffness, first, counted):
    """Position of an oscillator after 20 steps from rest. `first` prepares the state, whose parts do not
    depend on the stiffness at the start."""

    @jax.custom_jvp
    def pull(stiffness, x):
        return -stiffness * x

    @functools.partial(pull.defjvp, symbolic_zeros=True)
    def _(primals, tangents):
        counted.append(1)
        return jvp_of_perturbed(lambda k, x: -k * x, primals, tangents)

    def step(state, _):
        x, v = state
        v = v + 0.1 * pull(stiffness, x)
        return (x + 0.1 * v, v), None

    return jax.lax.scan(step, first((jnp.ones(()), jnp.zeros(()))), None, length=20)[0][0]


@pytest.mark.parametrize("derivative", [jax.grad, jax.jacfwd])
def test_a_scan_is_differentiated_once(derivative):
    """The derivative is the same with and without tangents at the start; JAX asks for the derivative of the
    body once instead of two or more times."""
    plain, given = [], []
    expected = derivative(lambda k: oscillation(k, lambda s: s, plain))(2.0)
    found = derivative(lambda k: oscillation(k, lambda s: with_tangents(s, k), given))(2.0)
    np.testing.assert_array_equal(found, expected)
    assert len(given) == 1 < len(plain)


def test_infinite_tangents_change_nothing():
    """A tangent of another argument, infinite or not, does not enter the values' tangents."""
    _, moved = jax.jvp(lambda x, of: with_tangents(x, of), (1.0, 2.0), (3.0, jnp.inf))
    assert moved == 3.0
    assert jax.grad(lambda of: with_tangents(1.0, of) * jnp.nan)(2.0) == 0.0


@pytest.mark.parametrize("constant", [0, 1])
def test_a_solve_with_a_constant_right_hand_side_is_transposed(constant):
    """The solve multiplies a right-hand side that depends on x by 3 or 5, and gives the derivative of 3 or
    5 times the sum of x^2. JAX cannot transpose it without the bundle, and JAX 0.11 cannot transpose a
    barrier with a constant operand."""

    def solve(_, rhs):
        return tuple(factor * x for factor, x in zip((3.0, 5.0), rhs, strict=True))

    @jax.custom_jvp
    def total(x):
        return (3.0, 5.0)[1 - constant] * (x**2).sum()

    @total.defjvp
    def _total_jvp(primals, tangents):
        rhs = [2.0 * primals[0] * tangents[0]] * 2
        rhs[constant] = jnp.zeros(3)
        found = lax.custom_linear_solve(lambda x: x, bundled(tuple(rhs)), solve, solve)
        return total(*primals), found[0].sum() + found[1].sum()

    x, factor = jnp.asarray([1.0, 2.0, -4.0]), (3.0, 5.0)[1 - constant]
    assert (jax.grad(total)(x) == 2.0 * factor * x).all()
