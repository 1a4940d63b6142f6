"""Products of 3-vectors stored component first, any batch behind: shape (3, ...).

Reductions over the short leading axis leave the batch contiguous, which the CPU backend vectorises:
measured 1.6 times faster over a whole force evaluation than component-by-component arithmetic.
"""

import functools

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Float, PerPoint, VectorPerPoint


def dot(a: VectorPerPoint, b: VectorPerPoint) -> PerPoint:
    """Scalar product a . b over the leading axis."""
    return (a * b).sum(0)


@jax.custom_jvp
def reciprocal(x: PerPoint) -> PerPoint:
    """1/x, whose derivatives are products of it: a division costs as much as ten products."""
    return 1.0 / x


@reciprocal.defjvp
def _reciprocal_jvp(primals, tangents):
    y = reciprocal(*primals)
    return y, -(y**2) * tangents[0]


def greatest(x: Float[Array, "first *rest"]) -> Float[Array, "*rest"]:
    """Largest absolute value along the first axis, which must be short. Term by term: the compiler
    vectorises that, but goes through a maximum over everything one by one; and absolute values last, as it
    would take them in a product before it, slowly."""
    return jnp.maximum(functools.reduce(jnp.maximum, x), -functools.reduce(jnp.minimum, x))


def norm(a: VectorPerPoint) -> PerPoint:
    """Euclidean length |a|; its derivative is infinite at a = 0."""
    return root(dot(a, a))


@jax.custom_jvp
def root(x: PerPoint) -> PerPoint:
    """Square root of what is not negative.

    The maximum with zero changes nothing: without it the compiler makes sqrt and the division of its
    derivative one operation, which it then takes three times as long for."""
    return jnp.maximum(jnp.sqrt(x), 0.0)


@root.defjvp
def _root_jvp(primals, tangents):
    y = root(*primals)
    return y, 0.5 * reciprocal(y) * tangents[0]


def stacked(parts: list[Array]) -> Array:
    """Concatenated along the first axis, part by part into one buffer: a concatenation would be compiled
    as one loop over all rows, with the formulas of every part in it again and again."""
    buffer = jnp.zeros((sum(len(part) for part in parts), *parts[0].shape[1:]), parts[0].dtype)
    row = 0
    for part in parts:
        buffer = lax.dynamic_update_slice_in_dim(buffer, part, row, 0)
        row += len(part)
    return buffer
