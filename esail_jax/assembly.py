"""The assembly: the parts of a scene's model, with its inertia, constraints and attitude. Holds no physics.

An absent part leaves no trace in the compiled program.
"""

import equinox as eqx
import jax
import jax.numpy as jnp

from esail_jax.array_types import Instants, Maybe, Rotation, Scalar, Vector
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.elements.axial import TensionOnlyEnergy
from esail_jax.elements.deployment import AbstractPayout, DeployedDissipation, DeployedEnergy, Reels
from esail_jax.elements.rigid_body import Body
from esail_jax.elements.ring import Ring
from esail_jax.elements.tether import TetherBatch
from esail_jax.environment.kepler_orbit import KeplerOrbit, PlaceOnOrbit
from esail_jax.joints.roots import FrameRoots, HubRoots
from esail_jax.numerics.small_matrices import matmul
from esail_jax.terms import Dissipation, Field, HubLoad, Load, Term, TipLoad, WinchLaw, has_law


class Assembly(eqx.Module):
    """Tethers, the terms that act on them, and the roots that hold them.

    roots: None if nothing holds the tethers. hub: None for a turning frame or a chain. fields:
    accelerations of everything that has mass. ring: auxiliary tethers between the tips. tip_loads: forces
    on the remote units. hub_loads: forces and torques on the hub. kepler_orbit: path about the Sun of the
    origin of the coordinates, whose axes do not turn. Absent parts are None, or empty. parts: names of the
    tables and keys of the scene, on which depends what is observed. winch_laws: what motors of winches hold
    beside their table. payout: how tethers are paid out; reels: those of an instant, of a system at this
    instant (`System.at`)."""

    tethers: TetherBatch
    roots: Maybe[HubRoots | FrameRoots]
    hub: Maybe[Body]
    energies: tuple[Term, ...]
    dissipations: tuple[Dissipation, ...]
    loads: tuple[Load, ...]
    fields: tuple[Field, ...] = ()
    ring: Maybe[Ring] = None
    tip_loads: tuple[TipLoad, ...] = ()
    hub_loads: tuple[HubLoad, ...] = ()
    kepler_orbit: Maybe[KeplerOrbit | PlaceOnOrbit] = None
    winch_laws: tuple[WinchLaw, ...] = ()
    parts: tuple[str, ...] = eqx.field(static=True, default=())
    payout: AbstractPayout | None = None
    reels: Reels | None = None

    # ---- parts -----------------------------------------------------------------------------

    @property
    def clamped(self) -> bool:
        """Tells whether the roots are clamped."""
        return self.roots is not None and self.roots.normals is not None

    def place(self, time: Instants) -> Maybe[PlaceOnOrbit]:
        """Place of the moving origin of I at one or several instants [s]; None without an orbit."""
        return None if self.kepler_orbit is None else PlaceOnOrbit(*self.kepler_orbit.at(time))

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of all parts that were built. Run files and `esail info` list them."""
        if self.tethers.kind == "rod":
            names = ["free chain" if self.roots is None else "fixed anchor", "rods"]
        else:
            names = [
                "hub" if self.hub is not None else "turning frame",
                f"{self.tethers.kind} elements",
                "clamped roots" if self.clamped else "pinned roots",
            ]
        names += [term.name for term in (*self.energies, *self.dissipations, *self.loads)]
        if self.ring is not None:
            slack = any(isinstance(term, TensionOnlyEnergy) for term in self.ring.energies)
            behaviour = ", tension only" if slack else ""
            names.append(f"auxiliary tethers ({self.ring.segments.kind}{behaviour})")
            names += [f"auxiliary {term.name}" for term in self.ring.dissipations]
        names += [load.law_name for load in self.loads if has_law(load)]
        if self.payout is not None:
            names.append("deployment")
        others = (*self.tip_loads, *self.hub_loads, *self.fields, *self.winch_laws)
        names += [term.name for term in others]
        return tuple(names)

    @property
    def acting_energies(self) -> tuple[Term, ...]:
        """The energies per unit of x: of tethers that are paid out, those of the deployed part."""
        if self.reels is None:
            return self.energies
        return tuple(DeployedEnergy(x, self.reels.stretching.share) for x in self.reels.energies)

    @property
    def acting_dissipations(self) -> tuple[Dissipation, ...]:
        """The dissipations per unit of x."""
        if self.reels is None:
            return self.dissipations
        s = self.reels.stretching
        return tuple(DeployedDissipation(x, s.share, s.relative_rate) for x in self.reels.dissipations)

    @property
    def has_unknown_lengths(self) -> bool:
        """Tells whether deployed lengths are unknowns."""
        return self.payout is not None and self.payout.unknown

    # ---- inertia ----------------------------------------------------------------------------

    def momenta(self, v: Coordinates, q: Coordinates | None = None) -> Coordinates:
        """Momenta M v [kg m/s] conjugate to the coordinates. q: positions, which matter while tethers are
        paid out (`System.at`): their material moves through the mesh; without them v is any field."""
        hub = None if self.hub is None else matmul(self.hub.mass_matrix, v.hub)
        momenta = self.member_inertia(v)._replace(hub=hub)
        if self.reels is None or q is None:
            return momenta
        return momenta._replace(tether=momenta.tether + self.reels.drift(q.tether))

    def member_inertia(self, acceleration: Coordinates) -> Coordinates:
        """Inertia forces M `acceleration` of tethers and ring; the parts of hub and lengths are the
        accelerations themselves."""
        tether, own = self.tethers.inertia(acceleration.tether), None
        if self.ring is not None:
            tips, own = self.ring.inertia(acceleration)
            tether = tether.at[0, :, -1].add(tips)
        return Coordinates(tether, acceleration.hub, own, acceleration.reel)

    def momentum(self, v: Coordinates, q: Coordinates | None = None) -> Vector:
        """Total linear momentum [kg m/s]. q: as for `momenta`."""
        momenta = self.momenta(v, q)
        total = momenta.tether[0].sum((1, 2))
        if momenta.ring is not None:
            points = self.ring.uniform(jnp.ones(3))
            total = total + (points * momenta.ring).sum((1, 2))
        return total if momenta.hub is None else total + momenta.hub.sum(0)

    def uniform(self, vector: Vector) -> Coordinates:
        """Coordinates of a uniform displacement of a sail with a hub."""
        ring = None if self.ring is None else self.ring.uniform(vector)
        reel = jnp.zeros(self.tethers.count) if self.has_unknown_lengths else None
        return Coordinates(self.tethers.uniform(vector), jnp.broadcast_to(vector, (4, 3)), ring, reel)

    def mean(self, x: Coordinates) -> Vector:
        """Position, velocity or acceleration of the centre of mass of a sail with a hub."""
        return self.momentum(x) / self.momentum(self.uniform(jnp.array([1.0, 0.0, 0.0])))[0]

    def centred(self, x: Coordinates) -> Coordinates:
        """Coordinates relative to the centre of mass, or rates relative to its velocity, with a hub.

        Those relative to the hub are taken first, so that few digits are lost far from the origin."""
        x = x.axpy(-1.0, self.uniform(self.hub.centre(x.hub)))
        return x.axpy(-1.0, self.uniform(self.mean(x)))

    def angular_momentum(self, q: Coordinates, v: Coordinates) -> Vector:
        """Angular momentum [kg m^2/s] about the origin of the positions q, of a sail with a hub."""
        p = self.momenta(v, q)
        total = jnp.cross(q.tether, p.tether, axis=1).sum((0, 2, 3)) + jnp.cross(q.hub, p.hub).sum(0)
        return total if q.ring is None else total + jnp.cross(q.ring, p.ring, axis=0).sum((1, 2))

    # ---- constraints -----------------------------------------------------------------------

    @property
    def has_constraints(self) -> bool:
        """Tells whether there are multipliers: those of a hub or of clamped roots."""
        return self.hub is not None or self.clamped

    def constraints(self, time: Scalar, q: Coordinates) -> Multipliers:
        """Constraints Phi(t, q) [m], in the layout of their multipliers."""
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
        """Multipliers lam = 0, in the layout of this system."""
        p = self.tethers.count
        hub = jnp.zeros(6) if self.hub is not None else None
        return Multipliers(hub, jnp.zeros((2, p)) if self.clamped else None)

    def constraint_acceleration(
        self, time: Scalar, q: Coordinates, v: Coordinates, vdot: Coordinates
    ) -> Multipliers:
        """Second time derivative d^2 Phi / dt^2 [m/s^2] of the constraints. At zero acceleration it is
        minus the right-hand side of Phi_q vdot = Q_lam ([PGV] Eq. 1-2)."""

        def along(tau):
            return self.constraints(time + tau, q.axpy(tau, v).axpy(0.5 * tau**2, vdot))

        def rate(tau):
            return jax.jvp(along, (tau,), (jnp.ones_like(tau),))[1]

        zero = jnp.zeros(())
        return jax.jvp(rate, (zero,), (jnp.ones(()),))[1]

    # ---- attitude and roots ----------------------------------------------------------------

    def rotation(self, time: Scalar, q: Coordinates) -> Rotation:
        """Attitude C_B^I of the hub or of the turning frame; the identity if nothing holds the tethers."""
        if self.roots is None:
            return jnp.eye(3)
        return self.roots.rotation(time) if self.hub is None else self.hub.rotation(q.hub)

    def place_roots(self, time: Scalar, q: Coordinates, derivative: int = 0) -> Coordinates:
        """q with the root nodes at their points of the hub or of the frame. derivative: 1 or 2 if `q` holds
        velocities or accelerations. Released roots keep their own."""
        if self.roots is None:
            return q
        if self.hub is not None:
            root = self.roots.positions(q.hub)
        else:
            root = self.roots.to_inertial(time, self.roots.anchors, derivative)
        root = self.roots.releases.where_released(q.tether[0, :, 0], root)
        return q._replace(tether=q.tether.at[0, :, 0].set(root))
