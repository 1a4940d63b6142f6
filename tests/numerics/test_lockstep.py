"""Conditions in derivative rules that are batched."""

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.numerics.lockstep import cond_of_members


@jax.custom_jvp
def root_or_nothing(x):
    """The square root, and zero for negative numbers."""
    return jnp.sqrt(jnp.maximum(x, 0.0))


@root_or_nothing.defjvp
def _root_or_nothing_jvp(primals, tangents):
    (x,), (d,) = primals, tangents

    def slope(x, d):
        return 0.5 * d / jnp.sqrt(jnp.maximum(x, 1e-3))

    return root_or_nothing(x), cond_of_members(x > 0.0, slope, lambda _, d: 0.0 * d, x, d)


def test_gradient_of_a_batch_with_a_condition_in_a_rule():
    """Members with and without the branch, in both orders of `grad` and `vmap`, in a loop, and one alone.
    With `lax.cond` the gradient of the batch ends in an error of JAX."""
    x = jnp.array([4.0, -1.0, 0.25])
    slopes = [0.25, 0.0, 1.0]

    def in_loop(x):
        return lax.scan(lambda total, _: (total + root_or_nothing(x), None), 0.0 * x, None, length=1)[0]

    for f in (root_or_nothing, in_loop):
        assert jax.jit(jax.grad(lambda x, f=f: jax.vmap(f)(x).sum()))(x).tolist() == slopes
        assert jax.jit(jax.vmap(jax.grad(f)))(x).tolist() == slopes
        assert jax.jit(jax.jacfwd(lambda x, f=f: jax.vmap(f)(x).sum()))(x).tolist() == slopes
        assert [float(jax.jit(jax.grad(f))(y)) for y in x] == slopes
