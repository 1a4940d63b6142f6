"""The acceleration fields of the package: uniform gravity, a circular orbit, and the Sun's tide."""

from typing import ClassVar

import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Nodal, Scalar, Vector, VectorPerPoint
from esail_jax.environment.circular_orbit import CircularOrbit
from esail_jax.environment.kepler_orbit import KeplerOrbit, PlaceOnOrbit, tide
from esail_jax.terms import Field, LinearField


class UniformGravity(Field):
    """The same acceleration everywhere. vector: g [m/s^2]."""

    vector: Vector

    name: ClassVar[str] = "gravity"

    def acceleration(
        self, time: Scalar, position: VectorPerPoint, velocity: VectorPerPoint
    ) -> VectorPerPoint:
        return jnp.broadcast_to(self.vector.reshape(3, *(1,) * (position.ndim - 1)), position.shape)

    def at_nodes(self, time: Scalar, q: Nodal, v: Nodal) -> Nodal:
        return jnp.zeros_like(q).at[0].set(self.vector[:, None, None])

    def gradients(self, time: Scalar, position: Vector, velocity: Vector) -> None:
        return None


class OrbitalField(LinearField):
    """The field of a circular orbit, in the axes that turn with it (`environment/circular_orbit.py`)."""

    orbit: CircularOrbit

    name: ClassVar[str] = "circular orbit"

    @property
    def matrices(self) -> tuple[Float[Array, "3 3"], Float[Array, "3 3"]]:
        return self.orbit.gradients


class SolarTide(Field):
    """The acceleration by the Sun relative to the origin of the coordinates, which moves freely on an orbit
    (`kepler_orbit.tide`). Interpolation between nodes has an error of (element length / distance of the
    Sun)^2 of it. The iteration matrix leaves its derivative out: it is of the order of (mean motion)^2."""

    orbit: KeplerOrbit | PlaceOnOrbit

    name: ClassVar[str] = "Kepler orbit about the Sun"

    def acceleration(
        self, time: Scalar, position: VectorPerPoint, velocity: VectorPerPoint
    ) -> VectorPerPoint:
        return tide(self.orbit.at(time)[0], position)

    def gradients(self, time: Scalar, position: Vector, velocity: Vector) -> None:
        return None
