"""Block LU factorisation of many block-tridiagonal chains at once, in O(blocks).

The blocks of a chain are numbered from its port: block 0 is the port (a tether's root), block N the free
end. Elimination runs from the free end towards the port,

    S_N = D_N,    S_k = D_k - U_k S_{k+1}^{-1} L_k    (k = N-1 ... 0).

S_0 is the Schur complement of the chain on its port, the stiffness that the rest of the structure feels.
`U_k` couples row k to column k+1 and `L_k` row k+1 to column k. Blocks have the axes (row, col, ...); the
last axis counts the chains.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Inexact
from esail_jax.numerics.small_matrices import inverse, joined, matmul, matvec_transposed, transpose

Blocks = Inexact[Array, "block row row *batch"]
Links = Inexact[Array, "link row row *batch"]
BlockVectors = Inexact[Array, "block row *batch"]
LinkVectors = Inexact[Array, "link row *batch"]

UNROLLED_BLOCKS = 8
"""Number of blocks in one iteration of the sweeps' loops. Chains of up to this length run without a loop,
because its overhead is larger than a 6 x 6 product; unrolling a long chain would multiply the compile
time."""


class ChainFactors(NamedTuple):
    """Factors of the blocks 1 ... N, each stored transposed (see `matvec_transposed`).

    inverse:    S_k^{-1}          (k = 1 ... N)
    reduce:     U_{k-1} S_k^{-1}  moves a right-hand side one block towards the port
    substitute: S_k^{-1} L_{k-1}  moves a solution one block away from the port
    """

    inverse: Blocks
    reduce: Blocks
    substitute: Blocks


def factor(diag: Blocks, upper: Links, lower: Links) -> tuple[ChainFactors, Array]:
    """The factors of the blocks 1 ... N and the Schur complement S_0 (row, row, ...) on the
    port."""

    def eliminate(schur, blocks):
        diag_k, upper_k, lower_k = blocks
        inv = inverse(schur)
        reduce = matmul(upper_k, inv)
        step = (transpose(inv), transpose(reduce), transpose(matmul(inv, lower_k)))
        return diag_k - matmul(reduce, lower_k), step

    schur, factors = lax.scan(eliminate, diag[-1], (diag[:-1], upper, lower), reverse=True, unroll=1)
    return ChainFactors(*factors), schur


def reduce_to_port(factors: ChainFactors, rhs: BlockVectors) -> tuple[LinkVectors, Array]:
    """Eliminates the blocks 1 ... N from a right-hand side: the first half of a solution.

    Returns the solution of every block if its neighbour towards the port is zero, and the reduced
    right-hand side of the port."""

    def carry_over(behind, row):
        inverse_k, reduce_k, rhs_k = row
        return rhs_k - matvec_transposed(reduce_k, behind), matvec_transposed(inverse_k, behind)

    rows = (factors.inverse, factors.reduce, rhs[:-1])
    port, own = lax.scan(carry_over, rhs[-1], rows, reverse=True, unroll=UNROLLED_BLOCKS)
    return own, port


def substitute_from_port(
    factors: ChainFactors, own: LinkVectors, port: Inexact[Array, "row *batch"]
) -> BlockVectors:
    """The solution of the blocks 0 ... N for a given solution of the port: the second half.

    own: the solutions that `reduce_to_port` returns."""

    def carry_back(before, row):
        own_k, substitute_k = row
        here = own_k - matvec_transposed(substitute_k, before)
        return here, here

    if len(own) > UNROLLED_BLOCKS:
        _, blocks = lax.scan(carry_back, port, (own, factors.substitute), unroll=UNROLLED_BLOCKS)
        return jnp.concatenate([port[None], blocks])
    blocks = [port]
    for row in zip(own, factors.substitute, strict=True):
        blocks.append(carry_back(blocks[-1], row)[0])
    return joined([block[None] for block in blocks])
