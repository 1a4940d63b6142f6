"""Direct solver for a bordered system whose chains are also coupled tip to tip, in a ring.

The matrix is that of `bordered` with additional couplings between the last blocks x_i of neighbouring
chains,

    row of tip i:    ... + U_i x_{i+1} + L_i x_{i-1},        i modulo the number of chains p.

The first stage eliminates all unknowns except the tips and the border y, chain by chain: the blocks between
port and tip, then the local unknowns. A ring of blocks remains, with columns A_i and rows B_i of y,

    T_i x_i + U_i x_{i+1} + L_i x_{i-1} + A_i y = r_i,      sum_i B_i x_i + C y = s.

The second stage opens the ring at the first tip, which becomes part of the border. The other tips form a
chain that begins at the first tip, and the coupling that closes the ring leads from the end of this chain
back to it. Both stages solve a chain with two ends (`Span`): its port, and a far end that is coupled to its
last block. The far end is the tip in the first stage and again the first tip in the second stage. The cost
is O(chains * elements).
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float
from esail_jax.numerics import block_tridiagonal as chains
from esail_jax.numerics import bordered
from esail_jax.numerics.bordered import HELD_ROWS, Bordered, Vector
from esail_jax.numerics.small_matrices import inverse, matmul, matvec


class Ring(NamedTuple):
    """Couplings of the tips: upper[i] = U_i, lower[i] = L_i. With one or two chains both refer to the same
    tip and add up."""

    upper: Float[Array, "row row tether"]
    lower: Float[Array, "row row tether"]


class Span(NamedTuple):
    """Factors of a chain between its ends.

    response: the blocks (block, row, end, ...) for unit values of the ends, without load
    far_row:  coupling (row, row, ...) of the far end's row to the last block
    """

    chain: chains.ChainFactors
    response: Array
    far_row: Array


class LocalFactors(NamedTuple):
    """Factors that eliminate the local unknowns z, D z + E (y, x) = ...: D^{-1}, D^{-1} E and F D^{-1}. F z
    is their term in the equations of their edges (y, x), the border and the chain's tip."""

    inverse: Float[Array, "local local tether"]
    from_edges: Float[Array, "local edge tether"]
    to_edges: Float[Array, "edge local tether"]


class RingFactors(NamedTuple):
    """All factors that `solve` needs. border_rows: B_i; corner: inverse in (border, first tip)."""

    interior: Span
    local: LocalFactors
    tips: Span
    border_rows: Float[Array, "border row tether"]
    corner: Float[Array, "corner corner"]


def factor_span(
    blocks: tuple[Array, Array, Array],
    columns: Float[Array, "block row end *batch"],
    port: Float[Array, "row end *batch"],
    far_row: Float[Array, "row row *batch"],
) -> tuple[Span, Array, Array]:
    """Factors a chain (diag, upper, lower) whose ends act on its blocks through `columns` and displace its
    port by `port`. Also returns the chain's terms (row, end, ...) in the rows of its port and its far
    end."""
    chain, schur = chains.factor(*blocks)
    own, carried = jax.vmap(partial(chains.reduce_to_port, chain), 2, (2, 1))(-columns)
    response = jax.vmap(partial(chains.substitute_from_port, chain), (2, 1), 2)(own, port)
    return Span(chain, response, far_row), matmul(schur, port) - carried, matmul(far_row, response[-1])


def solve_span(span: Span, rhs: Float[Array, "block row *batch"]) -> tuple[Array, Array, Array]:
    """Returns the blocks if the ends are at zero, the port's reduced right-hand side, and what the blocks
    subtract from the far end's right-hand side."""
    own, port = chains.reduce_to_port(span.chain, rhs)
    blocks = chains.substitute_from_port(span.chain, own, jnp.zeros_like(port))
    return blocks, port, matvec(span.far_row, blocks[-1])


def factor_interior(matrix: Bordered) -> tuple[Span, Float[Array, "end end tether"]]:
    """Eliminates the blocks 1 ... N-1. Returns their span and the Schur complement in (port, tip)."""
    m, p = matrix.diag.shape[-2:]
    port = jnp.broadcast_to(jnp.eye(m, 2 * m)[:, :, None], (m, 2 * m, p))
    columns = jnp.zeros((matrix.upper.shape[0], m, 2 * m, p)).at[-1, :, m:].set(matrix.upper[-1])
    blocks = matrix.diag[:-1], matrix.upper[:-1], matrix.lower[:-1]
    span, port_row, tip_row = factor_span(blocks, columns, port, matrix.lower[-1])
    return span, jnp.concatenate([port_row, tip_row.at[:, m:].add(matrix.diag[-1])])


def project(matrix: Bordered, schur: Float[Array, "end end tether"]) -> tuple[Array, ...]:
    """Returns `bordered.project` with the tip as the first local unknown. Without a border the border's
    blocks are empty."""
    m, p = matrix.diag.shape[-2:]

    def behind_tip(part, *axes):
        return part if part is None else jnp.pad(part, [(m * (i in axes), 0) for i in range(3)])

    shifted = matrix._replace(
        local=behind_tip(matrix.local, 0, 1),
        local_border=behind_tip(matrix.local_border, 0),
        border_local=behind_tip(matrix.border_local, 1),
    )
    order = np.r_[:HELD_ROWS, m : 2 * m, HELD_ROWS:m]
    local, *rest = bordered.project(shifted, schur[order][:, order])
    if matrix.border is None:
        n = local.shape[0]
        rest = [jnp.zeros((n, 0, p)), jnp.zeros((0, n, p)), jnp.zeros((0, 0))]
    return local, *rest


def factor(matrix: Bordered, ring: Ring) -> RingFactors:
    """Computes the block LU factors of the whole matrix."""
    interior, schur = factor_interior(matrix)
    local, local_border, border_local, border = project(matrix, schur)
    m, n = matrix.diag.shape[1], border.shape[0]

    own = local[m:, m:]
    own_inverse = inverse(own) if own.size else own  # a pinned truss has no local unknowns
    from_edges = matmul(own_inverse, jnp.concatenate([local_border[m:], local[m:, :m]], axis=1))
    to_local = jnp.concatenate([border_local[:, m:], local[:m, m:]])
    change = matmul(to_local, from_edges)
    border_rows = border_local[:, :m] - change[:n, n:]
    tip_rows = jnp.concatenate([local_border[:m], local[:m, :m]], axis=1) - change[n:]

    tip_rows, upper, lower = (jnp.moveaxis(x, -1, 0) for x in (tip_rows, *ring))
    columns = tip_rows.at[:, :, n:].set(0.0).at[-1, :, n:].set(upper[-1])
    blocks = tip_rows[:, :, n:], upper[:-1], lower[1:]
    tips, *first_row = factor_span(blocks, columns, jnp.eye(m, n + m, n), lower[0])
    border_row = jnp.einsum("bmt,tmc->bc", border_rows, tips.response)
    border_row = border_row.at[:, :n].add(border - change[:n, :n].sum(-1))
    corner = bordered.equilibrated_inverse(jnp.concatenate([border_row, sum(first_row)]))
    eliminated = LocalFactors(own_inverse, from_edges, matmul(to_local, own_inverse))
    return RingFactors(interior, eliminated, tips, border_rows, corner)


def solve(matrix: Bordered, factors: RingFactors, rhs: Vector) -> Vector:
    """Returns the solution of matrix x = rhs. Of `matrix` only weights and shapes are read."""
    n, _, p = factors.border_rows.shape
    interior, port, from_tip = solve_span(factors.interior, rhs.blocks[:-1])
    local, border = bordered.port_loads(matrix, port, rhs)
    local = jnp.zeros((0, p)) if local is None else local
    border = jnp.zeros(0) if border is None else border
    from_edges = matvec(factors.local.to_edges, local)

    tip_rhs = rhs.blocks[-1] - from_tip - from_edges[n:]
    tips, first, closing = solve_span(factors.tips, tip_rhs.T)
    border = border - from_edges[:n].sum(1) - jnp.einsum("bmt,tm->b", factors.border_rows, tips)
    corner = factors.corner @ jnp.concatenate([border, first - closing])
    border, tips = corner[:n], (tips + factors.tips.response @ corner).T

    edges = jnp.concatenate([jnp.broadcast_to(border[:, None], (n, p)), tips])
    local = matvec(factors.local.inverse, local) - matvec(factors.local.from_edges, edges)
    present = local if matrix.free else None, border if n else None
    displacement, extra = bordered.port_displacement(matrix, port, *present)
    ends = jnp.concatenate([displacement, tips])
    blocks = interior + (factors.interior.response * ends[None, None]).sum(2)
    return Vector(jnp.concatenate([blocks, tips[None]]), extra, present[1])
