"""The sum of the terms a scene lists: residual, constraints and attitude. Holds no physics.

    M v' + Phi_q^T lam - Q(t, q, v) = 0,      Phi(t, q) = 0

Every function below loops over the terms that are there; an absent one leaves no trace in the
compiled program.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import (
    Array,
    Float,
    Instants,
    Nodal,
    PerPoint,
    PerTether,
    Rotation,
    Scalar,
    Vector,
)
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.elements.rigid_body import RigidBody
from esail_jax.elements.tether import Tethers
from esail_jax.environment.circular_orbit import CircularOrbit
from esail_jax.joints.roots import FrameRoots, HubRoots
from esail_jax.measurements import Measurements
from esail_jax.numerics.small_matrices import matmul
from esail_jax.numerics.vectors import dot, stacked
from esail_jax.terms import (
    Deformation,
    Dissipation,
    Load,
    PointFields,
    SummedDeformations,
    Term,
    needs_command,
)


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
    energies: tuple[Term, ...]
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
        names += [load.law_name for load in self.loads if needs_command(load)]
        names += ["gravity"] * (self.gravity is not None)
        return tuple(names + ["circular orbit"] * (self.orbit is not None))

    # ---- forces ----------------------------------------------------------------------------

    def point_forces(
        self, time: Instants, fields: PointFields, rates: PointFields
    ) -> tuple[PointFields, PerPoint | None, PointFields]:
        """At every quadrature point: what is conjugate to the fields (dW + dR - f), the power lost [W/m]
        (None where nothing dissipates), and the loads' part of the first, with its sign."""
        inner = [term.point_forces(time, fields, rates) for term in self.inner_terms]
        loads = [term.point_forces(time, fields, rates) for term in self.loads]
        lost = None
        if self.dissipations:
            lost = 2.0 * sum(term.density(fields, rates) for term in self.dissipations)
        return add_fields(inner + loads), lost, add_fields(loads)

    @property
    def inner_terms(self) -> tuple[Term, ...]:
        """Energies and dissipations, those of the shape together."""
        terms = (*self.energies, *self.dissipations)
        shaped = tuple(term for term in terms if isinstance(term, Deformation))
        others = tuple(term for term in terms if not isinstance(term, Deformation))
        return (SummedDeformations(shaped), *others) if shaped else others

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
        inertial = self.inertial(q, v, vdot)
        commanded = self.with_commanded_loads(time, q)
        tether, power = commanded.tether_forces(time, q.tether, v.tether, inertial.tether)
        return self.joined(time, q, v, Coordinates(tether, inertial.hub), lam, power)

    def residuals(
        self,
        times: Float[Array, " state"],
        q: Coordinates,
        v: Coordinates,
        vdot: Coordinates,
        lam: Multipliers,
    ) -> tuple[Residual, Power]:
        """`residual` of several states, along the first axis of everything: one evaluation of the
        tethers' forces, as if the tethers were as many times more."""
        inertial = jax.vmap(self.inertial)(q, v, vdot)
        nodal = (jnp.moveaxis(x.tether, 0, 2) for x in (q, v, inertial))
        system = self
        if self.controlled:
            system = self.with_commands(jax.vmap(self.commands)(times, q))
        tether, power = system.tether_forces(times[:, None], *nodal)
        forces = Coordinates(jnp.moveaxis(tether, 2, 0), inertial.hub)
        return jax.vmap(self.joined)(times, q, v, forces, lam, power)

    @property
    def controlled(self) -> bool:
        """Tells whether a control law has to be asked before forces can be evaluated."""
        return any(needs_command(load) for load in self.loads)

    def measurements(self, time: Scalar, q: Coordinates) -> Measurements:
        """The kinematic part of what control laws may measure at a state."""
        axes, nodes = self.rotation(time, q), q.tether[0]
        chords = nodes[:, -1] - nodes[:, 0]
        chords = chords / jnp.linalg.norm(chords, axis=0)
        return Measurements(time, axes[:, 0], axes @ self.roots.radial_directions, chords)

    def commands(self, time: Scalar, q: Coordinates) -> tuple[PerTether | None, ...]:
        """The command of every load's control law at a state; None for loads that need none."""
        measurements = self.measurements(time, q)
        return tuple(load.commanded(measurements) if needs_command(load) else None for load in self.loads)

    def with_commands(self, commands: tuple[Float[Array, "*state tether"] | None, ...]) -> "System":
        """The system whose loads have the given commands, as `commands` returns them."""
        loads = tuple(
            load if command is None else load.with_command(self.tethers.repeated(command))
            for load, command in zip(self.loads, commands, strict=True)
        )
        return eqx.tree_at(lambda system: system.loads, self, loads)

    def with_commanded_loads(self, time: Scalar, q: Coordinates) -> "System":
        """The system whose loads have the commands of a state."""
        return self.with_commands(self.commands(time, q)) if self.controlled else self

    def tether_forces(self, time: Instants, q: Nodal, v: Nodal, inertial: Nodal) -> tuple[Nodal, Power]:
        """M vdot - Q of the tethers, and the power of loads and dissipation, of one state or several."""
        tethers = self.tethers
        fields, rates = tethers.interpolate_motion(q, v)
        total, lost, loads = self.point_forces(time, fields, rates)
        forces = tethers.nodal_forces(total, inertial)
        external = dissipated = jnp.zeros(q.shape[2:-2])
        densities = [dot(loads.r, rates.r)] if self.loads else []
        densities += [] if lost is None else [lost]
        if len(densities) > 1:
            # Into memory: what is computed within a sum is not vectorised.
            densities = list(stacked([x[None] for x in densities]))
        powers = [self.integrate(x) for x in densities]
        if self.loads:
            external = -powers[0]
        if lost is not None:
            dissipated = powers[-1]
        return forces, Power(external, dissipated)

    def joined(
        self,
        time: Scalar,
        q: Coordinates,
        v: Coordinates,
        forces: Coordinates,
        lam: Multipliers,
        power: Power,
    ) -> tuple[Residual, Power]:
        """The residual from the tethers' forces and the hub's accelerations: inertia of the hub,
        constraints, power of the frame and of the acceleration field."""
        if self.hub is not None:
            forces = forces._replace(hub=matmul(self.hub.mass_matrix, forces.hub))
        constraints = Multipliers(None, None)
        if self.has_constraints:
            constraints, pull_back = jax.vjp(lambda q: self.constraints(time, q), q)
            forces = jax.tree.map(jnp.add, forces, pull_back(lam)[0])
        external = power.external + self.frame_power(time, q, v, forces, lam)
        if self.weighted:
            momentum = self.momenta(v)
            parts = jax.tree.map(lambda a, p: (a * p).sum(), self.field(q, v), momentum)
            external = external + sum(jax.tree.leaves(parts))
        return Residual(forces, constraints), power._replace(external=external)

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

    def integrate(self, density: Float[Array, "point *state element"]) -> Float[Array, "*state"]:
        """Integral over all tethers of a quantity per undeformed length."""
        weights = self.tethers.weights.reshape(-1, *(1,) * (density.ndim - 1))
        return ((weights * density).sum(0) * self.tethers.lengths).sum(-1)

    def momenta(self, v: Coordinates) -> Coordinates:
        """M v: momenta [kg m/s] conjugate to the coordinates."""
        hub = None if self.hub is None else matmul(self.hub.mass_matrix, v.hub)
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
                normals = self.roots.to_inertial(time, self.roots.normals)
            clamp = (normals * q.tether[1, :, 0]).sum(1) * self.tethers.element_length
        return Multipliers(hub, clamp)

    def no_multipliers(self) -> Multipliers:
        """lam = 0 in the layout of this system."""
        p = self.tethers.count
        hub = jnp.zeros(6) if self.hub is not None else None
        return Multipliers(hub, jnp.zeros((2, p)) if self.clamped else None)

    def constraint_acceleration(
        self, time: Scalar, q: Coordinates, v: Coordinates, vdot: Coordinates
    ) -> Multipliers:
        """d^2 Phi / dt^2 [m/s^2]. At zero acceleration it is minus the right-hand side of
        Phi_q vdot = Q_lam ([PGV] Eq. 1-2)."""

        def along(tau):
            return self.constraints(time + tau, q.axpy(tau, v).axpy(0.5 * tau**2, vdot))

        def rate(tau):
            return jax.jvp(along, (tau,), (jnp.ones_like(tau),))[1]

        zero = jnp.zeros(())
        return jax.jvp(rate, (zero,), (jnp.ones(()),))[1]

    # ---- attitude and roots ----------------------------------------------------------------

    def rotation(self, time: Scalar, q: Coordinates) -> Rotation:
        """C_B^I of the hub or of the turning frame."""
        if self.roots is None:
            return jnp.eye(3)
        return self.roots.rotation(time) if self.hub is None else self.hub.rotation(q.hub)

    def with_events_until(self, time: Scalar | np.ndarray) -> "System":
        """The system after `time`, with the roots released that nothing holds from then on."""
        if self.roots is None or self.roots.releases.release_time is None:
            return self
        return eqx.tree_at(lambda s: s.roots.releases, self, self.roots.releases.with_events_until(time))

    def place_roots(self, time: Scalar, q: Coordinates, derivative: int = 0) -> Coordinates:
        """q (or its rate or acceleration) with the root nodes where hub or frame put them."""
        if self.roots is None:
            return q
        if self.hub is not None:
            root = self.roots.positions(q.hub)
        else:
            root = self.roots.to_inertial(time, self.roots.anchors, derivative)
        root = self.roots.releases.where_released(q.tether[0, :, 0], root)
        return q._replace(tether=q.tether.at[0, :, 0].set(root))


def add_fields(parts: list[PointFields]) -> PointFields:
    """Sum of what several terms contribute; None where none does."""
    sums = []
    for values in zip(*parts, strict=True) if parts else ((),) * len(PointFields._fields):
        present = [value for value in values if value is not None]
        sums.append(sum(present[1:], present[0]) if present else None)
    return PointFields(*sums)
