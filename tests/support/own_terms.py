"""Terms as users write them, for tests. `esail run --terms` reads this file, too."""

import jax.numpy as jnp

from esail_jax.array_types import Array
from esail_jax.physics import Dissipation, Energy, Field, HubLoad, Load, TipLoad

SAIL = {
    "tethers.count": 3,
    "tethers.elements": 1,
    "integrator.t_end": 20.0,
    "output.interval": 4.0,
}
"""A small sail of cables with bending."""

NO_WIND = {"solar_wind": None, "voltage": None}


class Wrench(HubLoad):
    """A force [N] and a torque [N m] that are constant in I."""

    force: Array
    torque: Array

    def wrench(self, hub):
        return self.force, hub.rotation.T @ self.torque


class Thrust(Load):
    """Coulomb thrust of a wind that blows away from the Sun with a speed u [m/s], with sigma/u [N s/m^2] of
    every tether. origin: heliocentric position of the origin of I [m]."""

    origin: Array
    speed: Array
    strength: Array

    def force(self, time, fields, rates):
        away = self.origin.reshape(3, *(1,) * (fields.r.ndim - 1)) + fields.r
        u = self.speed * away / jnp.sqrt((away**2).sum(0))
        along = (fields.r_x * u).sum(0) / (fields.r_x**2).sum(0)
        return self.strength * (u - along * fields.r_x)


class Weight(Field):
    """Uniform gravity g [m/s^2]."""

    g: Array

    def acceleration(self, time, position, velocity):
        return jnp.broadcast_to(self.g.reshape(3, *(1,) * (position.ndim - 1)), position.shape)


class Turning(Field):
    """The field of a circular orbit with the mean motion n [rad/s], with the laws of Hill."""

    n: float = 1e-3

    def acceleration(self, time, position, velocity):
        x, _, z = position
        vx, vy, _ = velocity
        n = self.n
        return jnp.stack([2.0 * n * vy + 3.0 * n**2 * x, -2.0 * n * vx, -(n**2) * z])


class AxialPush(TipLoad):
    """A force [N] along the spin axis on every remote unit."""

    size: Array

    def force(self, measurements):
        return self.size * jnp.broadcast_to(measurements.spin_axis[:, None], measurements.chords.shape)


class Stiffening(Energy):
    """A further axial stiffness EA [N], in the Green-Lagrange strain."""

    stiffness: Array

    def deformation(self, invariants):
        return 0.5 * (invariants.stretch_squared - 1.0)

    def energy_density(self, e):
        return 0.5 * self.stiffness * e**2


class Bending(Energy):
    """A further bending stiffness EI [N m^2]."""

    stiffness: Array

    def deformation(self, invariants):
        return invariants.normal_squared / invariants.stretch_squared**2

    def energy_density(self, e):
        return 0.5 * self.stiffness * e


class KelvinVoigt(Dissipation):
    """Axial damping with the damping coefficient gamma EA [N s]."""

    damping: Array

    def deformation(self, invariants):
        return 0.5 * (invariants.stretch_squared - 1.0)

    def rayleigh_density(self, e, rate):
        return 0.5 * self.damping * rate**2


class Lorentz(Load):
    """Force of a magnetic field B [T], fixed in I, on the current of electrons, which flow to the hub: at
    the distance x from the root the current is I (1 - x/L)."""

    field: Array
    length: float = 10e3

    def commanded(self, measurements):
        return measurements.current

    def force(self, time, fields, rates):
        tangent = fields.r_x / jnp.sqrt((fields.r_x**2).sum(0))
        current = self.command * (1.0 - fields.x / self.length)
        b = self.field.reshape(3, *(1,) * (fields.r.ndim - 1))
        return current * jnp.cross(tangent, jnp.broadcast_to(b, tangent.shape), axis=0)


class Pulse(HubLoad):
    """A torque [N m] about X_B that rises and falls linearly about the instant `middle` [s]."""

    size: float = 0.2
    middle: float = 10.0
    half: float = 2.5

    @property
    def knots(self):
        return (self.middle - self.half, self.middle, self.middle + self.half)

    def wrench(self, hub):
        part = jnp.maximum(1.0 - jnp.abs(hub.time - self.middle) / self.half, 0.0)
        return jnp.zeros(3), jnp.array([1.0, 0.0, 0.0]) * self.size * part


pulse = Pulse()
"""A term that `esail run --terms` may name."""


def both():
    """A function that `esail run --terms` may name."""
    return [Weight(jnp.array([0.0, 1e-6, 0.0])), AxialPush(jnp.asarray(1e-4))]
