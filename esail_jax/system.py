"""The system: sum of the terms of a scene, with their forces, power and residual. Holds no physics.

    M v' + Phi_q^T lam - Q(t, q, v) = 0,      Phi(t, q) = 0

Every function loops over the terms that are present; an absent term leaves no trace in the compiled
program.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp

from esail_jax.array_types import (
    Array,
    Bool,
    Float,
    HubPoints,
    Instants,
    Maybe,
    Nodal,
    PerPoint,
    PerTether,
    Scalar,
    Vector,
)
from esail_jax.commanded_assembly import CommandedAssembly
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.elements.axial import AbstractAxialEnergy
from esail_jax.elements.deployment import (
    Convection,
    DeployedEnergy,
    DeployedMaterial,
    ScheduledPayout,
    density_of,
    deployed_load,
)
from esail_jax.elements.thermal import ThermalEnergy
from esail_jax.environment.kepler_orbit import PlaceOnOrbit, at_place
from esail_jax.numerics.small_matrices import matmul
from esail_jax.numerics.vectors import dot, stacked, total_of
from esail_jax.point_fields import PointFields, add_fields
from esail_jax.terms import (
    Energy,
    HubMotion,
    LinearField,
    Load,
    Term,
    find_term,
    inner_terms_of,
)


class Power(NamedTuple):
    """Power [W]: external is that of loads, acceleration field and turning frame; dissipated is that of the
    dissipations; winch is that of the reels, None without any. Also the work [J] that is its integral over
    time."""

    external: Scalar
    dissipated: Scalar
    winch: Scalar | None = None


class Residual(NamedTuple):
    """Left-hand sides of the equations of motion and of the constraints.

    forces: equations of motion [N] (slope rows [N m]). The reactions of the root joints are left out, so
    that the rows of the root nodes are those reactions. constraints: Phi [m].
    """

    forces: Coordinates
    constraints: Multipliers


class System(CommandedAssembly):
    """The equations of motion of an assembly: its forces, power and residual."""

    @property
    def no_power(self) -> Power:
        """Powers that are zero, in the form that this system has."""
        zero = jnp.zeros(())
        return Power(zero, zero, None if self.payout is None else zero)

    # ---- forces ----------------------------------------------------------------------------

    def point_forces(
        self, time: Instants, fields: PointFields, rates: PointFields
    ) -> tuple[PointFields, Maybe[PerPoint], PointFields]:
        """Forces at every quadrature point: the sum of all terms, conjugate to the fields (dW + dR - f);
        the dissipated power [W/m], None without dissipation; and the loads' part of the sum, -f."""
        inner = [term.point_forces(time, fields, rates) for term in self.inner_terms]
        loads = [term.point_forces(time, fields, rates) for term in self.acting_loads]
        dissipated = None
        if self.dissipations:
            dissipated = 2.0 * total_of(term.density(fields, rates) for term in self.acting_dissipations)
        return add_fields(inner + loads), dissipated, add_fields(loads)

    @property
    def inner_terms(self) -> tuple[Term, ...]:
        """Energies and dissipations, those that are functions of the invariants as one summed term; and
        what moves material through the mesh while tethers are paid out."""
        if self.reels is None:
            return self.material_terms
        matrices = [field.matrices[1] for field in self.fields if isinstance(field, LinearField)]
        turning = sum(matrices[1:], matrices[0]) if matrices else None
        return (*self.material_terms, Convection(self.reels.density, self.reels.stretching, turning))

    @property
    def material_terms(self) -> tuple[Term, ...]:
        """Energies and dissipations; those that are functions of the invariants as one summed term."""
        if self.reels is None:
            return inner_terms_of(self.energies, self.dissipations)
        terms = inner_terms_of(self.reels.energies, self.dissipations)
        return tuple(DeployedMaterial(term, self.reels.stretching) for term in terms)

    def axial_energy(
        self, times: Float[Array, " time"], lengths: Float[Array, "time tether"] | None
    ) -> Energy:
        """The axial energy per unit of x at several instants. lengths: those that are unknowns."""
        axial = find_term(self.energies, AbstractAxialEnergy).at(times[:, None])
        if self.payout is None:
            return axial
        if isinstance(self.payout, ScheduledPayout):
            lengths = self.payout.at(times[:, None]).length
        share = cast(Array, lengths) / self.payout.total
        return DeployedEnergy(axial, self.tethers.repeat_per_element(share))

    @property
    def acting_loads(self) -> tuple[Load, ...]:
        """The loads per unit of x."""
        if self.reels is None:
            return self.loads
        return tuple(deployed_load(load, self.reels.stretching) for load in self.loads)

    def field(self, time: Scalar, q: Coordinates, v: Coordinates) -> Coordinates:
        """Acceleration [m/s^2] of a free particle at every node and hub point: the sum of the acceleration
        fields. Between nodes it is interpolated, which is exact for fields that are linear in position."""
        hub, ring = None if q.hub is None else jnp.zeros_like(q.hub), None
        tether = jnp.zeros_like(q.tether)
        if q.ring is not None:
            ring = jnp.zeros_like(q.ring)
            segments = self.ring.nodal(q), self.ring.nodal(v)
        for field in self.fields:
            tether = tether + field.at_nodes(time, q.tether, v.tether)
            hub = None if hub is None else hub + field.acceleration(time, q.hub.T, v.hub.T).T
            ring = None if ring is None else ring + self.ring.own_of_nodal(field.at_nodes(time, *segments))
        return Coordinates(tether, hub, ring, None if q.reel is None else jnp.zeros_like(q.reel))

    def field_gradients(
        self, time: Scalar, q: Coordinates, v: Coordinates
    ) -> tuple[Float[Array, "3 3"], Float[Array, "3 3"]] | None:
        """Gradients by position [1/s^2] and velocity [1/s] of the sum of the acceleration fields, at the
        first root; None if there are none to speak of."""
        at = time, q.tether[0, :, 0, 0], v.tether[0, :, 0, 0]
        parts = [x for x in (field.gradients(*at) for field in self.fields) if x is not None]
        return jax.tree.map(lambda *x: sum(x[1:], x[0]), *parts) if parts else None

    def relative_to_free_fall(
        self, time: Scalar, q: Coordinates, v: Coordinates, vdot: Coordinates
    ) -> Coordinates:
        """vdot minus the acceleration field, so that weight is part of the inertia forces."""
        return vdot.axpy(-1.0, self.field(time, q, v)) if self.fields else vdot

    def residual(
        self, time: Scalar, q: Coordinates, v: Coordinates, vdot: Coordinates, lam: Multipliers
    ) -> tuple[Residual, Power]:
        """Residual of the equations of motion and constraints at one state, and the power of its forces."""
        residual, power = self.rows(time, q, v, vdot, lam)
        return self.with_moved_reactions(residual), power

    def rows(
        self, time: Scalar, q: Coordinates, v: Coordinates, vdot: Coordinates, lam: Multipliers
    ) -> tuple[Residual, Power]:
        """`residual` and power as functions of the state alone, which are linear in vdot and lam."""
        system = self.at(time, q, v, vdot)
        inertial = system.relative_to_free_fall(time, q, v, vdot)
        commanded = system.with_commanded_loads(time, q, v)
        forces, power = commanded.member_forces(time, q, v, inertial)
        residual, power = system.complete_residual(time, q, v, forces, lam, power)
        if self.payout is not None:
            power, rows = system.of_winches(time, q, v, vdot, power)
            residual = residual._replace(forces=residual.forces._replace(reel=rows))
        return residual, power

    def residuals(
        self,
        times: Float[Array, " state"],
        q: Coordinates,
        v: Coordinates,
        vdot: Coordinates,
        lam: Multipliers,
    ) -> tuple[Residual, Power]:
        """`residual` of several states, which are the first axis of every argument.

        The tethers' forces are evaluated once, with the states as a batch axis of the elements.
        """
        place = self.place(times)

        def of_every_state(method: Callable[..., Any], *of_states: Any) -> Any:
            def of_one(place: PlaceOnOrbit | None, motion: Any, time: Scalar, *of_state: Any) -> Any:
                return method(at_place(self, place).paid_out(time, *motion), time, *of_state)

            return jax.vmap(of_one, (-1, *(0,) * (1 + len(of_states))))(place, (q, v, vdot), *of_states)

        inertial = of_every_state(type(self).relative_to_free_fall, times, q, v, vdot)
        motion = [states_inside(x) for x in (q, v, inertial)]
        system = at_place(self, place).paid_out(times[:, None], q, v, vdot)
        if self.controlled:
            system = system.with_commands(of_every_state(type(self).commands, times, q, v))
        members, power = system.member_forces(times[:, None], *motion)
        ring = None if members.ring is None else jnp.moveaxis(members.ring, 1, 0)
        forces = Coordinates(jnp.moveaxis(members.tether, 2, 0), inertial.hub, ring, members.reel)
        rows, power = of_every_state(type(self).complete_residual, times, q, v, forces, lam, power)
        if self.payout is not None:
            inside = states_inside(vdot).tether
            fall = inside - motion[2].tether if self.fields else None
            winches = system.winch_forces(times[:, None], motion[0].tether, motion[1].tether, inside, fall)
            power = power._replace(winch=-(system.reels.now.rate * winches).sum(-1))
            if self.has_unknown_lengths:
                motor = of_every_state(type(self).motor_tension, times, q, v)
                reel = system.rows_of_lengths(winches, motor)
                rows = rows._replace(forces=rows.forces._replace(reel=reel))
        return jax.vmap(self.with_moved_reactions)(rows), power

    def of_winches(
        self, time: Scalar, q: Coordinates, v: Coordinates, vdot: Coordinates, power: Power
    ) -> tuple[Power, PerTether | None]:
        """The power with that of the winches, -l' F_w, of a system at an instant; and the left-hand sides
        of the equations of the lengths that are unknowns, None for given ones."""
        forces = self.commanded_winch_forces(time, q, v, vdot)
        power = power._replace(winch=-(self.reels.now.rate * forces).sum())
        if not self.has_unknown_lengths:
            return power, None
        return power, self.rows_of_lengths(forces, self.motor_tension(time, q, v))

    def within_lengths(self, q: Coordinates) -> Bool[Array, ""] | None:
        """Tells whether lengths that are unknowns are neither those of tethers that are paid out to their
        end nor of tethers that are reeled in; None for given lengths."""
        return self.payout.within(q.reel).all() if self.has_unknown_lengths else None

    def rows_of_lengths(
        self, winch_forces: Float[Array, "*state tether"], motor_tension: Float[Array, "*state tether"]
    ) -> Float[Array, "*state tether"]:
        """The left-hand sides [N] of the equations of the lengths, of a system at one or several
        instants."""
        density = density_of(self.reels.tethers)
        return self.payout.rows(self.reels.now, winch_forces, motor_tension, density)

    def motor_tension(self, time: Scalar, q: Coordinates, v: Coordinates) -> PerTether:
        """The tension F [N] that every motor holds: that of the table and of all laws."""
        parts = [] if self.payout.tension is None else [self.payout.tension.at(time)]
        if self.winch_laws:
            measured = self.all_measurements(time, q, v)
            parts += [law.tension(measured) for law in self.winch_laws]
        return sum(parts[1:], parts[0])

    def motor_gains(self, time: Scalar, q: Coordinates, v: Coordinates) -> tuple[PerTether, PerTether]:
        """The derivatives of the tensions that motors hold by the length [N/m] and the rate [N s/m] of
        their own tether; those by anything else are left to iterations."""
        measured = self.all_measurements(time, q, v)

        def held(length, rate):
            now = measured._replace(deployed_length=length, payout_rate=rate)
            return sum((law.tension(now) for law in self.winch_laws), jnp.zeros_like(length))

        gains = jax.jacfwd(held, (0, 1))(measured.deployed_length, measured.payout_rate)
        return jax.tree.map(jnp.diagonal, gains)

    def commanded_winch_forces(
        self, time: Scalar, q: Coordinates, v: Coordinates, vdot: Coordinates
    ) -> PerTether:
        """Force F_w [N] of every winch at a state, of a system at that instant."""
        system = self.with_commanded_loads(time, q, v)
        fall = self.field(time, q, v).tether if self.fields else None
        return system.winch_forces(time, q.tether, v.tether, vdot.tether, fall)

    def winch_forces(
        self, time: Instants, q: Nodal, v: Nodal, vdot: Nodal, fall: Nodal | None
    ) -> Float[Array, "*state tether"]:
        """Force F_w [N] of every winch at one or several states, of a system at those instants whose loads
        have their commands. fall: accelerations of the fields at the nodes; None without fields."""
        reels = self.reels
        fields, rates = reels.tethers.interpolate_motion(q, v)
        pushed = jnp.zeros_like(fields.r_x)
        for load in self.acting_loads:
            pushed = pushed - load.point_forces(time, fields, rates).r
        if fall is not None:
            pushed = pushed + reels.density * reels.stretching.share * reels.tethers.interpolate(fall).r
        return reels.winch_forces(q, v, vdot, pushed)

    def field_power(self, time: Scalar, q: Coordinates, v: Coordinates) -> Scalar:
        """Power [W] of the acceleration fields. While tethers are paid out, the velocity v is not all of
        that of the material: there is no power in what a field adds across the velocity, which is left
        out."""
        moving = v if self.reels is None else jax.tree.map(jnp.zeros_like, v)
        momenta = self.momenta(v, q)
        parts = jax.tree.map(lambda a, p: (a * p).sum(), self.field(time, q, moving), momenta)
        return sum(jax.tree.leaves(parts), jnp.zeros(()))

    def member_forces(
        self, time: Instants, q: Coordinates, v: Coordinates, inertial: Coordinates
    ) -> tuple[Coordinates, Power]:
        """M vdot - Q of tethers and ring, and the power of loads and dissipations, for one or several
        states. The hub's part is that of `inertial`."""
        tether, power = self.tether_forces(time, q.tether, v.tether, inertial.tether)
        if self.ring is None:
            return Coordinates(tether, inertial.hub, reel=inertial.reel), power
        ring_forces = self.ring.forces(q, v, inertial)
        tether = tether.at[0, ..., -1, :].add(ring_forces.tips)
        power = power._replace(dissipated=power.dissipated + ring_forces.dissipated)
        return Coordinates(tether, inertial.hub, ring_forces.own), power

    def tether_forces(self, time: Instants, q: Nodal, v: Nodal, inertial: Nodal) -> tuple[Nodal, Power]:
        """M vdot - Q of the tethers, and the power of loads and dissipations, for one or several states."""
        tethers = self.tethers
        fields, rates = tethers.interpolate_motion(q, v)
        total, dissipated_density, loads = self.point_forces(time, fields, rates)
        forces = tethers.nodal_forces(total, inertial)
        external = dissipated = jnp.zeros(q.shape[2:-2])
        densities = []
        if self.loads:
            velocity = rates.r if self.reels is None else self.reels.velocity(fields, rates)
            densities.append(dot(loads.r, velocity))
        densities += [] if dissipated_density is None else [dissipated_density]
        for term in self.energies:
            part = term.thermal_part(time)
            if isinstance(term, ThermalEnergy) and self.reels is not None:
                densities.append(-self.reels.heating(term, time, fields, rates))
            elif part is not None:
                densities.append(-dot(part.point_forces(time, fields, rates).r_x, rates.r_x))
        if len(densities) > 1:
            # Stacked into memory: the compiler does not vectorise what it computes inside a sum.
            densities = list(stacked([x[None] for x in densities]))
        powers = [self.integrate(x) for x in densities]
        if self.loads:
            external = -powers.pop(0)
        if dissipated_density is not None:
            dissipated = powers.pop(0)
        return forces, Power(sum(powers, external), dissipated)

    def complete_residual(
        self,
        time: Scalar,
        q: Coordinates,
        v: Coordinates,
        forces: Coordinates,
        lam: Multipliers,
        power: Power,
    ) -> tuple[Residual, Power]:
        """The residual, from the tethers' forces and the hub's accelerations in `forces`.

        Adds the inertia of the hub, the forces on remote units and hub, the constraints and their forces,
        and the power of those forces, of the turning frame and of the acceleration fields.
        """
        if self.hub is not None:
            forces = forces._replace(hub=matmul(self.hub.mass_matrix, forces.hub))
        external = power.external
        if self.tip_loads:
            pushed = self.tip_forces(time, q, v)
            forces = forces._replace(tether=forces.tether.at[0, :, -1].add(-pushed))
            external = external + (pushed * v.tether[0, :, -1]).sum()
        if self.hub_loads:
            pushed = self.hub_forces(time, q, v)
            forces = forces._replace(hub=forces.hub - pushed)
            external = external + (pushed * v.hub).sum()
        constraints = Multipliers(None, None)
        if self.has_constraints:
            constraints, pull_back = jax.vjp(lambda q: self.constraints(time, q), q)
            forces = jax.tree.map(jnp.add, forces, pull_back(lam)[0])
        external = external + self.frame_power(time, q, v, forces, lam)
        if self.fields:
            external = external + self.field_power(time, q, v)
        return Residual(forces, constraints), power._replace(external=external)

    def with_moved_reactions(self, residual: Residual) -> Residual:
        """A residual for the derivative of an implicit function: where the places of the roots are numbers
        of their own, with the derivative of what a solver adds to it (`roots.moved_reactions`)."""
        if self.hub is None or self.roots.azimuth is None:
            return residual
        added = self.roots.moved_reactions(residual.forces.tether[0, :, 0])
        return residual._replace(forces=residual.forces._replace(hub=residual.forces.hub + added))

    def tip_forces(self, time: Scalar, q: Coordinates, v: Coordinates) -> Float[Array, "3 tether"]:
        """Forces [N] on the remote units: the sum of the loads on them."""
        everything = any(term.measures_motion for term in self.tip_loads)
        measured = self.all_measurements(time, q, v) if everything else self.directions(time, q, v)
        parts = [term.force(measured) for term in self.tip_loads]
        return sum(parts[1:], parts[0])

    def hub_forces(self, time: Scalar, q: Coordinates, v: Coordinates) -> HubPoints:
        """Forces [N] on the hub's points: those of the loads on the hub. For a force F and a torque T they
        have the power F . v + T . omega of both in every motion."""
        motion = self.hub_motion(time, q, v)
        wrenches = [term.wrench(motion) for term in self.hub_loads]
        wrench = jax.tree.map(lambda *x: sum(x[1:], x[0]), *wrenches)

        def rates(velocities: HubPoints) -> tuple[Vector, Vector]:
            return self.hub.centre(velocities), self.hub.angular_velocity(q.hub, velocities)

        return jax.vjp(rates, v.hub)[1](wrench)[0]

    def hub_motion(self, time: Scalar, q: Coordinates, v: Coordinates) -> HubMotion:
        """The motion of the hub, for the loads on it."""
        hub, heliocentric = self.hub, None
        if self.kepler_orbit is not None:
            heliocentric = self.kepler_orbit.at(time)[0] + hub.centre(q.hub)
        rates = hub.angular_velocity(q.hub, v.hub), heliocentric
        return HubMotion(time, hub.centre(q.hub), hub.centre(v.hub), hub.rotation(q.hub), *rates)

    def frame_power(
        self, time: Scalar, q: Coordinates, v: Coordinates, forces: Coordinates, lam: Multipliers
    ) -> Scalar:
        """Power [W] of a turning frame: root reactions times root velocities, and for clamped roots
        mu . (partial Phi / partial t), the power of a moving constraint. Zero with a hub."""
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


def states_inside(x: Coordinates) -> Coordinates:
    """Coordinates of several states, the first axis, with this axis where elements expect it."""
    ring = None if x.ring is None else jnp.moveaxis(x.ring, 0, 1)
    return Coordinates(jnp.moveaxis(x.tether, 0, 2), x.hub, ring, x.reel)
