"""Direct solver for bordered block-tridiagonal systems: chains that share a border, as tethers share a hub.

The unknowns are the blocks of every chain, a few *local* unknowns at each chain's port, and the *border*,
which all chains share. The first three rows of a port block, its position, are held: the position is
sum_k weight_k point_k over points of the border, and the equations of these rows act on the points (virtual
work). Without a border the held rows are fixed. The other rows of a port block, a root slope, are free:
they are local unknowns. If the ports are loose (only without a border), all rows are free; the port of a
released chain is free, too.

A chain may also have one unknown that couples to all of its blocks, its *length*. It is condensed on the
port like the blocks, and then one of the free rows there.

The chains are condensed on their ports in O(blocks), the local unknowns are eliminated chain by chain, and
a small dense system in the border remains. Absent parts are `None` and cost nothing. Chains whose last
blocks are joined by a ring of segments are solved in `ring.py`; `factor` and `solve` here are without
segments.
"""

from typing import NamedTuple

import jax.numpy as jnp

from esail_jax.array_types import Array, Bool, Inexact, Maybe
from esail_jax.numerics import block_tridiagonal as chains
from esail_jax.numerics.segments import Segments
from esail_jax.numerics.small_matrices import inverse, joined, matmul, matvec_transposed, transpose

HELD_ROWS = 3
"""Number of rows of a port block that the border holds, unless the ports are loose."""


class LengthRows(NamedTuple):
    """The length of every chain in the matrix. column: its coefficients in the rows of all blocks; row:
    those of all blocks in its own row; corner: its own in its own row."""

    column: Inexact[Array, "block row tether"]
    row: Inexact[Array, "block row tether"]
    corner: Inexact[Array, " tether"]


class Bordered(NamedTuple):
    """The matrix. Axes: row, col within a block; tether last.

    diag, upper, lower: blocks 0 ... N of every chain, block 0 the port (`block_tridiagonal`)
    weights: weights of the border's points in the positions of the ports; None without a border
    local, local_border, border_local: added to the equations of the free rows and of the local unknowns,
    which follow the free rows (multipliers of a clamped root)
    border: added to the border's equations; its unknowns are the points' coordinates, then others
    loose: () if nothing holds the ports (only without a border), else None
    released: tells which chains are released, if chains can be; their weights must be zero
    segments: segment i joins the last blocks of chain i and of the next one, in a ring
    lengths: lengths of the chains as unknowns; not with local unknowns or a ring
    """

    diag: Inexact[Array, "block row row tether"]
    upper: Inexact[Array, "link row row tether"]
    lower: Inexact[Array, "link row row tether"]
    weights: Maybe[Inexact[Array, "point tether"]] = None
    local: Maybe[Inexact[Array, "local local tether"]] = None
    local_border: Maybe[Inexact[Array, "local border tether"]] = None
    border_local: Maybe[Inexact[Array, "border local tether"]] = None
    border: Maybe[Inexact[Array, "border border"]] = None
    loose: Maybe[tuple[()]] = None
    released: Maybe[Bool[Array, " tether"]] = None
    segments: Maybe[Segments] = None
    lengths: Maybe[LengthRows] = None

    @property
    def held(self) -> int:
        """Number of held rows of a port block."""
        return HELD_ROWS if self.loose is None else 0

    @property
    def free(self) -> int:
        """Number of free rows of a port block, with that of a length."""
        return self.diag.shape[1] - self.held + (self.lengths is not None)


class Vector(NamedTuple):
    """Right-hand side or solution of the system.

    blocks: all rows of all chains; block 0 of a solution is the port's displacement
    local: rows of the local unknowns other than the free rows
    border: rows of the border
    ring: rows of the ring's segments; those of their ends are zero, as they belong to the chains
    lengths: rows of the lengths
    """

    blocks: Inexact[Array, "block row tether"]
    local: Maybe[Inexact[Array, "local tether"]] = None
    border: Maybe[Inexact[Array, " border"]] = None
    ring: Maybe[Inexact[Array, "block row segment"]] = None
    lengths: Maybe[Inexact[Array, " tether"]] = None


class PortFactors(NamedTuple):
    """Factors that eliminate the local unknowns and the border, once the chains are condensed. Each is
    stored transposed (see `matvec_transposed`)."""

    local_inverse: Maybe[Inexact[Array, "local local tether"]]
    local_from_border: Maybe[Inexact[Array, "border local tether"]]
    border_from_local: Maybe[Inexact[Array, "local tether border"]]
    border_inverse: Maybe[Inexact[Array, "border border"]]
    released_inverse: Maybe[Inexact[Array, "row row tether"]]


class LengthFactors(NamedTuple):
    """Factors that condense the lengths on the ports.

    along: what `reduce_to_port` leaves of `column` in the blocks 1 ... N. weights: A^-T row, with the
    matrix A of these blocks: the row of the length then has weights . rhs less on its right."""

    along: Inexact[Array, "link row tether"]
    weights: Inexact[Array, "link row tether"]


class Factors(NamedTuple):
    """All factors that `solve` needs. A stepper uses them over several time steps."""

    chains: chains.ChainFactors
    port: PortFactors
    lengths: Maybe[LengthFactors] = None


def padded(a: Array, like: Array | None) -> Array:
    """The sum of `like` and of `a`, padded with zeros to its shape; `a` if `like` is None."""
    if like is None:
        return a
    widths = [(0, n - m) for n, m in zip(like.shape, a.shape, strict=True)]
    return jnp.pad(a, widths) + like


def project(
    matrix: Bordered, schur: Inexact[Array, "row row tether"]
) -> tuple[Maybe[Array], Maybe[Array], Maybe[Array], Maybe[Array]]:
    """Transforms the ports' Schur complements to the unknowns (local, border).

    Returns the blocks (local, local), (local, border), (border, local), (border, border). All rows after
    the held ones are local."""
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
    """The inverse of a matrix with symmetric pattern, computed with rows and columns scaled by
    1/sqrt(max |row|): the matrix contains both hub masses (1e3 kg) and constraint gradients (1)."""
    scale = 1.0 / jnp.sqrt(jnp.abs(a).max(1))
    return scale[:, None] * jnp.linalg.inv(scale[:, None] * a * scale) * scale


def factor_ports(matrix: Bordered, schur: Inexact[Array, "row row tether"]) -> PortFactors:
    """Eliminates the local unknowns and inverts the dense matrix of the border."""
    factors, border = eliminate_ports(matrix, schur)
    if border is not None:
        factors = factors._replace(border_inverse=equilibrated_inverse(border).T)
    return factors


def eliminate_ports(
    matrix: Bordered, schur: Inexact[Array, "row row tether"]
) -> tuple[PortFactors, Inexact[Array, "border border"] | None]:
    """Eliminates the local unknowns. Returns their factors and the matrix of the border that is left."""
    local, local_border, border_local, border = project(matrix, schur)
    local_inverse = from_border = from_local = released_inverse = None
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
    return PortFactors(local_inverse, from_border, from_local, None, released_inverse), border


def factor(matrix: Bordered) -> Factors:
    """Computes the block LU factors of the whole matrix."""
    chain_factors, schur = chains.factor(matrix.diag, matrix.upper, matrix.lower)
    lengths = None
    if matrix.lengths is not None:
        lengths, schur = condense_lengths(matrix.lengths, chain_factors, schur)
    return Factors(chain_factors, factor_ports(matrix, schur), lengths)


def condense_lengths(
    rows: LengthRows, factors: chains.ChainFactors, schur: Inexact[Array, "row row tether"]
) -> tuple[LengthFactors, Inexact[Array, "port port tether"]]:
    """Condenses the lengths on the ports: their factors, and the Schur complements with one more row and
    column."""
    along, column = chains.reduce_to_port(factors, rows.column)
    turned = transposed_chains(factors)
    own, row = chains.reduce_to_port(turned, rows.row)
    weights = chains.substitute_from_port(turned, own, jnp.zeros_like(row))[1:]
    corner = rows.corner - (weights * rows.column[1:]).sum((0, 1))
    wide = jnp.concatenate([schur, column[:, None]], axis=1)
    below = jnp.concatenate([row, corner[None]])[None]
    return LengthFactors(along, weights), jnp.concatenate([wide, below])


def transposed_chains(factors: chains.ChainFactors) -> chains.ChainFactors:
    """The factors of the transposed chains: S_k^T, and L and U change places."""
    given = factors.inverse, factors.substitute, factors.reduce
    return chains.ChainFactors(*(jnp.swapaxes(x, 1, 2) for x in given))


def port_loads(
    matrix: Bordered, port: Inexact[Array, "row tether"], rhs: Vector
) -> tuple[Array | None, Array | None]:
    """The right-hand sides (local, border) from the reduced right-hand sides of the ports."""
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
    """The ports' displacements and the other local unknowns from the solution (local, border)."""
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
    """The ports' displacements, the other local unknowns and the border from the reduced right-hand
    sides."""
    local, border = port_loads(matrix, port, rhs)
    if border is not None:
        border = matvec_transposed(factors.border_inverse, without_local(factors, local, border))
    if local is not None:
        local = matvec_transposed(factors.local_inverse, local)
    return moved_by_border(matrix, factors, port, local, border)


def without_local(
    factors: PortFactors, local: Inexact[Array, "local tether"] | None, border: Inexact[Array, " border"]
) -> Inexact[Array, " border"]:
    """The border's right-hand side after the elimination of the local unknowns. local: their
    right-hand side."""
    if local is None:
        return border
    loads = factors.border_from_local.reshape(-1, border.shape[0])
    return border - matvec_transposed(loads, local.reshape(-1))


def moved_by_border(
    matrix: Bordered,
    factors: PortFactors,
    port: Inexact[Array, "row tether"],
    local: Inexact[Array, "local tether"] | None,
    border: Inexact[Array, " border"] | None,
) -> tuple[Array, Array | None, Array | None]:
    """The ports' displacements, the other local unknowns and the border for the solution `border`.

    port: the reduced right-hand sides. local: the local unknowns if the border does not move."""
    if local is not None and border is not None:
        shared = jnp.broadcast_to(border[:, None], (len(border), local.shape[1]))
        local = local - matvec_transposed(factors.local_from_border, shared)
    displacement, extra = port_displacement(matrix, port, local, border)
    return with_released(matrix, factors, port, displacement), extra, border


def with_released(
    matrix: Bordered,
    factors: PortFactors,
    port: Inexact[Array, "row tether"],
    displacement: Inexact[Array, "row tether"],
) -> Inexact[Array, "row tether"]:
    """The displacements of the ports, with those of released chains in place of the given ones."""
    if matrix.released is None:
        return displacement
    alone = matvec_transposed(factors.released_inverse, port)
    return jnp.where(matrix.released, alone, displacement)


def solve(matrix: Bordered, factors: Factors, rhs: Vector) -> Vector:
    """The solution of matrix x = rhs. Of `matrix` only weights and shapes are read."""
    own, port = chains.reduce_to_port(factors.chains, rhs.blocks)
    if factors.lengths is None:
        displacement, local, border = solve_ports(matrix, factors.port, port, rhs)
        return Vector(chains.substitute_from_port(factors.chains, own, displacement), local, border)
    row = rhs.lengths - (factors.lengths.weights * rhs.blocks[1:]).sum((0, 1))
    port = jnp.concatenate([port, row[None]])
    displacement, local, border = solve_ports(matrix, factors.port, port, rhs)
    length = displacement[-1]
    own = own - factors.lengths.along * length
    blocks = chains.substitute_from_port(factors.chains, own, displacement[:-1])
    return Vector(blocks, local, border, lengths=length)
