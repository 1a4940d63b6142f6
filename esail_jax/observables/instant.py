"""`Instant`: the state of a sail at a saved instant, with quantities that several observables use."""

from collections.abc import Callable
from typing import Any, Generic, TypeVar, overload

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Maybe, Rotation, Scalar, Vector, VectorPerPoint
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.environment.kepler_orbit import KeplerOrbit, PlaceOnOrbit, at_place, tide
from esail_jax.environment.orbit import orbital_frame
from esail_jax.iteration_matrix import FactoredMass
from esail_jax.joints.roots import radial_directions
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.measurements import Measurements
from esail_jax.numerics.angles import smallest_eigenvector
from esail_jax.numerics.small_matrices import matmul
from esail_jax.numerics.vectors import dot
from esail_jax.point_fields import PointFields
from esail_jax.sensors import angular_velocity
from esail_jax.steppers.consistent import consistent_motion
from esail_jax.system import Power, System

Value = TypeVar("Value")


class once(Generic[Value]):
    """A property that is computed once for an object. A property is traced for every observable that uses
    it, which the compiler then has to find out. `functools.cached_property` has one lock for all objects
    with Python 3.11: threads that trace would wait for each other."""

    def __init__(self, function: Callable[[Any], Value]):
        self.function, self.__doc__ = function, function.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, instance: None, owner: type) -> "once[Value]": ...

    @overload
    def __get__(self, instance: object, owner: type) -> Value: ...

    def __get__(self, instance: Any, owner: type) -> Any:
        if instance is None:
            return self
        value = self.function(instance)
        instance.__dict__[self.name] = value
        return value


class Shift(eqx.Module):
    """The motion of the origin of the coordinates relative to the origin of the frame I, which moves on the
    orbit of the scene: position [m], velocity [m/s], acceleration [m/s^2]. All are zero until the orbit is
    rectified (`simulation/rectification.py`)."""

    position: Vector
    velocity: Vector
    acceleration: Vector

    @classmethod
    def between(
        cls, time: Scalar, place: PlaceOnOrbit, orbit: KeplerOrbit, scene_orbit: KeplerOrbit
    ) -> "Shift":
        """The shift at an instant, exactly zero if both orbits are the same numbers. place: that of the
        origin of the coordinates, on its orbit."""
        first, slow = scene_orbit.at(time)
        pairs = zip(*map(jax.tree.leaves, (orbit, scene_orbit)), strict=True)
        same = jnp.stack([(x == y).all() for x, y in pairs]).all()
        apart = place.position - first, place.velocity - slow
        position, velocity = (jnp.where(same, 0.0, x) for x in apart)
        return cls(position, velocity, tide(first, position))


class Instant(eqx.Module):
    """State of a sail at one saved instant, with quantities that several observables use.

    time [s], q, v, vdot, lam: the state, with the accelerations and multipliers that belong to it
    work: dissipated energy and external work since the start [J]
    start_energy: kinetic and elastic energy at the start [J]
    origin: heliocentric position [m] of the origin of the coordinates; origin_velocity: its velocity
    [m/s], None without an orbit
    forces: left-hand side of the equations of motion [N] without the reactions of the root joints
    power: dissipated and external power [W]
    load: Coulomb thrust at the quadrature points [N/m]; None without wind
    shift: how the origin of the coordinates moves relative to the origin of the frame I, on an orbit
    """

    system: System
    time: Scalar
    q: Coordinates
    v: Coordinates
    vdot: Coordinates
    lam: Multipliers
    work: Power
    start_energy: Scalar
    origin: Vector
    forces: Coordinates
    power: Power
    load: VectorPerPoint | None
    origin_velocity: Maybe[Vector] = None
    shift: Maybe[Shift] = None

    @once
    def sense(self) -> Scalar:
        """The sense of the spin: -1 if the sail as a whole turns about X_B in the left-handed sense,
        otherwise 1. The hub may turn back for a while, when tethers swing."""
        if self.system.hub is None:
            about_axis = angular_velocity(self.system, self.q, self.v)[0]
        else:
            momentum = self.system.angular_momentum(self.system.centred(self.q), self.v)
            about_axis = momentum @ self.rotation[:, 0]
        return jnp.where(about_axis < 0.0, -1.0, 1.0)

    @once
    def p(self) -> int:
        """Number of tethers."""
        return self.q.tether.shape[-1]

    @once
    def rotation(self) -> Rotation:
        """Rotation C_B^I of the hub."""
        return self.system.rotation(self.time, self.q)

    @once
    def centre(self) -> Vector:
        """Position of the hub centre O_B, or of the fixed centre of the rotating frame [m]."""
        return jnp.zeros(3) if self.system.hub is None else self.system.hub.centre(self.q.hub)

    def from_origin(self, r: VectorPerPoint) -> VectorPerPoint:
        """Positions relative to the origin of the frame I, from those in the coordinates [m]."""
        return r if self.shift is None else r + self.shift.position.reshape(3, *(1,) * (r.ndim - 1))

    @once
    def shift_energy(self) -> Scalar:
        """Kinetic energy [J] in the frame I minus that of the motion relative to the origin of the
        coordinates: w . p + m w^2/2, with the momentum p of the relative motion, the mass m of the sail,
        and the velocity w of the shift."""
        w = self.shift.velocity
        return w @ (self.system.momentum(self.v, self.q) + 0.5 * self.mass * w)

    @once
    def shift_power(self) -> Scalar:
        """Rate [W] of `shift_energy`."""
        w, rate = self.shift.velocity, self.shift.acceleration
        momentum, force = self.system.momentum(self.v), self.system.momentum(self.vdot)
        return rate @ (momentum + self.mass * w) + w @ force

    @once
    def mass(self) -> Scalar:
        """Mass of a sail with a hub [kg]."""
        return self.system.momentum(self.system.uniform(jnp.array([1.0, 0.0, 0.0])))[0]

    @once
    def measured(self) -> Measurements:
        """What control laws may measure."""
        return self.system.measurements(self.time, self.q, self.v)

    @once
    def heliocentric(self) -> tuple[Vector, Vector]:
        """Heliocentric position [m] and velocity [m/s] of the hub centre, on an orbit."""
        velocity = self.system.hub.centre(self.v.hub)
        return self.origin + self.centre, self.origin_velocity + velocity

    @once
    def orbital(self) -> Rotation:
        """Rotation C_O^I of the orbital frame at the hub's current position."""
        return orbital_frame(self.origin + self.centre)

    @once
    def body_to_orbital(self) -> Rotation:
        """Rotation C_B^O from the body frame to the orbital frame."""
        return matmul(self.orbital.T, self.rotation)

    @once
    def tips(self) -> Float[Array, "3 tether"]:
        """Positions of the tips [m]."""
        return self.q.tether[0, :, -1]

    @once
    def roots(self) -> Float[Array, "3 tether"]:
        """Positions of the roots [m]."""
        return self.q.tether[0, :, 0]

    @once
    def root_slopes(self) -> Float[Array, "3 tether"]:
        """Slopes r_x at the roots. A truss has those of its first elements."""
        nodal = self.q.tether
        if self.system.tethers.coefs == 2:
            return nodal[1, :, 0]
        return (nodal[0, :, 1] - nodal[0, :, 0]) / self.system.tethers.element_length

    @once
    def root_reactions(self) -> Float[Array, "3 tether"]:
        """Forces of the hub on the tethers [N], the root rows of M vdot - Q. While tethers are paid out,
        the force of the guide on the deployed part: without the reel and the flux of momentum into the
        tether."""
        rows, reels = self.forces.tether[0, :, 0], self.system.reels
        if reels is None:
            return rows
        stored = reels.tethers.line_density * (reels.payout.total - reels.now.length)
        share = reels.now.length / reels.payout.total
        flux = reels.tethers.line_density * reels.now.rate**2 * self.root_slopes / share
        return rows - stored * self.vdot.tether[0, :, 0] - flux

    @once
    def winch_forces(self) -> Float[Array, " tether"]:
        """Force F_w [N] of every winch."""
        return self.system.commanded_winch_forces(self.time, self.q, self.v, self.vdot)

    @once
    def root_couples(self) -> Float[Array, "3 tether"]:
        """Couples of the hub on clamped roots [N m]: r_x x (generalized force of the clamp on r_x)."""
        if not self.system.clamped:
            return jnp.zeros((3, self.p))
        pull = jax.vjp(lambda q: self.system.constraints(self.time, q), self.q)[1]
        held = pull(jax.tree.map(jnp.negative, self.lam))[0].tether[1, :, 0]
        return jnp.cross(self.root_slopes, held, axis=0)

    def local_frame(self, vectors: Float[Array, "3 tether"]) -> Float[Array, "3 tether"]:
        """The components of vectors in the frame Z of each tether's root, with the axes X_B,
        outward and azimuthal ([PGV] Eq. 57-58)."""
        body = matmul(self.rotation.T, vectors)
        azimuth = self.system.roots.azimuth
        if azimuth is None:
            azimuth = jnp.asarray(2.0 * np.pi * np.arange(self.p) / self.p)
        outward = radial_directions(azimuth)
        sideways = jnp.stack([0 * outward[0], -outward[2], outward[1]])
        return jnp.stack([body[0], dot(outward, body), dot(sideways, body)])

    def thrust_nodal(self) -> Float[Array, "coef 3 node tether"]:
        """The generalized Coulomb forces on the nodes ([PGV] Eq. 34)."""
        if self.load is None:
            return jnp.zeros_like(self.q.tether)
        return self.system.tethers.nodal_forces(PointFields(self.load, None))

    def thrusts(self) -> Float[Array, "3 tether"]:
        """The thrust F_c of each tether [N]."""
        return self.thrust_nodal()[0].sum(1)

    def thrust_moments(self) -> Float[Array, "3 tether"]:
        """The moment of the thrust about each root [N m], from nodal forces *and* slope forces."""
        nodal = self.thrust_nodal()
        arms = self.q.tether[0] - self.roots[:, None]
        moment = jnp.cross(arms, nodal[0], axis=0)
        if self.system.tethers.coefs == 2:
            moment = moment + jnp.cross(self.q.tether[1], nodal[1], axis=0)
        return moment.sum(1)

    def sail_axes(self) -> Rotation:
        """The rotation C_E^I to the mean plane of the tips ([PGV] Eq. 67-70). Released tethers do
        not count; the result is NaN if fewer than three are held."""
        nothing = jnp.full((3, 3), jnp.nan)
        if self.p < 3:
            return nothing
        tips = self.tips
        held: int | Scalar = self.p
        released = None if self.system.roots is None else self.system.roots.releases.released
        if released is not None:
            # Released tips are moved to the mean, where they have no effect on the plane.
            held = self.p - released.sum()
            mean = jnp.where(released, 0.0, tips).sum(1, keepdims=True) / held
            tips = jnp.where(released, mean, tips)
        offsets = tips - tips.mean(1, keepdims=True)
        normal = smallest_eigenvector(offsets @ offsets.T)
        normal = normal * jnp.where(normal @ self.rotation[:, 0] < 0.0, -1.0, 1.0)
        first = 0 if released is None else jnp.argmin(released)
        k = jnp.cross(normal, offsets[:, first])
        k = k / jnp.linalg.norm(k)
        return jnp.where(held < 3, nothing, jnp.stack([normal, jnp.cross(k, normal), k], axis=1))


def make_instant(
    system: System,
    origin: Vector,
    time: Scalar,
    q: Coordinates,
    v: Coordinates,
    work: Power,
    start_energy: Scalar,
    mass: FactoredMass | None = None,
    scene_orbit: KeplerOrbit | None = None,
) -> Instant:
    """The instant of a state, with the accelerations and multipliers that belong to the state.

    mass: factors of the mass matrix, as in `consistent_motion`; scene_orbit: the orbit about the Sun on
    which the origin of I moves."""
    velocity = shift = None
    if scene_orbit is not None and isinstance(system.kepler_orbit, KeplerOrbit):
        place = PlaceOnOrbit(*system.kepler_orbit.at(time))
        shift = Shift.between(time, place, system.kepler_orbit, scene_orbit)
        system, origin, velocity = at_place(system, place), place.position, place.velocity
    vdot, lam, forces, power = consistent_motion(system, time, q, v, mass)
    system = system.paid_out(time, q, v, vdot)
    load: VectorPerPoint | None = None
    commanded = system.with_commanded_loads(time, q, v)
    place_of = [i for i, x in enumerate(commanded.loads) if isinstance(x, CoulombThrust)]
    if place_of:
        thrust = commanded.acting_loads[place_of[0]]
        fields, rates = system.tethers.interpolate(q.tether), system.tethers.interpolate(v.tether)
        load = thrust.force(time, fields, rates)
    start = (work, start_energy, origin)
    return Instant(system, time, q, v, vdot, lam, *start, forces, power, load, velocity, shift)
