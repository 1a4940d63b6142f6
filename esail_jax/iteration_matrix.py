"""The iteration matrix of a system, and the layout of its solver. Holds no physics.

    [ M + s (K + c C)   Phi_q^T ] [ dq     ]
    [ Phi_q             0       ] [ s dlam ]

Assembled block by block: element blocks along every tether, clamped roots at the ports, the hub in
the border they share (`numerics/bordered.py`). With s = 0 it gives consistent accelerations.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Nodal, Rotation, Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.numerics import block_tridiagonal, bordered
from esail_jax.numerics.block_tridiagonal import ChainFactors
from esail_jax.system import System
from esail_jax.terms import PointFields


def point_jacobian(
    system: System, time: Scalar, fields: PointFields, rates: PointFields, rate_factor: Scalar
) -> dict[tuple[str, str], Array]:
    """d(point forces)/d(fields) along rates that move with the fields: dF/dx + factor dF/dv.

    By (row, column) field names, the pairs that some term couples: (direction, component,
    point, element). One forward derivative per component a term depends on.
    """
    blocks = {}
    for term in (*system.inner_terms, *system.loads):
        names = term.depends_on

        def shifted(*steps, term=term, names=names):
            moves = dict(zip(names, steps, strict=True))
            moved = fields._replace(**{k: getattr(fields, k) + d for k, d in moves.items()})
            moving = {k: getattr(rates, k) + rate_factor * d for k, d in moves.items()}
            parts = term.point_forces(time, moved, rates._replace(**moving))
            return {k: part for k, part in parts._asdict().items() if part is not None}

        zeros = [jnp.zeros_like(getattr(fields, name)) for name in names]
        for index, column in enumerate(names):
            rows = jax.vmap(lambda d, i=index, z=zeros: jax.jvp(shifted, z, one_of(z, i, d))[1])(
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
    """M + s (K + c C) and the constraint gradients, s = `stiffness_factor`, c = `rate_factor`,
    K = d(residual)/dq, C = d(residual)/dv at given voltages. The unknowns beside dq are s dlam: with
    that scaling the matrix tends to the mass matrix as the step tends to zero (Bottasso; Arnold &
    Brüls)."""
    tethers = system.tethers
    fields, rates = tethers.interpolate(q.tether), tethers.interpolate(v.tether)
    jacobian = point_jacobian(system.with_commanded_loads(time, q), time, fields, rates, rate_factor)
    axes = np.eye(3)
    if system.orbit is not None:
        by_position, by_velocity = system.orbit.gradients
        axes = axes - stiffness_factor * (by_position + rate_factor * by_velocity)
    elements = stiffness_factor * tethers.tangent_elements(jacobian)
    elements = elements + tethers.mass_elements(axes)
    scaled = jax.tree.map(lambda x: stiffness_factor * x, lam)
    return assembled(system, time, q, elements, tethers.point_masses(axes), scaled)


def mass(system: System, time: Scalar, q: Coordinates) -> bordered.Bordered:
    """M and the constraint gradients: the matrix of a consistent acceleration."""
    tethers = system.tethers
    return assembled(
        system, time, q, mass_elements(system), tethers.point_masses(), system.no_multipliers()
    )


def mass_elements(system: System) -> Float[Array, "row col elem tether"]:
    """Of every element, equal ones too."""
    elements = system.tethers.mass_elements()
    return jnp.broadcast_to(elements, (*elements.shape[:2], system.tethers.elements, elements.shape[-1]))


class Inertia(NamedTuple):
    """What no state of motion changes in a factorisation of `mass`: factors of the tethers' mass matrices,
    their Schur complements on the roots, and, unless clamped or released roots make them depend on the
    state, the factors of the ports of a system whose hub has the attitude 1."""

    chains: ChainFactors
    schur: Float[Array, "row row tether"]
    ports: bordered.PortFactors | None


def inertia_of(system: System) -> Inertia:
    """The inertia of a system."""
    elements, masses = mass_elements(system), system.tethers.point_masses()
    chains, schur = block_tridiagonal.factor(*chain_blocks(system, elements, masses))
    if system.clamped or (system.roots is not None and system.roots.releases.released is not None):
        return Inertia(chains, schur, None)
    tethers = system.tethers
    nodal = jnp.zeros((tethers.coefs, 3, tethers.elements + 1, tethers.count))
    q = Coordinates(nodal, None if system.hub is None else system.hub.base_points)
    return Inertia(chains, schur, bordered.factor_ports(mass(system, jnp.zeros(()), q), schur))


FactoredMass = tuple[bordered.Bordered, bordered.Factors]
"""`mass` of a state and its factors."""


def factor_mass(
    system: System, time: Scalar, q: Coordinates, inertia: Inertia | None = None
) -> FactoredMass:
    """`mass` and its factors. inertia: that of the system, where many states share it; the hub must have
    its shape then."""
    matrix = mass(system, time, q)
    if inertia is None:
        return matrix, bordered.factor(matrix)
    chains, schur, ports = inertia
    if ports is None:
        ports = bordered.factor_ports(matrix, schur)
    elif system.hub is not None:
        ports = turned(ports, system.rotation(time, q))
    return matrix, bordered.Factors(chains, ports)


def turned(ports: bordered.PortFactors, attitude: Rotation) -> bordered.PortFactors:
    """Those of a hub with another attitude: inertia is the same in all directions, the gradients of
    rigidity turn with the hub."""

    def rows(a):
        points = attitude @ a[:12].reshape(4, 3, -1)
        return jnp.concatenate([points.reshape(12, -1), a[12:]])

    return ports._replace(border_inverse=rows(rows(ports.border_inverse).T).T)


def assembled(
    system: System,
    time: Scalar,
    q: Coordinates,
    elements: Array,
    masses: tuple[Array, Array | None],
    lam: Multipliers,
) -> bordered.Bordered:
    """Element blocks and point masses (tip, base) in one matrix with what hub and clamps add."""
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
    """Diagonal, upper and lower blocks of the tethers."""
    diag, upper, lower = system.tethers.blocks(elements)
    tip, base = masses
    diag = diag.at[-1].add(tip)
    if base is not None:
        diag = diag.at[0].add(base)
    return diag, upper, lower


def hub_border(system: System, q: Coordinates, lam: Multipliers) -> Float[Array, "18 18"]:
    """Hub mass, and the Hessian of lam . Phi in (base points, multipliers), which holds the
    constraint gradients and their geometric stiffness."""

    def potential(unknown):
        return unknown[12:] @ system.hub.constraints(unknown[:12].reshape(4, 3))

    point = jnp.concatenate([q.hub.reshape(-1), lam.hub])
    inertia = jnp.kron(system.hub.mass_matrix, jnp.eye(3))
    return jax.hessian(potential)(point).at[:12, :12].add(inertia)


def add_clamps(
    system: System, time: Scalar, matrix: bordered.Bordered, q: Coordinates, lam: Multipliers
) -> bordered.Bordered:
    """Hessian of mu . psi in (root slope in metres, mu) and the base points, root by root."""
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
    """Residual or right-hand side in the solver's layout (slopes in metres)."""
    border = local = None
    if system.hub is not None:
        border = jnp.concatenate([forces.hub.reshape(-1), constraints.hub])
    if system.clamped:
        local = constraints.clamp
    return bordered.Vector(to_blocks(system, forces.tether), local, border)


def from_vector(system: System, x: bordered.Vector) -> tuple[Coordinates, Multipliers]:
    """Solution of the solver as coordinates and (scaled) multipliers."""
    tethers = system.tethers
    nodal = jnp.moveaxis(x.blocks.reshape(x.blocks.shape[0], tethers.coefs, 3, -1), 0, 2)
    if tethers.coefs == 2:
        nodal = jnp.stack([nodal[0], nodal[1] / tethers.element_length])
    hub = x.border[:12].reshape(4, 3) if system.hub is not None else None
    lam = Multipliers(
        x.border[12:] if system.hub is not None else None, x.local if system.clamped else None
    )
    return Coordinates(nodal, hub), lam


def to_blocks(system: System, nodal: Nodal) -> Float[Array, "node row tether"]:
    """Nodal values node by node, slopes in metres."""
    if system.tethers.coefs == 2:
        nodal = jnp.stack([nodal[0], nodal[1] / system.tethers.element_length])
    return jnp.moveaxis(nodal, 2, 0).reshape(nodal.shape[2], -1, nodal.shape[3])


def unit_directions(like: Float[Array, "3 *point"]) -> Float[Array, "3 3 *point"]:
    """The three unit vectors, at every point."""
    axes = np.eye(3).reshape(3, 3, *(1,) * (like.ndim - 1))
    return jnp.broadcast_to(axes, (3, *like.shape))


def one_of(zeros: list[Array], index: int, direction: Array) -> list[Array]:
    """Tangents that are zero but for one field."""
    return [direction if i == index else zero for i, zero in enumerate(zeros)]


def add_block(blocks: dict, key: tuple[str, str], value: Array) -> None:
    """Accumulate into a dictionary."""
    blocks[key] = blocks[key] + value if key in blocks else value
