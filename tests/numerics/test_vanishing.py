"""Terms whose values and first derivatives are zero have second derivatives, however these are composed,
and cost first derivatives nothing."""

import jax
import jax.numpy as jnp
import pytest
from jax import lax

from esail_jax.compilation.kept import KEEPER
from esail_jax.numerics.vanishing import half_product, half_square, vanishing

SECOND = {
    "jvp of jvp": lambda f: jax.jacfwd(jax.jacfwd(f)),
    "jvp of grad": lambda f: jax.jacfwd(jax.grad(f)),
    "grad of jvp": lambda f: jax.grad(jax.jacfwd(f)),
    "grad of grad": lambda f: jax.grad(jax.grad(f)),
    "batch of Hessians": lambda f: lambda x: jax.vmap(jax.hessian(f))(jnp.stack([x, 2.0 * x]))[0],
    "jvp of a batch": lambda f: lambda x: jax.jacfwd(jax.vmap(jax.grad(f)))(x[None])[0, 0],
}


def without_value(x):
    """sin x as a number that is zero, with the derivative of sin x."""
    return jnp.sin(x) - lax.stop_gradient(jnp.sin(x))


def in_a_loop(traced=None):
    """A new function of x: the sum of three terms, s^2/2 (1 + 1/2 + 1/4) with s = sin x at 0, beside sin x
    itself. traced: a list that gets an entry whenever the terms are traced."""

    @vanishing(lambda x, c: x)
    def term(x, c):
        if traced is not None:
            traced.append(x)
        return half_square(without_value(x), c)

    @jax.checkpoint
    def add(total, row):
        x, c = row
        return total + term(x, c), None

    def total(x):
        rows = jnp.full(3, x), jnp.array([1.0, 2.0, 4.0])
        return lax.scan(add, jnp.sin(x), rows)[0]

    return total


@pytest.mark.parametrize("compose", SECOND)
def test_second_derivative_of_a_term_without_value(compose):
    """d^2/dx^2 of s^2/(2 c) with s = 0 is s'^2/c: 1.75 cos^2 x, less sin x of the term beside it. To
    rounding; also under `jit`."""
    x = jnp.asarray(0.3)
    exact = 1.75 * jnp.cos(x) ** 2 - jnp.sin(x)
    for how in (lambda f: f, jax.jit):
        assert float(how(SECOND[compose](in_a_loop()))(x)) == pytest.approx(float(exact), rel=1e-14)


ORDERS = [(a, b) for a in (jax.jacfwd, jax.jacrev) for b in (jax.jacfwd, jax.jacrev)]


@pytest.mark.parametrize("outer, inner", ORDERS, ids=lambda x: x.__name__)
def test_hessian_of_terms_of_several_numbers(outer, inner):
    """With y = M z and w . y^2/2 the Hessian is M^T diag(w) M: a linear map that is not its own
    transpose."""
    m, w = jnp.array([[1.0, 2.0], [0.5, -1.0], [3.0, 0.0]]), jnp.array([1.0, 2.0, -1.0])

    @vanishing(lambda z: w)
    def terms(z):
        moved = z - lax.stop_gradient(z)
        return half_square(m @ moved, jnp.ones(3))

    found = outer(inner(lambda z: w @ terms(z)))(jnp.array([0.3, 0.7]))
    assert jnp.allclose(found, m.T @ (w[:, None] * m), rtol=1e-14)


@pytest.mark.parametrize("first", [jax.grad, jax.jacfwd], ids=["reverse", "forward"])
def test_first_derivatives_neither_have_nor_trace_the_term(first, monkeypatch):
    """The value is sin x, the first derivative cos x, and the term's own derivative is not traced. Without
    the operation it would be."""
    monkeypatch.delenv(KEEPER.switch, raising=False)
    traced = []
    f = in_a_loop(traced)
    assert float(jax.jit(f)(0.3)) == float(jnp.sin(0.3))
    assert float(jax.jit(first(f))(0.3)) == pytest.approx(float(jnp.cos(0.3)), rel=1e-15)
    assert not traced
    assert jnp.isfinite(jax.jit(jax.jacfwd(first(f)))(0.3))
    assert traced


def test_third_derivatives_are_refused():
    """What stands in place of a kink is known to second order: beyond it is NaN, not a number."""
    third = jax.jacfwd(jax.jacfwd(jax.grad(in_a_loop())))
    assert jnp.isnan(third(jnp.asarray(0.3)))


def test_half_of_a_product():
    """The second derivatives of x y/2 at x = y = 0 are 0, 1/2 and 0."""
    hessian = jax.hessian(lambda z: half_product(z[0], z[1]))(jnp.zeros(2))
    assert hessian.tolist() == [[0.0, 0.5], [0.5, 0.0]]


def test_a_term_without_a_kink_is_zero():
    """A jump of zero is no kink, and gives no infinite derivative."""
    assert float(jax.hessian(lambda x: half_square(x, jnp.zeros(())))(jnp.asarray(0.0))) == 0.0
