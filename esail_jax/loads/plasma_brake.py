"""Coulomb drag of the ionosphere on a negative tether in low orbit: the plasma brake."""

from typing import ClassVar

import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Instants, PerElement, Scalar, VectorPerPoint
from esail_jax.constants import ATOMIC_MASS, ELEMENTARY_CHARGE, VACUUM_PERMITTIVITY
from esail_jax.numerics.vectors import dot, reciprocal
from esail_jax.point_fields import PointFields
from esail_jax.terms import Load

DRAG_FACTOR = 3.864
"""Coefficient [-] of the drag per length (Janhunen 2014)."""


class PlasmaBrake(Load):
    """Drag per length of a negative tether in a stream of plasma (Janhunen, Ann. Geophys. 32 (2014) 1207;
    arXiv 1401.5968):

    sigma = 3.864 P sqrt(eps_0 v / (e n)) exp(-V_i/v),    v = |V| / ln(lambda/r_w),
    P = m_i n w^2,    V_i = m_i w^2 / (2 e),    lambda = sqrt(eps_0 |V| / (e n))

    in the direction of the stream's part across the tether, f = (sigma/w) (w - (w . t) t), t the tangent.
    In the axes of a circular orbit (`environment/circular_orbit.py`) the plasma streams along -y, with the
    speed w. The plasma turns with the Earth, and the tether moves in these axes: both are for the user to
    put into w. The formula is that of a tether across the stream. Currents in the magnetic field are not
    included.

    speed: w [m/s]. number_density: n [1/m^3]. ion_mass: m_i [kg]. radius: effective electric radius r_w
    [m]. voltage: V [V] of every element; where it is not negative there is no drag.
    """

    speed: Scalar
    number_density: Scalar
    ion_mass: Scalar
    radius: Scalar
    voltage: PerElement

    name: ClassVar[str] = "plasma brake"
    depends_on: ClassVar[tuple[str, ...]] = ("r_x",)

    @property
    def drag(self) -> Float[Array, " element"]:
        """sigma [N/m] of every element."""
        negative = self.voltage < 0.0
        volts = jnp.where(negative, -self.voltage, 1.0)
        square = VACUUM_PERMITTIVITY / (ELEMENTARY_CHARGE * self.number_density)
        reduced = volts / jnp.log(jnp.sqrt(square * volts) / self.radius)
        pressure = self.ion_mass * self.number_density * self.speed**2
        bulk = self.ion_mass * self.speed**2 / (2.0 * ELEMENTARY_CHARGE)
        sigma = DRAG_FACTOR * pressure * jnp.sqrt(square * reduced) * jnp.exp(-bulk / reduced)
        return jnp.where(negative, sigma, 0.0)

    def force(self, time: Instants, fields: PointFields, rates: PointFields) -> VectorPerPoint:
        r_x = fields.r_x
        stream = jnp.array([0.0, -1.0, 0.0]).reshape(3, *(1,) * (r_x.ndim - 1))
        along = -r_x[1] * reciprocal(dot(r_x, r_x))
        return self.drag * (stream - along * r_x)


def ions(mass_u: Scalar) -> Scalar:
    """The mass [kg] of an ion of mass_u atomic mass units."""
    return mass_u * ATOMIC_MASS
