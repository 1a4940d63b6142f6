"""Thrust of the solar wind on a positive wire by the size of its electron sheath."""

import equinox as eqx
import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Instants, Scalar
from esail_jax.constants import DEBYE_LENGTHS, ELEMENTARY_CHARGE, PROTON_MASS, VACUUM_PERMITTIVITY

SHEATH_FACTOR = 3.09
"""Coefficient K [-] of the thrust, fitted to plasma simulations (Janhunen & Sandroos 2007)."""


class DebyeSheath(eqx.Module):
    """The law of Janhunen & Sandroos (Ann. Geophys. 25 (2007) 755), which knows the electron temperature:

    sigma = K m_p n u^2 r_0 / sqrt(exp(m_p u^2/(e V) ln(r_0/r_w)) - 1),    r_0 = 2 sqrt(eps_0 T_e/(e n))

    electron_temperature: T_e [eV]. radius: r_w [m], of the wire, or the effective radius of a tether of
    several wires. Sheath electrons that are trapped about the wire shield it: the thrust is a fifth of that
    of the linear law ([PGV] Eq. 29), for which they are removed.
    """

    electron_temperature: Scalar
    radius: Scalar

    def most(self, speed: Instants, density: Instants) -> tuple[Instants, Instants]:
        """K m_p n u r_0 [N s/m^2], the scale of sigma / u, and m_p u^2/e ln(r_0/r_w) [V]."""
        reach = DEBYE_LENGTHS * jnp.sqrt(
            VACUUM_PERMITTIVITY * self.electron_temperature / (ELEMENTARY_CHARGE * density)
        )
        scale = SHEATH_FACTOR * PROTON_MASS * density * speed * reach
        return scale, PROTON_MASS * speed**2 / ELEMENTARY_CHARGE * jnp.log(reach / self.radius)

    def thrust_per_speed(
        self, speed: Instants, density: Instants, voltage: Float[Array, "*member"]
    ) -> Float[Array, "*load"]:
        """sigma / u [N s/m^2]; zero at a voltage that is not positive."""
        scale, volts = self.most(speed, density)
        positive = voltage > 0.0
        # exp(-x/2) / sqrt(1 - exp(-x)) is 1 / sqrt(exp(x) - 1) without overflow at a small voltage.
        x = volts / jnp.where(positive, voltage, 1.0)
        return jnp.where(positive, scale * jnp.exp(-0.5 * x) / jnp.sqrt(-jnp.expm1(-x)), 0.0)

    def voltage(
        self, speed: Instants, density: Instants, thrust_per_speed: Float[Array, "*member"]
    ) -> Float[Array, "*member"]:
        """The voltage [V] of a positive sigma / u: the inverse of `thrust_per_speed`."""
        scale, volts = self.most(speed, density)
        return volts / jnp.log1p((scale / thrust_per_speed) ** 2)
