"""The direct solver of a system's iteration matrix: that of `bordered.py`, or of `ring.py` for tethers that
are joined in a ring."""

from esail_jax.numerics import bordered, ring
from esail_jax.numerics.bordered import Bordered, Vector

Factors = bordered.Factors | ring.RingFactors


def factor(matrix: Bordered) -> Factors:
    """The factors of the whole matrix."""
    return bordered.factor(matrix) if matrix.segments is None else ring.factor(matrix)


def solve(matrix: Bordered, factors: Factors, rhs: Vector) -> Vector:
    """The solution of matrix x = rhs. Of `matrix` only weights and shapes are read."""
    if isinstance(factors, ring.RingFactors):
        return ring.solve(matrix, factors, rhs)
    return bordered.solve(matrix, factors, rhs)
