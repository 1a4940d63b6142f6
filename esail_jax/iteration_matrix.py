"""The iteration matrix of a system, and the layout of its linear solver. Holds no physics.

    [ M + s (K + c C)   Phi_q^T ] [ dq     ]
    [ Phi_q             0       ] [ s dlam ]

It is assembled from blocks: element blocks along every tether, clamped roots at the ports, and the hub in
the border that the tethers share (`numerics/bordered.py`). With s = 0 it is the matrix of consistent
accelerations.
"""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Nodal, Rotation, Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.elements.ring import Ring
from esail_jax.elements.tether import TetherBatch
from esail_jax.numerics import block_tridiagonal, bordered, structured
from esail_jax.numerics.block_tridiagonal import ChainFactors
from esail_jax.numerics.segments import Segments
from esail_jax.point_fields import PointFields
from esail_jax.system import System


def point_jacobian(
    system: System | Ring, time: Scalar, fields: PointFields, rates: PointFields, rate_factor: Scalar
) -> dict[tuple[str, str], Array]:
    """Jacobian of the point forces F with respect to the fields x, dF/dx + rate_factor dF/dx'.

    The result has an entry for every (row, column) pair of field names that a term couples, (direction,
    component, point, element). Each component that a term depends on takes one forward derivative.
    """
    blocks: dict[tuple[str, str], Array] = {}
    for term in (*system.inner_terms, *(system.loads if isinstance(system, Ring) else system.acting_loads)):
        names = term.depends_on

        def shifted(*steps, term=term, names=names):
            moves = dict(zip(names, steps, strict=True))
            moved = fields._replace(**{k: getattr(fields, k) + d for k, d in moves.items()})
            moving = {k: getattr(rates, k) + rate_factor * d for k, d in moves.items()}
            parts = term.point_forces(time, moved, rates._replace(**moving))
            return {k: part for k, part in parts._asdict().items() if part is not None}

        zeros = [jnp.zeros_like(getattr(fields, name)) for name in names]
        for index, column in enumerate(names):
            rows = jax.vmap(lambda d, i=index, z=zeros: jax.jvp(shifted, z, unit_tangent(z, i, d))[1])(
                unit_directions(zeros[index])
            )
            for row in term.acts_on:
                add_block(blocks, (row, column), rows[row])
    return blocks


def tangent(
    system: System,
    time: Scalar,
    q: Coordinates,
    v: Coordinates,
    lam: Multipliers,
    stiffness_factor: Scalar,
    rate_factor: Scalar,
) -> bordered.Bordered:
    """Iteration matrix M + s (K + c C) with the constraint gradients.

    s = `stiffness_factor`, c = `rate_factor`; K = d(residual)/dq and C = d(residual)/dv at fixed commands
    of the control laws. The unknowns beside dq are s dlam. With that scaling the matrix tends to that of
    `mass` as the step tends to zero (Bottasso; Arnold & Brüls).
    """
    given, system = system, system.paid_out(time, q, v)
    tethers = system.tethers
    fields, rates = tethers.interpolate(q.tether), tethers.interpolate(v.tether)
    jacobian = point_jacobian(system.with_commanded_loads(time, q, v), time, fields, rates, rate_factor)
    axes = np.eye(3)
    gradients = system.field_gradients(time, q, v)
    if gradients is not None:
        by_position, by_velocity = gradients
        axes = axes - stiffness_factor * (by_position + rate_factor * by_velocity)
    elements = stiffness_factor * tethers.tangent_elements(jacobian)
    elements = elements + tethers.mass_elements(axes)
    scaled = jax.tree.map(lambda x: stiffness_factor * x, lam)
    matrix = assemble(system, time, q, elements, tethers.point_masses(axes), scaled)
    if system.has_unknown_lengths:
        factors = stiffness_factor, stiffness_factor * rate_factor
        return matrix._replace(lengths=length_rows(given, time, q, v, *factors))
    if system.ring is None:
        return matrix
    ring = system.ring
    fields, rates = (ring.segments.interpolate(ring.nodal(x)) for x in (q, v))
    jacobian = point_jacobian(ring, time, fields, rates, rate_factor)
    elements = stiffness_factor * ring.segments.tangent_elements(jacobian)
    return matrix._replace(segments=segments_of(ring, elements + ring.segments.mass_elements(axes)))


def mass(system: System, time: Scalar, q: Coordinates) -> bordered.Bordered:
    """Mass matrix M with the constraint gradients: the matrix of consistent accelerations."""
    given, system = system, system.paid_out(time, q)
    tethers, masses = system.tethers, mass_elements(system.tethers)
    matrix = assemble(system, time, q, masses, tethers.point_masses(), system.no_multipliers())
    if system.has_unknown_lengths:
        return matrix._replace(lengths=inertia_of_lengths(given, time, q))
    if system.ring is None:
        return matrix
    return matrix._replace(segments=segments_of(system.ring, mass_elements(system.ring.segments)))


def inertia_of_lengths(system: System, time: Scalar, q: Coordinates) -> bordered.LengthRows:
    """The rows and columns of the lengths in M, which is symmetric: the inertia forces of accelerations
    l''."""
    rest, one = jax.tree.map(jnp.zeros_like, q), jnp.ones_like(q.reel)
    inertia = dataclasses.replace(system, energies=(), dissipations=(), loads=(), fields=())

    def forces(lengths):
        return rows_with_lengths(inertia, time, q, rest, rest._replace(reel=lengths))

    _, column = jax.jvp(forces, (jnp.zeros_like(one),), (one,))
    blocks = to_blocks(system, column.tether)
    return bordered.LengthRows(blocks, blocks, column.reel)


def rows_with_lengths(
    system: System, time: Scalar, q: Coordinates, v: Coordinates, vdot: Coordinates
) -> Coordinates:
    """Rows of tethers and lengths at given commands of the control laws, without the tension of motors."""
    now = system.paid_out(time, q, v, vdot)
    inertial = now.relative_to_free_fall(time, q, v, vdot)
    forces, _ = now.member_forces(time, q, v, inertial)
    fall = vdot.tether - inertial.tether if now.fields else None
    winches = now.winch_forces(time, q.tether, v.tether, vdot.tether, fall)
    return forces._replace(reel=now.rows_of_lengths(winches, jnp.zeros_like(q.reel)))


def length_rows(
    system: System, time: Scalar, q: Coordinates, v: Coordinates, position: Scalar, rate: Scalar
) -> bordered.LengthRows:
    """The rows and columns of the lengths in M + position K + rate C, at fixed commands of the control
    laws. A tether's rows depend on its own length alone, so that one derivative along all lengths gives
    every column, and one of the sum of the rows of all lengths every row."""
    if system.controlled:
        system = system.with_commands(system.at(time, q, v).commands(time, q, v))
    rest, nothing = jax.tree.map(jnp.zeros_like, q), jnp.zeros_like(q.reel)

    def rows(q, v, vdot):
        return rows_with_lengths(system, time, q, v, vdot)

    def along(lengths):
        steps = (position, rate, jnp.ones(()))
        moved = (x._replace(reel=x.reel + s * lengths) for x, s in zip((q, v, rest), steps, strict=True))
        return rows(*moved)

    _, column = jax.jvp(along, (nothing,), (jnp.ones_like(nothing),))
    by_q, by_v, by_vdot = jax.grad(lambda *x: rows(*x).reel.sum(), (0, 1, 2))(q, v, rest)
    row = by_vdot.axpy(position, by_q).axpy(rate, by_v)
    corner = column.reel
    if system.winch_laws:
        by_length, by_rate = system.motor_gains(time, q, v)
        corner = corner + position * by_length + rate * by_rate
    return bordered.LengthRows(to_blocks(system, column.tether), to_blocks(system, row.tether), corner)


def segments_of(ring: Ring, elements: Float[Array, "row col elem tether"]) -> Segments:
    """The segments of a ring in the solver's layout."""
    return Segments(*ring.segments.blocks(elements))


def mass_elements(tethers: TetherBatch) -> Float[Array, "row col elem tether"]:
    """Mass matrices of all elements, those of equal elements repeated."""
    elements = tethers.mass_elements()
    return jnp.broadcast_to(elements, (*elements.shape[:2], tethers.elements, elements.shape[-1]))


class Inertia(NamedTuple):
    """The parts of the factorisation of `mass` that do not depend on the state.

    chains: factors of the tethers' mass matrices. schur: their Schur complements at the roots. ports: the
    factors of ports and hub at zero rotation; None if roots are clamped or may be released, as the factors
    then depend on the state.
    """

    chains: ChainFactors
    schur: Float[Array, "row row tether"]
    ports: bordered.PortFactors | None


def inertia_of(system: System) -> Inertia | None:
    """Computes the state-independent part of the factorisation of `mass`; None with a ring, and while
    tethers are paid out."""
    if system.ring is not None or system.payout is not None:
        return None
    elements, masses = mass_elements(system.tethers), system.tethers.point_masses()
    chains, schur = block_tridiagonal.factor(*chain_blocks(system, elements, masses))
    if system.clamped or (system.roots is not None and system.roots.releases.released is not None):
        return Inertia(chains, schur, None)
    tethers = system.tethers
    nodal = jnp.zeros((tethers.coefs, 3, tethers.elements + 1, tethers.count))
    q = Coordinates(nodal, None if system.hub is None else system.hub.base_points)
    return Inertia(chains, schur, bordered.factor_ports(mass(system, jnp.zeros(()), q), schur))


FactoredMass = tuple[bordered.Bordered, structured.Factors]
"""The matrix `mass` of a state, and its factors."""


def factor_mass(
    system: System, time: Scalar, q: Coordinates, inertia: Inertia | None = None
) -> FactoredMass:
    """The matrix `mass` of a state, and its factors.

    inertia: `inertia_of(system)`, if many states share it. The hub's base points must then form a rigid
    body.
    """
    matrix = mass(system, time, q)
    if inertia is None:
        return matrix, structured.factor(matrix)
    chains, schur, ports = inertia
    if ports is None:
        ports = bordered.factor_ports(matrix, schur)
    elif system.hub is not None:
        ports = rotate_ports(ports, system.rotation(time, q))
    return matrix, bordered.Factors(chains, ports)


def rotate_ports(ports: bordered.PortFactors, attitude: Rotation) -> bordered.PortFactors:
    """Factors of the ports for a hub with another attitude. The inertia is the same in all directions; the
    gradients of the rigidity constraints rotate with the hub."""

    def rows(a):
        points = attitude @ a[:12].reshape(4, 3, -1)
        return jnp.concatenate([points.reshape(12, -1), a[12:]])

    return ports._replace(border_inverse=rows(rows(ports.border_inverse).T).T)


def assemble(
    system: System,
    time: Scalar,
    q: Coordinates,
    elements: Array,
    masses: tuple[Array, Array | None],
    lam: Multipliers,
) -> bordered.Bordered:
    """Assembles element blocks, point masses (tip, base), hub and clamps in one matrix."""
    weights = None
    if system.hub is not None:
        weights = system.roots.releases.where_released(jnp.zeros(()), system.roots.weights)
    matrix = bordered.Bordered(
        *chain_blocks(system, elements, masses),
        weights,
        loose=() if system.roots is None else None,
        released=None if system.roots is None else system.roots.releases.released,
    )
    if system.hub is not None:
        matrix = matrix._replace(border=hub_border(system, q, lam))
    if system.clamped:
        matrix = add_clamps(system, time, matrix, q, lam)
    return matrix


def chain_blocks(
    system: System, elements: Array, masses: tuple[Array, Array | None]
) -> tuple[Array, Array, Array]:
    """Diagonal, upper and lower blocks of the tethers, point masses included."""
    diag, upper, lower = system.tethers.blocks(elements)
    tip, base = masses
    diag = diag.at[-1].add(tip)
    if base is not None:
        diag = diag.at[0].add(base)
    return diag, upper, lower


def hub_border(system: System, q: Coordinates, lam: Multipliers) -> Float[Array, "18 18"]:
    """Hub mass plus the Hessian of lam . Phi with respect to (base points, multipliers), which contains the
    constraint gradients and their geometric stiffness."""

    def potential(unknown):
        return unknown[12:] @ system.hub.constraints(unknown[:12].reshape(4, 3))

    point = jnp.concatenate([q.hub.reshape(-1), lam.hub])
    inertia = jnp.kron(system.hub.mass_matrix, jnp.eye(3))
    return jax.hessian(potential)(point).at[:12, :12].add(inertia)


def add_clamps(
    system: System, time: Scalar, matrix: bordered.Bordered, q: Coordinates, lam: Multipliers
) -> bordered.Bordered:
    """Adds, root by root, the Hessian of mu . psi in (root slope in metres, mu) and the base points."""
    length = system.tethers.element_length
    if system.hub is None:
        normals = system.roots.to_inertial(time, system.roots.normals)
    else:
        normals = system.roots.normals

    def potential(local, points, normals):
        directions = normals if points is None else (normals @ points)
        return local[3:] @ (directions @ local[:3])

    local = jnp.concatenate([q.tether[1, :, 0] * length, lam.clamp])
    if system.hub is None:
        block = jax.vmap(jax.hessian(lambda z, c: potential(z, None, c)), in_axes=-1, out_axes=-1)
        return matrix._replace(local=block(local, normals))

    def split(z, c):
        return jax.hessian(lambda z, y: potential(z, y.reshape(4, 3), c), argnums=(0, 1))(
            z, q.hub.reshape(-1)
        )

    (zz, zy), (yz, _) = jax.vmap(split, in_axes=-1, out_axes=-1)(local, normals)
    pad = ((0, 0), (0, 6), (0, 0))
    return matrix._replace(
        local=zz,
        local_border=jnp.pad(zy, pad),
        border_local=jnp.pad(yz, (pad[1], pad[0], pad[2])),
    )


def to_vector(system: System, forces: Coordinates, constraints: Multipliers) -> bordered.Vector:
    """Residual or right-hand side in the layout of the solver, with slope rows divided by l."""
    border = local = None
    if system.hub is not None:
        border = jnp.concatenate([forces.hub.reshape(-1), constraints.hub])
    if system.clamped:
        local = constraints.clamp
    ring = None if forces.ring is None else system.ring.to_blocks(forces.ring)
    return bordered.Vector(to_blocks(system, forces.tether), local, border, ring, forces.reel)


def from_vector(system: System, x: bordered.Vector) -> tuple[Coordinates, Multipliers]:
    """Solution of the solver as coordinates and scaled multipliers s dlam."""
    tethers = system.tethers
    nodal = jnp.moveaxis(x.blocks.reshape(x.blocks.shape[0], tethers.coefs, 3, -1), 0, 2)
    if tethers.coefs == 2:
        nodal = jnp.stack([nodal[0], nodal[1] / tethers.element_length])
    hub = x.border[:12].reshape(4, 3) if system.hub is not None else None
    lam = Multipliers(
        x.border[12:] if system.hub is not None else None, x.local if system.clamped else None
    )
    ring = None if x.ring is None else system.ring.from_blocks(x.ring)
    return Coordinates(nodal, hub, ring, x.lengths), lam


def to_blocks(system: System, nodal: Nodal) -> Float[Array, "node row tether"]:
    """Nodal forces as one block per node, slope rows conjugate to slopes in metres."""
    if system.tethers.coefs == 2:
        nodal = jnp.stack([nodal[0], nodal[1] / system.tethers.element_length])
    return jnp.moveaxis(nodal, 2, 0).reshape(nodal.shape[2], -1, nodal.shape[3])


def unit_directions(like: Float[Array, "3 *point"]) -> Float[Array, "3 3 *point"]:
    """The three unit vectors, repeated at every point."""
    axes = np.eye(3).reshape(3, 3, *(1,) * (like.ndim - 1))
    return jnp.broadcast_to(axes, (3, *like.shape))


def unit_tangent(zeros: list[Array], index: int, direction: Array) -> list[Array]:
    """Tangents of several fields: `direction` for one of them, zero for the others."""
    return [direction if i == index else zero for i, zero in enumerate(zeros)]


def add_block(blocks: dict, key: tuple[str, str], value: Array) -> None:
    """Adds a block to a dictionary of blocks."""
    blocks[key] = blocks[key] + value if key in blocks else value
