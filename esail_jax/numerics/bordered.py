"""Solver for chains that meet at a small border: a sail's tethers and its hub.

Unknowns are the blocks of every chain, per chain a few *local* unknowns at its port, and the shared
*border*. The first three rows of a port block, its position, are held: they move with points of the
border, position = sum_k weight_k point_k, and their equations act on those points (virtual work).
Without a border they do not move at all, or, if the ports are loose, are free like the other rows, a
root slope: local unknowns. The ports of released chains are free, too, each for itself.
Chains are condensed on their ports in O(blocks), local unknowns are eliminated chain by chain, and one
small dense system in the border is left. Absent parts are `None` and cost nothing.
"""

from typing import NamedTuple

import jax.numpy as jnp

from esail_jax.array_types import Array, Bool, Inexact
from esail_jax.numerics import block_tridiagonal as chains
from esail_jax.numerics.small_matrices import inverse, joined, matmul, matvec_transposed, transpose

HELD_ROWS = 3
"""Rows of a port block that the border holds, unless it is loose."""


class Bordered(NamedTuple):
    """The matrix. Axes: row, col within a block; tether last.

    diag, upper, lower: blocks 0 ... N of every chain, block 0 the port (`block_tridiagonal`)
    weights: of the border's points on the held rows; None without a border
    local, local_border, border_local: added to the equations of the free rows, which the local
    unknowns extend at the end (multipliers of a clamped root)
    border: added to the border's equations; its unknowns are the points' coordinates, then others
    loose: () where nothing holds the ports (only without a border), else None
    released: which chains nothing holds, where some may be (their weights must be zero)
    """

    diag: Inexact[Array, "block row row tether"]
    upper: Inexact[Array, "link row row tether"]
    lower: Inexact[Array, "link row row tether"]
    weights: Inexact[Array, "point tether"] | None = None
    local: Inexact[Array, "local local tether"] | None = None
    local_border: Inexact[Array, "local border tether"] | None = None
    border_local: Inexact[Array, "border local tether"] | None = None
    border: Inexact[Array, "border border"] | None = None
    loose: tuple[()] | None = None
    released: Bool[Array, " tether"] | None = None

    @property
    def held(self) -> int:
        """Held rows of a port block."""
        return HELD_ROWS if self.loose is None else 0

    @property
    def free(self) -> int:
        """Free rows of a port block."""
        return self.diag.shape[1] - self.held


class Vector(NamedTuple):
    """Right-hand side or solution.

    blocks: of a right-hand side, all rows; of a solution, block 0 is the port's displacement.
    local: what the local unknowns have beyond the free rows.
    """

    blocks: Inexact[Array, "block row tether"]
    local: Inexact[Array, "local tether"] | None = None
    border: Inexact[Array, " border"] | None = None


class PortFactors(NamedTuple):
    """Elimination of the local unknowns and of the border, given the chains' Schur complements. Each stored
    transposed (see `matvec_transposed`)."""

    local_inverse: Inexact[Array, "local local tether"] | None
    local_from_border: Inexact[Array, "border local tether"] | None
    border_from_local: Inexact[Array, "local tether border"] | None
    border_inverse: Inexact[Array, "border border"] | None
    released_inverse: Inexact[Array, "row row tether"] | None


class Factors(NamedTuple):
    """Everything a solve needs; kept over several time steps."""

    chains: chains.ChainFactors
    port: PortFactors


def padded(a: Array, like: Array | None) -> Array:
    """`a` enlarged by zeros to the shape of `like`, plus `like`; `a` itself if that is absent."""
    if like is None:
        return a
    widths = [(0, n - m) for n, m in zip(like.shape, a.shape, strict=True)]
    return jnp.pad(a, widths) + like


def project(
    matrix: Bordered, schur: Inexact[Array, "row row tether"]
) -> tuple[Array | None, Array | None, Array | None, Array | None]:
    """The ports' Schur complements in the unknowns (local, border): the blocks
    (local, local), (local, border), (border, local), (border, border). Rows beyond the held ones,
    whatever they stand for, are local."""
    held, free, g = slice(None, matrix.held), slice(matrix.held, None), matrix.weights
    free_rows = schur.shape[0] - matrix.held
    local = local_border = border_local = border = None
    if free_rows:
        local = padded(schur[free, free], matrix.local)
    if matrix.border is not None:
        n, others = matrix.border.shape[0], matrix.border.shape[0] - HELD_ROWS * g.shape[0]
        points = jnp.einsum("at,ijt,bt->aibj", g, schur[held, held], g)
        border = padded(points.reshape(n - others, -1), matrix.border)
        if free_rows:
            right = (g[None, :, None] * schur[free, held][:, None]).reshape(free_rows, -1, g.shape[1])
            below = (g[:, None, None] * schur[held, free]).reshape(-1, free_rows, g.shape[1])
            right = jnp.pad(right, ((0, 0), (0, others), (0, 0)))
            below = jnp.pad(below, ((0, others), (0, 0), (0, 0)))
            local_border = padded(right, matrix.local_border)
            border_local = padded(below, matrix.border_local)
    return local, local_border, border_local, border


def equilibrated_inverse(a: Inexact[Array, "n n"]) -> Inexact[Array, "n n"]:
    """Inverse of a symmetric-pattern matrix after scaling rows and columns by 1/sqrt(max |row|):
    hub masses (1e3 kg) and constraint gradients (1) meet in one matrix."""
    scale = 1.0 / jnp.sqrt(jnp.abs(a).max(1))
    return scale[:, None] * jnp.linalg.inv(scale[:, None] * a * scale) * scale


def factor_ports(matrix: Bordered, schur: Inexact[Array, "row row tether"]) -> PortFactors:
    """Eliminate the local unknowns, then invert the border."""
    local, local_border, border_local, border = project(matrix, schur)
    local_inverse = from_border = from_local = border_inverse = released_inverse = None
    if matrix.released is not None:
        released_inverse = transpose(inverse(schur))
    if local is not None:
        local_inverse = inverse(local)
        if border is not None:
            from_border = matmul(local_inverse, local_border)
            border = border - jnp.einsum("alt,lbt->ab", border_local, from_border)
            from_border = transpose(from_border)
            from_local = matmul(border_local, local_inverse).transpose(1, 2, 0)
        local_inverse = transpose(local_inverse)
    if border is not None:
        border_inverse = equilibrated_inverse(border).T
    return PortFactors(local_inverse, from_border, from_local, border_inverse, released_inverse)


def factor(matrix: Bordered) -> Factors:
    """Block LU of the whole matrix."""
    chain_factors, schur = chains.factor(matrix.diag, matrix.upper, matrix.lower)
    return Factors(chain_factors, factor_ports(matrix, schur))


def port_loads(
    matrix: Bordered, port: Inexact[Array, "row tether"], rhs: Vector
) -> tuple[Array | None, Array | None]:
    """Right-hand sides (local, border) from the reduced ones of the ports."""
    local = border = None
    if matrix.free:
        local = port[matrix.held :]
        if rhs.local is not None:
            local = jnp.concatenate([local, rhs.local])
    if matrix.border is not None:
        border = padded((matrix.weights[:, None] * port[None, :HELD_ROWS]).sum(2).reshape(-1), rhs.border)
    return local, border


def port_displacement(
    matrix: Bordered, port: Inexact[Array, "row tether"], local: Array | None, border: Array | None
) -> tuple[Array, Array | None]:
    """Port displacement and extra local unknowns, once (local, border) are known."""
    held = jnp.zeros_like(port[: matrix.held])
    if border is not None:
        points = HELD_ROWS * matrix.weights.shape[0]
        held = (border[:points].reshape(-1, HELD_ROWS)[:, :, None] * matrix.weights[:, None]).sum(0)
    if local is None:
        return held, None
    return joined([held, local[: matrix.free]]), local[matrix.free :]


def solve_ports(
    matrix: Bordered, factors: PortFactors, port: Inexact[Array, "row tether"], rhs: Vector
) -> tuple[Array, Array | None, Array | None]:
    """Port displacement, extra local unknowns and border, from the reduced right-hand sides."""
    local, border = port_loads(matrix, port, rhs)
    if border is not None:
        if local is not None:
            loads = factors.border_from_local.reshape(-1, border.shape[0])
            border = border - matvec_transposed(loads, local.reshape(-1))
        border = matvec_transposed(factors.border_inverse, border)
    if local is not None:
        local = matvec_transposed(factors.local_inverse, local)
        if border is not None:
            shared = jnp.broadcast_to(border[:, None], (len(border), local.shape[1]))
            local = local - matvec_transposed(factors.local_from_border, shared)
    displacement, extra = port_displacement(matrix, port, local, border)
    if matrix.released is not None:
        alone = matvec_transposed(factors.released_inverse, port)
        displacement = jnp.where(matrix.released, alone, displacement)
    return displacement, extra, border


def solve(matrix: Bordered, factors: Factors, rhs: Vector) -> Vector:
    """Solution of matrix x = rhs; of `matrix` only the weights and shapes are read."""
    own, port = chains.reduce_to_port(factors.chains, rhs.blocks)
    displacement, local, border = solve_ports(matrix, factors.port, port, rhs)
    blocks = chains.substitute_from_port(factors.chains, own, displacement)
    return Vector(blocks, local, border)
