"""Solver for chains that meet at a small border: a sail's tethers and its hub.

Unknowns are the blocks of every chain, per chain a few *local* unknowns at its port, and the shared
*border*. The port block of a chain is not free but moves with both,

    port = Z local + Y border,

and its equations are projected the same way (virtual work): a tether's root position is a point of
the hub (Y), its root slope is free (Z). Chains are condensed on their ports in O(blocks), local
unknowns are eliminated chain by chain, and one small dense system in the border is left. Absent
parts are `None` and cost nothing.
"""

from typing import NamedTuple

import jax.numpy as jnp

from esail_jax.array_types import Array, Float
from esail_jax.numerics import block_tridiagonal as chains
from esail_jax.numerics.small_matrices import inverse, matmul, matvec


class Bordered(NamedTuple):
    """The matrix. Axes: row, col within a block; tether last.

    diag, upper, lower: blocks 0 ... N of every chain, block 0 the port (`block_tridiagonal`)
    local_map Z: (row, local), or None if the port has no free part
    border_map Y: (row, border, tether), or None without a border
    local, local_border, border_local, border: what is added to the projected equations
    """

    diag: Float[Array, "block row row tether"]
    upper: Float[Array, "link row row tether"]
    lower: Float[Array, "link row row tether"]
    local_map: Float[Array, "row local"] | None = None
    border_map: Float[Array, "row border tether"] | None = None
    local: Float[Array, "local local tether"] | None = None
    local_border: Float[Array, "local border tether"] | None = None
    border_local: Float[Array, "border local tether"] | None = None
    border: Float[Array, "border border"] | None = None


class Vector(NamedTuple):
    """Right-hand side or solution. A solution's block 0 is the port's Z local + Y border."""

    blocks: Float[Array, "block row tether"]
    local: Float[Array, "local tether"] | None = None
    border: Float[Array, " border"] | None = None


class PortFactors(NamedTuple):
    """Elimination of the local unknowns and of the border, given the chains' Schur complements."""

    local_inverse: Float[Array, "local local tether"] | None
    local_from_border: Float[Array, "local border tether"] | None
    border_from_local: Float[Array, "border local tether"] | None
    border_inverse: Float[Array, "border border"] | None


class Factors(NamedTuple):
    """Everything a solve needs; kept over several time steps."""

    chains: chains.ChainFactors
    port: PortFactors


def add(a: Array, b: Array | None) -> Array:
    """a + b, where an absent b is no operation at all."""
    return a if b is None else a + b


def project(
    matrix: Bordered, schur: Float[Array, "row row tether"]
) -> tuple[Array | None, Array | None, Array | None, Array | None]:
    """The ports' Schur complements in the unknowns (local, border): the blocks
    (local, local), (local, border), (border, local), (border, border)."""
    z, y = matrix.local_map, matrix.border_map
    local = local_border = border_local = border = None
    if z is not None:
        local = add(jnp.einsum("ra,rst,sb->abt", z, schur, z), matrix.local)
    if y is not None:
        border = jnp.einsum("rat,rst,sbt->ab", y, schur, y) + matrix.border
        if z is not None:
            local_border = add(jnp.einsum("ra,rst,sbt->abt", z, schur, y), matrix.local_border)
            border_local = add(jnp.einsum("rat,rst,sb->abt", y, schur, z), matrix.border_local)
    return local, local_border, border_local, border


def equilibrated_inverse(a: Float[Array, "n n"]) -> Float[Array, "n n"]:
    """Inverse of a symmetric-pattern matrix after scaling rows and columns by 1/sqrt(max |row|):
    hub masses (1e3 kg) and constraint gradients (1) meet in one matrix."""
    scale = 1.0 / jnp.sqrt(jnp.abs(a).max(1))
    return scale[:, None] * jnp.linalg.inv(scale[:, None] * a * scale) * scale


def factor_ports(matrix: Bordered, schur: Float[Array, "row row tether"]) -> PortFactors:
    """Eliminate the local unknowns, then invert the border."""
    local, local_border, border_local, border = project(matrix, schur)
    local_inverse = from_border = from_local = border_inverse = None
    if local is not None:
        local_inverse = inverse(local)
        if border is not None:
            from_border = matmul(local_inverse, local_border)
            from_local = matmul(border_local, local_inverse)
            border = border - jnp.einsum("alt,lbt->ab", border_local, from_border)
    if border is not None:
        border_inverse = equilibrated_inverse(border)
    return PortFactors(local_inverse, from_border, from_local, border_inverse)


def factor(matrix: Bordered) -> Factors:
    """Block LU of the whole matrix."""
    chain_factors, schur = chains.factor(matrix.diag, matrix.upper, matrix.lower)
    return Factors(chain_factors, factor_ports(matrix, schur))


def solve_ports(
    matrix: Bordered, factors: PortFactors, port: Float[Array, "row tether"], rhs: Vector
) -> tuple[Array, Array | None, Array | None]:
    """Port displacement, local unknowns and border, from the chains' reduced right-hand sides."""
    z, y = matrix.local_map, matrix.border_map
    local_rhs = local = border = None
    displacement = jnp.zeros_like(port)
    if z is not None:
        local_rhs = add((z[:, :, None] * port[:, None]).sum(0), rhs.local)
    if y is not None:
        border_rhs = add((y * port[:, None]).sum((0, 2)), rhs.border)
        if z is not None:
            border_rhs = border_rhs - (factors.border_from_local * local_rhs).sum((1, 2))
        border = factors.border_inverse @ border_rhs
        displacement = (y * border[None, :, None]).sum(1)
    if z is not None:
        local = matvec(factors.local_inverse, local_rhs)
        if y is not None:
            local = local - (factors.local_from_border * border[None, :, None]).sum(1)
        displacement = displacement + (z[:, :, None] * local[None]).sum(1)
    return displacement, local, border


def solve(matrix: Bordered, factors: Factors, rhs: Vector) -> Vector:
    """Solution of matrix x = rhs; of `matrix` only the constant maps Z and Y are read."""
    reduced, port = chains.reduce_to_port(factors.chains, rhs.blocks)
    displacement, local, border = solve_ports(matrix, factors.port, port, rhs)
    blocks = chains.substitute_from_port(factors.chains, reduced, displacement)
    return Vector(blocks, local, border)


