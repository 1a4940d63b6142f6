"""The solar wind: radial from the Sun, constant speed and density."""

import equinox as eqx
import jax.numpy as jnp

from esail_jax.array_types import PerMember, Scalar, Vector, VectorPerPoint
from esail_jax.constants import PROTON_MASS, THRUST_FACTOR, VACUUM_PERMITTIVITY
from esail_jax.numerics.vectors import norm


class SolarWind(eqx.Module):
    """Solar wind at the sail.

    speed u [m/s], number_density n_0 [1/m^3], cutoff_voltage V_1 [V] (bulk kinetic energy of a
    proton over its charge), origin R_0 [m]: heliocentric position of the inertial frame's origin.
    """

    speed: Scalar
    number_density: Scalar
    cutoff_voltage: Scalar
    origin: Vector

    def velocity(self, r: VectorPerPoint) -> VectorPerPoint:
        """u [m/s] = u (R_0 + r) / |R_0 + r| at each point ([PGV] Eq. 32)."""
        position = self.origin.reshape(3, *(1,) * (r.ndim - 1)) + r
        return position * (self.speed / norm(position))

    def thrust_per_speed(self, voltage: PerMember) -> PerMember:
        """sigma / u [N s/m^2] = 0.18 max(0, V_0 - V_1) sqrt(eps_0 m_i n_0) ([PGV] Eq. 29)."""
        plasma = jnp.sqrt(VACUUM_PERMITTIVITY * PROTON_MASS * self.number_density)
        return THRUST_FACTOR * jnp.maximum(0.0, voltage - self.cutoff_voltage) * plasma
