"""The sum of the terms a scene lists: residual, constraints and tangent. Holds no physics.

    M v' + Phi_q^T lam - Q(t, q, v) = 0,      Phi(t, q) = 0

Every function below loops over the terms that are there; an absent one leaves no trace in the
compiled program.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Nodal, Rotation, Scalar, Vector
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.elements.rigid_body import RigidBody
from esail_jax.elements.tether import Tethers
from esail_jax.environment.circular_orbit import CircularOrbit
from esail_jax.joints.roots import FrameRoots, HubRoots
from esail_jax.numerics import bordered
from esail_jax.numerics.vectors import dot
from esail_jax.terms import Dissipation, Energy, Load, PointFields


class Power(NamedTuple):
    """Power [W] put in by loads, gravity and the turning frame, and lost by dissipation."""

    external: Scalar
    dissipated: Scalar


class Residual(NamedTuple):
    """Left-hand sides. forces: equations of motion [N] (slope rows [N m]) with the reaction of the
    root joints left out, so that the rows of the root nodes *are* those reactions. constraints:
    Phi [m]."""

    forces: Coordinates
    constraints: Multipliers


class System(eqx.Module):
    """Tethers, what acts on them and what holds them (roots None: nothing does)."""

    tethers: Tethers
    roots: HubRoots | FrameRoots | None
    hub: RigidBody | None
    energies: tuple[Energy, ...]
    dissipations: tuple[Dissipation, ...]
    loads: tuple[Load, ...]
    gravity: Vector | None
    orbit: CircularOrbit | None = None

    # ---- what is there ---------------------------------------------------------------------

    @property
    def clamped(self) -> bool:
        return self.roots is not None and self.roots.normals is not None

    @property
    def weighted(self) -> bool:
        """Is there an acceleration field, gravity or that of an orbit?"""
        return self.gravity is not None or self.orbit is not None

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of everything that was built, for `/numerics` and for people."""
        if self.tethers.kind == "rod":
            names = ["free chain" if self.roots is None else "fixed anchor", "rods"]
        else:
            names = [
                "hub" if self.hub is not None else "turning frame",
                f"{self.tethers.kind} elements",
                "clamped roots" if self.clamped else "pinned roots",
            ]
        names += [term.name for term in (*self.energies, *self.dissipations, *self.loads)]
        names += ["gravity"] * (self.gravity is not None)
        return tuple(names + ["circular orbit"] * (self.orbit is not None))

    # ---- forces ----------------------------------------------------------------------------

    def point_forces(
        self, time: Scalar, fields: PointFields, rates: PointFields
    ) -> tuple[PointFields, PointFields, PointFields]:
        """At every quadrature point: what is conjugate to the fields (dW + dR - f), and of it the
        viscous part and the loads' (with their sign), for the power."""
        elastic = [term.point_forces(time, fields, rates) for term in self.energies]
        viscous = [term.point_forces(time, fields, rates) for term in self.dissipations]
        loads = [term.point_forces(time, fields, rates) for term in self.loads]
        return add_fields(elastic + viscous + loads), add_fields(viscous), add_fields(loads)

    def field(self, q: Coordinates, v: Coordinates) -> Coordinates:
        """Acceleration [m/s^2] of a free particle at every node and hub point: uniform gravity and
        the field of an orbit. Being linear in position, it is exact between nodes too."""
        hub = None if q.hub is None else jnp.zeros_like(q.hub)
        tether = jnp.zeros_like(q.tether)
        if self.gravity is not None:
            tether = tether + self.tethers.uniform(self.gravity)
            hub = None if hub is None else hub + self.gravity
        if self.orbit is not None:
            toward = jnp.moveaxis(
                self.orbit.acceleration(*(jnp.moveaxis(x.tether, 1, 0) for x in (q, v))), 0, 1
            )
            tether = tether + toward
            hub = None if hub is None else hub + self.orbit.acceleration(q.hub.T, v.hub.T).T
        return Coordinates(tether, hub)

    def inertial(self, q: Coordinates, v: Coordinates, vdot: Coordinates) -> Coordinates:
        """vdot minus the acceleration field: weight is inertia in a falling frame."""
        return vdot.axpy(-1.0, self.field(q, v)) if self.weighted else vdot

    def residual(
        self, time: Scalar, q: Coordinates, v: Coordinates, vdot: Coordinates, lam: Multipliers
    ) -> tuple[Residual, Power]:
        """Equations of motion and constraints at one state, with the power of its forces."""
        tethers = self.tethers
        fields, rates = tethers.interpolate(q.tether), tethers.interpolate(v.tether)
        total, viscous, loads = self.point_forces(time, fields, rates)
        inertial = self.inertial(q, v, vdot)
        tether = tethers.nodal_forces(total, inertial.tether)
        hub = None
        if self.hub is not None:
            hub = self.hub.mass_matrix @ inertial.hub
        forces, constraints = Coordinates(tether, hub), Multipliers(None, None)
        if self.has_constraints:
            constraints, pull_back = jax.vjp(lambda q: self.constraints(time, q), q)
            forces = jax.tree.map(jnp.add, forces, pull_back(lam)[0])
        external = self.frame_power(time, q, v, forces, lam)
        if self.loads:
            external = external - self.integrate(dot(loads.r, rates.r))
        if self.weighted:
            momentum = self.momenta(v)
            parts = jax.tree.map(lambda a, p: (a * p).sum(), self.field(q, v), momentum)
            external = external + sum(jax.tree.leaves(parts))
        dissipated = jnp.zeros(())
        if self.dissipations:
            parts = [dot(f, rate) for f, rate in zip(viscous, rates, strict=True) if f is not None]
            dissipated = self.integrate(sum(parts))
        return Residual(forces, constraints), Power(external, dissipated)

    def frame_power(
        self, time: Scalar, q: Coordinates, v: Coordinates, forces: Coordinates, lam: Multipliers
    ) -> Scalar:
        """Power of a turning frame: root reactions times root velocities, and for clamped roots
        mu . (partial Phi / partial t), what a moving constraint does. Zero with a hub."""
        if self.hub is not None or self.roots is None:
            return jnp.zeros(())
        power = (forces.tether[0, :, 0] * v.tether[0, :, 0]).sum()
        if self.clamped:
            moving = jax.jvp(lambda t: self.constraints(t, q), (time,), (jnp.ones(()),))[1]
            power = power + (lam.clamp * moving.clamp).sum()
        return power

    def integrate(self, density: Float[Array, "point elem tether"]) -> Scalar:
        """Integral over all tethers of a quantity per undeformed length."""
        return jnp.sum(self.tethers.weights[:, None, None] * density * self.tethers.element_length)

    def momenta(self, v: Coordinates) -> Coordinates:
        """M v: momenta [kg m/s] conjugate to the coordinates."""
        hub = None if self.hub is None else self.hub.mass_matrix @ v.hub
        return Coordinates(self.tethers.inertia(v.tether), hub)

    def momentum(self, v: Coordinates) -> Vector:
        """Linear momentum [kg m/s] of everything."""
        momenta = self.momenta(v)
        total = momenta.tether[0].sum((1, 2))
        return total if momenta.hub is None else total + momenta.hub.sum(0)

    # ---- constraints -----------------------------------------------------------------------

    @property
    def has_constraints(self) -> bool:
        return self.hub is not None or self.clamped

    def constraints(self, time: Scalar, q: Coordinates) -> Multipliers:
        """Phi(t, q) [m], in the layout of its multipliers."""
        hub = self.hub.constraints(q.hub) if self.hub is not None else None
        clamp = None
        if self.clamped:
            if self.hub is not None:
                normals = self.roots.clamp_directions(q.hub)
            else:
                normals = self.roots.turn(time, self.roots.normals)
            clamp = (normals * q.tether[1, :, 0]).sum(1) * self.tethers.element_length
        return Multipliers(hub, clamp)

    def constraint_acceleration(self, time: Scalar, q: Coordinates, v: Coordinates) -> Multipliers:
        """d^2/dt^2 Phi(t, q + v t) at zero acceleration: minus the right-hand side of
        Phi_q vdot = Q_lam ([PGV] Eq. 1-2)."""

        def along(tau):
            return self.constraints(time + tau, q.axpy(tau, v))

        def rate(tau):
            return jax.jvp(along, (tau,), (jnp.ones_like(tau),))[1]

        zero = jnp.zeros(())
        return jax.jvp(rate, (zero,), (jnp.ones(()),))[1]

    # ---- tangent ---------------------------------------------------------------------------

    def point_jacobian(
        self, time: Scalar, fields: PointFields, rates: PointFields, rate_factor: Scalar
    ) -> dict[tuple[str, str], Array]:
        """d(point forces)/d(fields) along rates that move with the fields: dF/dx + factor dF/dv.

        By (row, column) field names, the pairs that some term couples: (direction, component,
        point, elem, tether). One forward derivative per component a term depends on.
        """
        blocks = {}
        for term in (*self.energies, *self.dissipations, *self.loads):
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
        self,
        time: Scalar,
        q: Coordinates,
        v: Coordinates,
        lam: Multipliers,
        stiffness_factor: Scalar,
        rate_factor: Scalar,
    ) -> bordered.Bordered:
        """M + s (K + c C) and the constraint gradients, s = `stiffness_factor`, c = `rate_factor`,
        K = d(residual)/dq, C = d(residual)/dv. The unknowns beside dq are s dlam: with that scaling
        the matrix tends to the mass matrix as the step tends to zero (Bottasso; Arnold & Brüls)."""
        tethers = self.tethers
        fields, rates = tethers.interpolate(q.tether), tethers.interpolate(v.tether)
        jacobian = self.point_jacobian(time, fields, rates, rate_factor)
        axes = np.eye(3)
        if self.orbit is not None:
            by_position, by_velocity = self.orbit.gradients
            axes = axes - stiffness_factor * (by_position + rate_factor * by_velocity)
        elements = stiffness_factor * tethers.tangent_elements(jacobian)
        elements = elements + tethers.mass_elements(axes)
        scaled = jax.tree.map(lambda x: stiffness_factor * x, lam)
        return self._bordered(time, q, elements, tethers.point_masses(axes), scaled)

    def mass(self, time: Scalar, q: Coordinates) -> bordered.Bordered:
        """M and the constraint gradients: the matrix of a consistent acceleration."""
        elements = self.tethers.mass_elements()
        elements = jnp.broadcast_to(
            elements, (*elements.shape[:2], self.tethers.elements, elements.shape[-1])
        )
        return self._bordered(time, q, elements, self.tethers.point_masses(), self.no_multipliers())

    def no_multipliers(self) -> Multipliers:
        """lam = 0 in the layout of this system."""
        p = self.tethers.count
        hub = jnp.zeros(6) if self.hub is not None else None
        return Multipliers(hub, jnp.zeros((2, p)) if self.clamped else None)

    def _bordered(
        self,
        time: Scalar,
        q: Coordinates,
        elements: Array,
        masses: tuple[Array, Array | None],
        lam: Multipliers,
    ) -> bordered.Bordered:
        diag, upper, lower = self.tethers.blocks(elements)
        tip, base = masses
        diag = diag.at[-1].add(tip)
        if base is not None:
            diag = diag.at[0].add(base)
        matrix = bordered.Bordered(
            diag,
            upper,
            lower,
            self.roots.weights if self.hub is not None else None,
            loose=() if self.roots is None else None,
        )
        if self.hub is not None:
            matrix = matrix._replace(border=self._hub_border(q, lam))
        if self.clamped:
            matrix = self._add_clamps(time, matrix, q, lam)
        return matrix

    def _hub_border(self, q: Coordinates, lam: Multipliers) -> Float[Array, "18 18"]:
        """Hub mass, and the Hessian of lam . Phi in (base points, multipliers), which holds the
        constraint gradients and their geometric stiffness."""

        def potential(unknown):
            return unknown[12:] @ self.hub.constraints(unknown[:12].reshape(4, 3))

        point = jnp.concatenate([q.hub.reshape(-1), lam.hub])
        mass = jnp.kron(self.hub.mass_matrix, jnp.eye(3))
        return jax.hessian(potential)(point).at[:12, :12].add(mass)

    def _add_clamps(
        self, time: Scalar, matrix: bordered.Bordered, q: Coordinates, lam: Multipliers
    ) -> bordered.Bordered:
        """Hessian of mu . psi in (root slope in metres, mu) and the base points, root by root."""
        length = self.tethers.element_length
        if self.hub is None:
            normals = self.roots.turn(time, self.roots.normals)
        else:
            normals = self.roots.normals

        def potential(local, points, normals):
            directions = normals if points is None else (normals @ points)
            return local[3:] @ (directions @ local[:3])

        local = jnp.concatenate([q.tether[1, :, 0] * length, lam.clamp])
        if self.hub is None:
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

    # ---- solver layout ---------------------------------------------------------------------

    def to_vector(self, forces: Coordinates, constraints: Multipliers) -> bordered.Vector:
        """Residual or right-hand side in the solver's layout (slopes in metres)."""
        border = local = None
        if self.hub is not None:
            border = jnp.concatenate([forces.hub.reshape(-1), constraints.hub])
        if self.clamped:
            local = constraints.clamp
        return bordered.Vector(self._to_blocks(forces.tether), local, border)

    def from_vector(self, x: bordered.Vector) -> tuple[Coordinates, Multipliers]:
        """Solution of the solver as coordinates and (scaled) multipliers."""
        tethers = self.tethers
        nodal = jnp.moveaxis(x.blocks.reshape(x.blocks.shape[0], tethers.coefs, 3, -1), 0, 2)
        if tethers.coefs == 2:
            nodal = jnp.stack([nodal[0], nodal[1] / tethers.element_length])
        hub = x.border[:12].reshape(4, 3) if self.hub is not None else None
        lam = Multipliers(
            x.border[12:] if self.hub is not None else None, x.local if self.clamped else None
        )
        return Coordinates(nodal, hub), lam

    def _to_blocks(self, nodal: Nodal) -> Float[Array, "node row tether"]:
        if self.tethers.coefs == 2:
            nodal = jnp.stack([nodal[0], nodal[1] / self.tethers.element_length])
        return jnp.moveaxis(nodal, 2, 0).reshape(nodal.shape[2], -1, nodal.shape[3])

    # ---- attitude and roots -----------------------------------------------------------------------------

    def rotation(self, time: Scalar, q: Coordinates) -> Rotation:
        """C_B^I of the hub or of the turning frame."""
        if self.roots is None:
            return jnp.eye(3)
        return self.roots.rotation(time) if self.hub is None else self.hub.rotation(q.hub)

    def place_roots(self, time: Scalar, q: Coordinates, derivative: int = 0) -> Coordinates:
        """q (or its rate or acceleration) with the root nodes where hub or frame put them."""
        if self.roots is None:
            return q
        if self.hub is not None:
            root = self.roots.positions(q.hub)
        else:
            root = self.roots.turn(time, self.roots.anchors, derivative)
        return q._replace(tether=q.tether.at[0, :, 0].set(root))


def add_fields(parts: list[PointFields]) -> PointFields:
    """Sum of what several terms contribute; None where none does."""
    sums = []
    for values in zip(*parts, strict=True) if parts else ((),) * len(PointFields._fields):
        present = [value for value in values if value is not None]
        sums.append(sum(present[1:], present[0]) if present else None)
    return PointFields(*sums)


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
