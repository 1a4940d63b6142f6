"""The solar wind: radial from the Sun; steady or a series in time."""

import equinox as eqx
import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Instants, Scalar, Vector, VectorPerPoint
from esail_jax.constants import PROTON_MASS, THRUST_FACTOR, VACUUM_PERMITTIVITY
from esail_jax.numerics.vectors import norm


class SteadyWind(eqx.Module):
    """Steady solar wind at the sail.

    speed: u [m/s]. number_density: n_0 [1/m^3]. cutoff_voltage: V_1 [V], bulk kinetic energy of a proton
    over its charge. origin: R_0 [m], heliocentric position of the inertial frame's origin.
    """

    speed: Instants
    number_density: Instants
    cutoff_voltage: Scalar
    origin: Vector

    def at(self, time: Instants) -> "SteadyWind":
        """The wind at an instant: a steady wind is the same at all."""
        return self

    def velocity(self, r: VectorPerPoint) -> VectorPerPoint:
        """Wind velocity u (R_0 + r) / |R_0 + r| [m/s] at each point r ([PGV] Eq. 32)."""
        position = self.origin.reshape(3, *(1,) * (r.ndim - 1)) + r
        return position * (self.speed / norm(position))

    def thrust_per_speed(self, voltage: Float[Array, "*member"]) -> Float[Array, "*load"]:
        """Thrust per length and wind speed, sigma / u = 0.18 max(0, V_0 - V_1) sqrt(eps_0 m_i n_0) [N
        s/m^2] ([PGV] Eq. 29)."""
        plasma = jnp.sqrt(VACUUM_PERMITTIVITY * PROTON_MASS * self.number_density)
        return THRUST_FACTOR * jnp.maximum(0.0, voltage - self.cutoff_voltage) * plasma


class WindSeries(eqx.Module):
    """Solar wind that varies in time: speed and density are interpolated linearly between instants, and
    constant before the first and after the last.

    The wind changes everywhere at once: it crosses a sail of 20 km in less than a tenth of a second.
    time: instants [s]. The other fields are those of `SteadyWind`.
    """

    time: Float[Array, " instant"]
    speed: Float[Array, " instant"]
    number_density: Float[Array, " instant"]
    cutoff_voltage: Scalar
    origin: Vector

    def at(self, time: Instants) -> SteadyWind:
        """The wind at one or several instants."""
        speed, density = (jnp.interp(time, self.time, x) for x in (self.speed, self.number_density))
        return SteadyWind(speed, density, self.cutoff_voltage, self.origin)
