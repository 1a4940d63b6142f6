"""Algebra of many small matrices at once: shape (rows, columns, ...) with the batch last.

The batch (the tethers) is the contiguous axis, so every operation is one vectorised sweep over it.
LAPACK would be called once per matrix. No pivoting: the callers' matrices are mass-dominated or
arranged so that leading blocks are regular; their scaled condition numbers are documented there.
"""

import jax.numpy as jnp

from esail_jax.array_types import Array, Inexact

Matrices = Inexact[Array, "row col *batch"]
Vectors = Inexact[Array, "row *batch"]


def matmul(a: Inexact[Array, "row mid *batch"], b: Inexact[Array, "mid col *batch"]) -> Matrices:
    """Product of each pair of matrices."""
    return (a[:, :, None] * b[None]).sum(1)


def matvec(a: Inexact[Array, "row col *batch"], x: Inexact[Array, "col *batch"]) -> Vectors:
    """Each matrix times its vector."""
    return (a * x[None]).sum(1)


def matvec_transposed(a: Inexact[Array, "col row *batch"], x: Inexact[Array, "col *batch"]) -> Vectors:
    """Each transposed matrix times its vector: the reduction runs over the leading axis, which is
    the fast one; kept factors are stored transposed for it."""
    return (a * x[:, None]).sum(0)


def transpose(a: Inexact[Array, "row col *batch"]) -> Inexact[Array, "col row *batch"]:
    """Each matrix transposed."""
    return jnp.swapaxes(a, 0, 1)


def inverse(a: Inexact[Array, "row row *batch"]) -> Inexact[Array, "row row *batch"]:
    """Inverse of each matrix, by closed forms up to 3 x 3 and by Schur complements above.

    The leading half of a larger matrix must be regular itself.
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
        rows = [jnp.cross(columns[(i + 1) % 3], columns[(i + 2) % 3], axis=0) for i in range(3)]
        det = (columns[0] * rows[0]).sum(0)
        return jnp.stack(rows) / det
    k = 3 if n <= 6 else n // 2
    p, q, r, s = a[:k, :k], a[:k, k:], a[k:, :k], a[k:, k:]
    p_inv = inverse(p)
    r_p = matmul(r, p_inv)
    schur = inverse(s - matmul(r_p, q))
    p_q = matmul(p_inv, q)
    upper_right = -matmul(p_q, schur)
    lower_left = -matmul(schur, r_p)
    upper_left = p_inv - matmul(upper_right, r_p)
    return jnp.concatenate(
        [
            jnp.concatenate([upper_left, upper_right], axis=1),
            jnp.concatenate([lower_left, schur], axis=1),
        ]
    )
