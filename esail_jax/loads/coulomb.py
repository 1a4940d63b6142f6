"""Coulomb thrust of the solar wind on charged tethers ([PGV] Sec. 2.2.3)."""

from typing import ClassVar

from esail_jax.array_types import Instants, PerElement, VectorPerPoint
from esail_jax.environment.solar_wind import SteadyWind, WindSeries
from esail_jax.numerics.vectors import dot, reciprocal
from esail_jax.terms import Load, PointFields


class CoulombThrust(Load):
    """f = (sigma/u) u_perp, u_perp = u - (i_t . u) i_t, i_t = r_x/|r_x| ([PGV] Eq. 27-30).

    Per undeformed length. The tether's own velocity is not subtracted from the wind's.
    """

    wind: SteadyWind | WindSeries
    voltage: PerElement

    name: ClassVar[str] = "coulomb"
    depends_on: ClassVar[tuple[str, ...]] = ("r", "r_x")

    def force(self, time: Instants, fields: PointFields, rates: PointFields) -> VectorPerPoint:
        wind = self.wind.at(time)
        u = wind.velocity(fields.r)
        along = dot(fields.r_x, u) * reciprocal(dot(fields.r_x, fields.r_x))
        return wind.thrust_per_speed(self.voltage) * (u - along * fields.r_x)
