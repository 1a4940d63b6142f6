"""Algebra of many small matrices at once: shape (rows, columns, ...) with the batch last.

The batch (the tethers) is the contiguous axis, so that every operation is one vectorised pass over it.
LAPACK would be called once per matrix. There is no pivoting: the callers' matrices are dominated by mass or
arranged so that their leading blocks are regular; the callers state the scaled condition numbers.
"""

import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Inexact

UNROLLED_TERMS = 6
"""Largest number of terms that XLA writes out as one sum, without a loop."""

Matrices = Inexact[Array, "row col *batch"]
Vectors = Inexact[Array, "row *batch"]


def matmul(
    a: Inexact[Array, "row mid *batch"], b: Inexact[Array | np.ndarray, "mid col *batch"]
) -> Matrices:
    """The product of each pair of matrices. It also serves single pairs as small as the hub's, for
    which a call of the matrix library would take longer."""
    return (a[:, :, None] * b[None]).sum(1)


def matvec(a: Inexact[Array, "row col *batch"], x: Inexact[Array, "col *batch"]) -> Vectors:
    """The product of each matrix and its vector."""
    return (a * x[None]).sum(1)


def matvec_transposed(a: Inexact[Array, "col row *batch"], x: Inexact[Array, "col *batch"]) -> Vectors:
    """The product of each transposed matrix and its vector.

    The sum runs over the leading axis, which is the fast one; factors are stored transposed for this
    reason. It is computed in parts of a few rows, because XLA writes out only short sums, and vectorises
    those over the batch."""
    parts = [
        (a[k : k + UNROLLED_TERMS] * x[k : k + UNROLLED_TERMS, None]).sum(0)
        for k in range(0, len(a), UNROLLED_TERMS)
    ]
    return sum(parts[1:], parts[0])


def joined(parts: list[Inexact[Array, "_ *batch"]]) -> Inexact[Array, "_ *batch"]:
    """Concatenates arrays along the first axis, as flat arrays: otherwise XLA puts the formulas of every
    part into one loop over all rows."""
    flat = jnp.concatenate([part.reshape(-1) for part in parts])
    return flat.reshape(-1, *parts[0].shape[1:])


def transpose(a: Inexact[Array, "row col *batch"]) -> Inexact[Array, "col row *batch"]:
    """The transpose of each matrix."""
    return jnp.swapaxes(a, 0, 1)


def inverse(a: Inexact[Array, "row row *batch"]) -> Inexact[Array, "row row *batch"]:
    """The inverse of each matrix, by closed forms up to 3 x 3 and by Gauss-Jordan elimination
    above.

    There is no pivoting: the leading principal submatrices of a larger matrix must be regular.
    """
    n = a.shape[0]
    if n == 1:
        return 1.0 / a
    if n == 2:
        det = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
        rows = [[a[1, 1], -a[0, 1]], [-a[1, 0], a[0, 0]]]
        return jnp.stack([jnp.stack(row) for row in rows]) / det
    if n == 3:
        columns = (a[:, 0], a[:, 1], a[:, 2])
        crosses = [jnp.cross(columns[(i + 1) % 3], columns[(i + 2) % 3], axis=0) for i in range(3)]
        det = (columns[0] * crosses[0]).sum(0)
        return jnp.stack(crosses) / det

    def eliminate(k, a):
        row, column = (lax.dynamic_index_in_dim(a, k, axis, keepdims=False) for axis in (0, 1))
        here = (jnp.arange(n) == k).reshape(n, *(1,) * (a.ndim - 2))
        row = jnp.where(here, 1.0, row) / lax.dynamic_index_in_dim(row, k, 0, keepdims=False)
        others = jnp.where(here[:, None] | here[None], 0.0, a)
        return others + jnp.where(here, 1.0, -column)[:, None] * row[None]

    # The loop is not unrolled: at this size it is as fast, and takes a third of the compile time.
    return lax.fori_loop(0, n, eliminate, a)
