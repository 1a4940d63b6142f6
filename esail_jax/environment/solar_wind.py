"""The solar wind: radial from the Sun, constant or as a series in time."""

import equinox as eqx
import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Instants, Scalar, Vector, VectorPerPoint
from esail_jax.constants import PROTON_MASS, THRUST_FACTOR, VACUUM_PERMITTIVITY
from esail_jax.numerics.vectors import norm


class SteadyWind(eqx.Module):
    """Solar wind at the sail.

    speed u [m/s], number_density n_0 [1/m^3], cutoff_voltage V_1 [V] (bulk kinetic energy of a
    proton over its charge), origin R_0 [m]: heliocentric position of the inertial frame's origin.
    """

    speed: Instants
    number_density: Instants
    cutoff_voltage: Scalar
    origin: Vector

    def at(self, time: Instants) -> "SteadyWind":
        """The wind at an instant."""
        return self

    def velocity(self, r: VectorPerPoint) -> VectorPerPoint:
        """u [m/s] = u (R_0 + r) / |R_0 + r| at each point ([PGV] Eq. 32)."""
        position = self.origin.reshape(3, *(1,) * (r.ndim - 1)) + r
        return position * (self.speed / norm(position))

    def thrust_per_speed(self, voltage: Float[Array, "*member"]) -> Float[Array, "*load"]:
        """sigma / u [N s/m^2] = 0.18 max(0, V_0 - V_1) sqrt(eps_0 m_i n_0) ([PGV] Eq. 29)."""
        plasma = jnp.sqrt(VACUUM_PERMITTIVITY * PROTON_MASS * self.number_density)
        return THRUST_FACTOR * jnp.maximum(0.0, voltage - self.cutoff_voltage) * plasma


class WindSeries(eqx.Module):
    """Solar wind that changes along straight lines between instants [s], everywhere at once: it crosses a
    sail of 20 km in less than a tenth of a second. Constant before the first and after the last."""

    time: Float[Array, " instant"]
    speed: Float[Array, " instant"]
    number_density: Float[Array, " instant"]
    cutoff_voltage: Scalar
    origin: Vector

    def at(self, time: Instants) -> SteadyWind:
        """The wind at an instant, or at several."""
        now = (jnp.interp(time, self.time, x) for x in (self.speed, self.number_density))
        return SteadyWind(*now, self.cutoff_voltage, self.origin)
