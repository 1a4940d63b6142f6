"""The solar wind: radial from the Sun; steady, a series in time, or along an orbit about the Sun."""

import equinox as eqx
import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Instants, Maybe, Scalar, Vector, VectorPerPoint
from esail_jax.constants import PROTON_MASS, THRUST_FACTOR, VACUUM_PERMITTIVITY
from esail_jax.environment.kepler_orbit import KeplerOrbit, PlaceOnOrbit
from esail_jax.environment.thrust_laws import DebyeSheath
from esail_jax.numerics.vectors import norm, reciprocal


class SteadyWind(eqx.Module):
    """Steady solar wind at the sail.

    speed: u [m/s]. number_density: n_0 [1/m^3]. cutoff_voltage: V_1 [V], bulk kinetic energy of a proton
    over its charge. origin: R_0 [m], heliocentric position of the inertial frame's origin. sheath: the law
    of thrust if it is not the linear one ([PGV] Eq. 29), which then needs no cutoff voltage. thrust_factor:
    the factor [-] of the linear law; None for that of the paper, 0.18.
    """

    speed: Instants
    number_density: Instants
    cutoff_voltage: Maybe[Scalar]
    origin: Vector
    sheath: DebyeSheath | None = None
    thrust_factor: Scalar | None = None

    @property
    def knots(self) -> tuple[Array, ...]:
        """Instants [s] at which the wind changes its form in time: none."""
        return ()

    @property
    def thresholds(self) -> tuple[Scalar, ...]:
        """Voltages [V] at which the thrust begins."""
        return thresholds_of(self)

    def at(self, time: Instants, r: VectorPerPoint | None = None) -> "SteadyWind":
        """The wind at an instant, at points r: a steady wind is the same at all."""
        return self

    def at_sail(self, time: Scalar, position: Vector | None) -> "SteadyWind":
        """The wind at an instant, at the heliocentric position of a sail: the same at all positions."""
        return self

    def direction(self, position: Vector | None) -> Vector:
        """Unit vector along the wind at the origin of the inertial frame."""
        return self.origin / jnp.linalg.norm(self.origin)

    def velocity(self, r: VectorPerPoint) -> VectorPerPoint:
        """Wind velocity u (R_0 + r) / |R_0 + r| [m/s] at each point r ([PGV] Eq. 32)."""
        position = self.origin.reshape(3, *(1,) * (r.ndim - 1)) + r
        return position * (self.speed / norm(position))

    def thrust_per_speed(self, voltage: Float[Array, "*member"]) -> Float[Array, "*load"]:
        """Thrust per length and wind speed, sigma / u = 0.18 max(0, V_0 - V_1) sqrt(eps_0 m_i n_0) [N
        s/m^2] ([PGV] Eq. 29, with the factor of the scene), or that of the sheath's law."""
        if self.sheath is not None:
            return self.sheath.thrust_per_speed(self.speed, self.number_density, voltage)
        return self.factor * jnp.maximum(0.0, voltage - self.cutoff_voltage) * self.plasma

    def voltage(self, thrust_per_speed: Float[Array, "*member"]) -> Float[Array, "*member"]:
        """The voltage [V] of a positive sigma / u [N s/m^2]: the inverse of `thrust_per_speed`."""
        if self.sheath is not None:
            return self.sheath.voltage(self.speed, self.number_density, thrust_per_speed)
        return self.cutoff_voltage + thrust_per_speed / (self.factor * self.plasma)

    @property
    def factor(self) -> Scalar | float:
        """The factor [-] of the linear law of thrust."""
        return THRUST_FACTOR if self.thrust_factor is None else self.thrust_factor

    @property
    def plasma(self) -> Instants:
        """sqrt(eps_0 m_i n_0) [N s/(V m^2)]."""
        return jnp.sqrt(VACUUM_PERMITTIVITY * PROTON_MASS * self.number_density)


class WindSeries(eqx.Module):
    """Solar wind that varies in time: speed and density are interpolated linearly between instants, and
    constant before the first and after the last.

    The wind changes everywhere at once: it crosses a sail of 20 km in less than a tenth of a second.
    time: instants [s]. The other fields are those of `SteadyWind`.
    """

    time: Float[Array, " instant"]
    speed: Float[Array, " instant"]
    number_density: Float[Array, " instant"]
    cutoff_voltage: Maybe[Scalar]
    origin: Vector
    sheath: DebyeSheath | None = None
    thrust_factor: Scalar | None = None

    @property
    def knots(self) -> tuple[Array, ...]:
        """Instants [s] at which the wind changes its form in time."""
        return (self.time,)

    @property
    def thresholds(self) -> tuple[Scalar, ...]:
        """Voltages [V] at which the thrust begins."""
        return thresholds_of(self)

    def at(self, time: Instants, r: VectorPerPoint | None = None) -> SteadyWind:
        """The wind at one or several instants, the same at all points r."""
        speed, density = (jnp.interp(time, self.time, x) for x in (self.speed, self.number_density))
        about = self.cutoff_voltage, self.origin, self.sheath, self.thrust_factor
        return SteadyWind(speed, density, *about)

    def at_sail(self, time: Scalar, position: Vector | None) -> SteadyWind:
        """The wind at an instant, at the heliocentric position of a sail: the same at all positions."""
        return self.at(time)

    def direction(self, position: Vector | None) -> Vector:
        """Unit vector along the wind at the origin of the inertial frame."""
        return self.origin / jnp.linalg.norm(self.origin)


class WindOnOrbit(eqx.Module):
    """Solar wind at a sail whose inertial frame moves along a Kepler orbit. It is radial from the Sun, and
    its density falls with the square of the distance: n(R) = n_0 (R_ref/R)^2; its speed is constant.

    wind: speed and number density at the reference distance. reference_distance: R_ref [m].
    """

    wind: SteadyWind | WindSeries
    orbit: KeplerOrbit | PlaceOnOrbit
    reference_distance: Scalar

    @property
    def knots(self) -> tuple[Array, ...]:
        """Instants [s] at which the wind changes its form in time."""
        return self.wind.knots

    @property
    def thresholds(self) -> tuple[Scalar, ...]:
        """Voltages [V] at which the thrust begins."""
        return self.wind.thresholds

    def at(self, time: Instants, r: VectorPerPoint) -> "LocalWind":
        """The wind at one or several instants, at points r [m] of the moving frame."""
        origin, velocity = self.orbit.at(time)
        # The axes of the instants are the last ones but that of the elements (`array_types.py`).
        shape = (3, *(1,) * (r.ndim - 1 - jnp.ndim(time)), *jnp.shape(time))
        return self.local(time, origin.reshape(shape) + r, velocity.reshape(shape))

    def at_sail(self, time: Scalar, position: Vector) -> "LocalWind":
        """The wind at an instant, at the heliocentric position [m] of a sail."""
        return self.local(time, position, None)

    def local(
        self, time: Instants, place: VectorPerPoint, velocity: Float[Array, "xyz ..."] | None
    ) -> "LocalWind":
        """The wind at one or several instants, at heliocentric positions [m]. velocity: that of the moving
        frame [m/s], if it is needed."""
        wind = self.wind.at(time)
        nearness = reciprocal(norm(place))
        density = wind.number_density * (self.reference_distance * nearness) ** 2
        plasma = wind.plasma * (self.reference_distance * nearness)
        about = wind.cutoff_voltage, place, wind.sheath, wind.thrust_factor
        return LocalWind(wind.speed, density, *about, velocity, nearness=nearness, local_plasma=plasma)

    def direction(self, position: Vector) -> Vector:
        """Unit vector along the wind at a heliocentric position [m]."""
        return position / jnp.linalg.norm(position)


class LocalWind(SteadyWind):
    """Solar wind at several points: origin holds the heliocentric position [m] of every point, and
    number_density its density there. frame_velocity: velocity [m/s] of the inertial frame. nearness:
    1/|R| [1/m] at every point. local_plasma: `plasma` there, from the density at the reference distance
    without another root: roots and divisions at every point are what an orbit costs."""

    origin: VectorPerPoint
    frame_velocity: Maybe[Float[Array, "xyz ..."]] = None
    nearness: Float[Array, "..."] = eqx.field(kw_only=True)
    local_plasma: Float[Array, "..."] = eqx.field(kw_only=True)

    def velocity(self, r: VectorPerPoint) -> VectorPerPoint:
        """Wind velocity u [m/s] at each of the points, in axes at rest relative to the Sun."""
        return self.origin * (self.speed * self.nearness)

    @property
    def plasma(self) -> Instants:
        """sqrt(eps_0 m_i n) [N s/(V m^2)] at each of the points."""
        return self.local_plasma


Wind = SteadyWind | WindSeries | WindOnOrbit
"""The kinds of wind that a scene may have."""


def thresholds_of(wind: SteadyWind | WindSeries) -> tuple[Scalar, ...]:
    """Voltages [V] at which the thrust of a wind begins: V_1 of the linear law, zero of the other one."""
    return () if wind.cutoff_voltage is None else (wind.cutoff_voltage,)
