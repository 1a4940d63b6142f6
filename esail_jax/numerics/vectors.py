"""Products of 3-vectors stored component first, any batch behind: shape (3, ...).

Reductions over the short leading axis leave the batch contiguous, which the CPU backend vectorises:
measured 1.6 times faster over a whole force evaluation than component-by-component arithmetic.
"""

import jax.numpy as jnp

from esail_jax.array_types import PerPoint, VectorPerPoint


def dot(a: VectorPerPoint, b: VectorPerPoint) -> PerPoint:
    """Scalar product a . b over the leading axis."""
    return (a * b).sum(0)


def norm(a: VectorPerPoint) -> PerPoint:
    """Euclidean length |a|; its derivative is infinite at a = 0."""
    return jnp.sqrt(dot(a, a))
