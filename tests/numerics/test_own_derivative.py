"""Functions with a derivative of their own keep it in derivatives of derivatives, also inside loops.

The example is a square root whose value is known: x with x^2 = a. As a function it returns that value,
which to JAX is a constant; only its rule knows that x depends on a. Three such roots in a row, of c a with
c the root before, give a itself, so that every derivative of a composition is known in closed form."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from esail_jax.numerics.known_solution import known_solution
from esail_jax.numerics.own_derivative import WholeCall, custom_jvp
from esail_jax.numerics.symbolic_zeros import with_tangent_of


def by(decorator):
    """The root with a known value, made by a decorator."""

    @decorator
    def known(a, x):
        return x

    @functools.partial(known.defjvp, symbolic_zeros=True)
    def _known_jvp(primals, tangents):
        x = known(*primals)
        return x, jnp.zeros(()) + tangents[0] / (2.0 * x)

    return known


def solved(a, x):
    """The root as the solution of an equation."""
    return known_solution(lambda a, x: x**2 - a, lambda a, x, rhs: rhs / (2.0 * x), a, x)


ROOTS = {"decorator": by(custom_jvp), "whole call": by(WholeCall), "solution": solved}


def chain(root, loop):
    """a -> 3 a^2 e^a by way of three roots, the last of which is a again."""

    def step(c, a):
        return root(c * a, lax.stop_gradient(jnp.sqrt(c * a)))

    def f(a):
        if loop == "none":
            c = a
            for _ in range(3):
                c = step(c, a)
        elif loop == "map":
            c = lax.map(lambda c: step(c, a), jnp.stack([a, a]))[1]
        else:
            body = jax.checkpoint(step) if loop == "checkpoint" else step
            c = lax.scan(lambda c, _: (body(c, a), None), a, None, length=3)[0]
        return 3.0 * c**2 * jnp.exp(a)

    return f


ORDERS = {
    "jvp of jvp": lambda f: jax.jacfwd(jax.jacfwd(f)),
    "jvp of grad": lambda f: jax.jacfwd(jax.grad(f)),
    "grad of jvp": lambda f: jax.grad(jax.jacfwd(f)),
    "grad of grad": lambda f: jax.grad(jax.grad(f)),
}


@pytest.mark.parametrize("loop", ["none", "scan", "checkpoint", "map"])
@pytest.mark.parametrize("how", ROOTS)
def test_second_derivatives(how, loop):
    """(3 a^2 e^a)'' = 3 (a^2 + 4 a + 2) e^a to rounding, in every order of the modes, compiled and in a
    batch."""
    f = chain(ROOTS[how], loop)
    a = jnp.asarray([1.3, 0.7])
    expected = 3.0 * (a**2 + 4.0 * a + 2.0) * jnp.exp(a)
    for name, second in ORDERS.items():
        found = jax.jit(jax.vmap(second(f)))(a)
        np.testing.assert_allclose(found, expected, rtol=1e-12, err_msg=name)
    mean = jax.hessian(lambda s: jax.vmap(lambda x: f(s * x))(a).mean())(jnp.ones(()))
    np.testing.assert_allclose(mean, (a**2 * expected).mean(), rtol=1e-12)


def test_third_derivatives():
    """(3 a^2 e^a)''' = 3 (a^2 + 6 a + 6) e^a."""
    f, a = chain(ROOTS["solution"], "none"), jnp.asarray(1.3)
    third = jax.jacfwd(jax.jacrev(jax.jacfwd(f)))(a)
    np.testing.assert_allclose(third, 3.0 * (a**2 + 6.0 * a + 6.0) * jnp.exp(a), rtol=1e-12)


def test_arguments_without_a_tangent_stay_without_one():
    """The rule of a call within the operation sees a symbolic zero, so that it can leave work out."""
    seen = []

    @WholeCall
    def total(x, y):
        return x + y

    @functools.partial(total.defjvp, symbolic_zeros=True)
    def _total_jvp(primals, tangents):
        seen.append([type(t).__name__ for t in tangents])
        return total(*primals), tangents[0]

    jax.jvp(lambda x: total(x, jnp.ones(())), (jnp.ones(()),), (jnp.ones(()),))
    assert seen[-1][1] == "SymbolicZero" and seen[-1][0] != "SymbolicZero"


def test_a_value_with_the_tangent_of_another_has_its_second_derivative():
    def f(a):
        return with_tangent_of(lax.stop_gradient(a**3), a**3) ** 2

    a = jnp.asarray(1.7)
    for second in ORDERS.values():
        np.testing.assert_allclose(second(f)(a), 30.0 * a**4, rtol=1e-14)
