"""Direct solver for a bordered system of chains whose last blocks are also joined, neighbour to neighbour,
by the segments of a ring.

The segments are condensed on their ends (`segments.py`). Their diagonal parts are added to the last blocks
of the chains; what remains couples the positions x_i of neighbouring tips,

    force on tip i:    (R x)_i = U_i x_{i+1} + L_i x_{i-1}        (i modulo the number of chains p),

in addition to the matrix of `bordered`. Let D_i be the displacement of tip i for a unit force there and P_i
that for unit displacements of the border, both without R; Q_i the reduced right-hand side of the border for
a unit force at tip i; and S the border's matrix after the elimination of the chains. Then

    (1 + D R) x = x_0 + P y,        S y = s - Q R x,

where x_0 and s belong to the chains alone. The first is a cyclic chain of blocks of three (`cyclic.py`),
the second a small dense system. The cost is O(chains * elements).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from esail_jax.array_types import Array, Inexact, Maybe
from esail_jax.numerics import block_tridiagonal as chains
from esail_jax.numerics import bordered, cyclic, segments
from esail_jax.numerics.bordered import Bordered, Vector
from esail_jax.numerics.segments import END
from esail_jax.numerics.small_matrices import matmul, matvec, matvec_transposed

PerTip = Inexact[Array, "3 tether"]


class RingFactors(NamedTuple):
    """All factors that `solve` needs.

    tethers: factors of the chains and their ports. segments: None if segments have no unknowns of their own
    upper, lower: U_i and L_i. cyclic: factors of 1 + D R
    tip_chain, tip_port: what a unit force at the tip leaves of a chain and of its port's right-hand side
    border_force: Q_i. tip_border: (1 + D R)^{-1} P. border_inverse: inverse of S + Q R (1 + D R)^{-1} P.
    These three are None without a border.
    """

    tethers: bordered.Factors
    segments: Maybe[segments.SegmentFactors]
    upper: Inexact[Array, "3 3 tether"]
    lower: Inexact[Array, "3 3 tether"]
    cyclic: cyclic.CyclicFactors
    tip_chain: Inexact[Array, "link row 3 tether"]
    tip_port: Inexact[Array, "row 3 tether"]
    border_force: Maybe[Inexact[Array, "border 3 tether"]]
    tip_border: Maybe[Inexact[Array, "3 border tether"]]
    border_inverse: Maybe[Inexact[Array, "border border"]]


def next_tip(x: Array) -> Array:
    """The values of the following tips."""
    return jnp.roll(x, -1, axis=-1)


def previous_tip(x: Array) -> Array:
    """The values of the preceding tips."""
    return jnp.roll(x, 1, axis=-1)


def coupling(upper: Array, lower: Array, x: PerTip) -> PerTip:
    """R x, the forces on the tips for displacements of their neighbours."""
    return matvec(upper, next_tip(x)) + matvec(lower, previous_tip(x))


def ports_alone(
    matrix: Bordered, factors: bordered.PortFactors, port: Array, local: Array | None
) -> tuple[Array, Array | None]:
    """Displacements of the ports and local unknowns if the border does not move. local: right-hand side of
    the local unknowns, free rows included."""
    if local is not None:
        local = matvec_transposed(factors.local_inverse, local)
    displacement, _ = bordered.port_displacement(matrix, port, local, None)
    return bordered.with_released(matrix, factors, port, displacement), local


def factor(matrix: Bordered) -> RingFactors:
    """Computes the factors of the whole matrix, which has segments."""
    inside, ends = segments.factor(matrix.segments)
    upper, lower = ends[:END, END:], previous_tip(ends[END:, :END])
    own = ends[:END, :END] + previous_tip(ends[END:, END:])
    alone = matrix._replace(diag=matrix.diag.at[-1, :END, :END].add(own), segments=None)
    chain, schur = chains.factor(alone.diag, alone.upper, alone.lower)
    ports, border = bordered.eliminate_ports(alone, schur)

    n, m, _, p = alone.diag.shape
    force = jnp.broadcast_to(jnp.eye(m, END, dtype=schur.dtype)[:, :, None], (m, END, p))
    force = jnp.concatenate([jnp.zeros((n - 1, m, END, p), schur.dtype), force[None]])
    tip_chain, tip_port = jax.vmap(lambda x: chains.reduce_to_port(chain, x), 2, (2, 1))(force)

    def tip_of(own, port):
        """Displacements of the tips."""
        return chains.substitute_from_port(chain, own, port)[-1, :END]

    def by_force(own, port):
        local = None
        if ports.local_inverse is not None:
            local = jnp.pad(port[alone.held :], ((0, len(ports.local_inverse) - alone.free), (0, 0)))
        displacement, _ = ports_alone(alone, ports, port, local)
        return tip_of(own, displacement), chainwise_border(alone, ports, port, local)

    compliance, border_force = jax.vmap(by_force, (2, 1), (1, 1))(tip_chain, tip_port)
    ring = cyclic.factor(matmul(compliance, upper), matmul(compliance, lower))
    tip_border = border_inverse = None
    if border is not None:

        def by_border(column):
            local = None if ports.local_inverse is None else -ports.local_from_border[column]
            unit = jnp.zeros(len(border), schur.dtype).at[column].set(1.0)
            displacement, _ = bordered.port_displacement(alone, tip_port[:, 0], local, unit)
            return tip_of(jnp.zeros_like(tip_chain[:, :, 0]), displacement)

        loose_ends = jax.vmap(by_border, out_axes=1)(jnp.arange(len(border)))
        tip_border = jax.vmap(lambda x: cyclic.solve(ring, x), 1, 1)(loose_ends)
        back = jax.vmap(lambda x: coupling(upper, lower, x), 1, 1)(tip_border)
        corner = border + jnp.einsum("akt,kbt->ab", border_force, back)
        border_inverse = bordered.equilibrated_inverse(corner)
    tethers = bordered.Factors(chain, ports)
    return RingFactors(
        tethers, inside, upper, lower, ring, tip_chain, tip_port, border_force, tip_border, border_inverse
    )


def chainwise_border(
    matrix: Bordered, factors: bordered.PortFactors, port: Array, local: Array | None
) -> Inexact[Array, "border tether"] | None:
    """Right-hand sides of the border after the elimination of the local unknowns, one for each chain."""
    if matrix.border is None:
        return None
    points = (matrix.weights[:, None] * port[None, : bordered.HELD_ROWS]).reshape(-1, port.shape[-1])
    border = jnp.pad(points, ((0, len(matrix.border) - len(points)), (0, 0)))
    if local is not None:
        border = border - jnp.einsum("ltb,lt->bt", factors.border_from_local, local)
    return border


def solve(matrix: Bordered, factors: RingFactors, rhs: Vector) -> Vector:
    """The solution of matrix x = rhs. Of `matrix` only weights and shapes are read."""
    blocks = rhs.blocks
    inside: Maybe[Array] = None
    if factors.segments is not None:
        inside = segments.solve_own(factors.segments, rhs.ring)
        ends = segments.end_rows(factors.segments, inside)
        blocks = blocks.at[-1, :END].add(-ends[:END] - previous_tip(ends[END:]))
    chain, ports, _ = factors.tethers
    own, port = chains.reduce_to_port(chain, blocks)
    local, border = bordered.port_loads(matrix, port, rhs)
    displacement, _ = ports_alone(matrix, ports, port, local)
    tips = chains.substitute_from_port(chain, own, displacement)[-1, :END]
    tips = cyclic.solve(factors.cyclic, tips)
    if border is not None:
        border = bordered.without_local(ports, local, border)
        force = coupling(factors.upper, factors.lower, tips)
        border = factors.border_inverse @ (border - jnp.einsum("bkt,kt->b", factors.border_force, force))
        tips = tips + jnp.einsum("kbt,b->kt", factors.tip_border, border)
    force = coupling(factors.upper, factors.lower, tips)
    port = port - (factors.tip_port * force).sum(1)
    own = own - (factors.tip_chain * force).sum(2)
    local, _ = bordered.port_loads(matrix, port, rhs)
    _, local = ports_alone(matrix, ports, port, local)
    displacement, extra, _ = bordered.moved_by_border(matrix, ports, port, local, border)
    ring = None
    blocks = chains.substitute_from_port(chain, own, displacement)
    if factors.segments is not None:
        ends = jnp.concatenate([tips, next_tip(tips)])
        ring = segments.with_ends(factors.segments, inside, ends)
    return Vector(blocks, extra, border, ring)
