"""Electron current and electric power of charged wires in the solar wind, and a limit of the power."""

import dataclasses
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from esail_jax.array_types import Array, Maybe, PerTether, Scalar, Vector
from esail_jax.constants import ELECTRON_MASS, ELEMENTARY_CHARGE
from esail_jax.environment.solar_wind import SteadyWind, Wind
from esail_jax.loads.voltage import Constant, VoltageKink, VoltageLaw
from esail_jax.loads.voltage_limits import Limits
from esail_jax.measurements import Measurements


class Collector(eqx.Module):
    """The wires of the tethers as collectors of electrons: thin cylinders whose current is limited by the
    orbital motion of the electrons, far above their temperature (Mott-Smith & Langmuir 1926; Janhunen &
    Sandroos 2007). Per length of a wire of radius r_w,

        dI/dx = 2 r_w e n_0 sqrt(2 e V / m_e)

    and the electric power is the sum of V I over the tethers. The voltage is the same along the tether.

    width_times_length: 2 r_w times the number of wires and the undeformed length of a tether [m^2]. wind:
    its number density n_0 is also that of the electrons; on an orbit it is that at the hub.
    """

    width_times_length: PerTether
    wind: Wind

    def current(self, time: Scalar, voltage: PerTether, position: Maybe[Vector] = None) -> PerTether:
        """Current I [A] of every tether; zero at a voltage [V] that is not positive. position:
        heliocentric, of the hub [m], if the sail moves on an orbit."""
        positive = voltage > 0.0
        # The root has no derivative at zero.
        volts = jnp.where(positive, voltage, 1.0)
        speed = jnp.sqrt(2.0 * ELEMENTARY_CHARGE * volts / ELECTRON_MASS)
        charge = ELEMENTARY_CHARGE * self.wind.at_sail(time, position).number_density
        return jnp.where(positive, self.width_times_length * charge * speed, 0.0)

    def power(self, time: Scalar, voltage: PerTether, position: Maybe[Vector] = None) -> Scalar:
        """Electric power [W] of all tethers together."""
        return (voltage * self.current(time, voltage, position)).sum()

    def within_power(
        self, time: Scalar, voltage: PerTether, limit: Scalar, position: Maybe[Vector] = None
    ) -> PerTether:
        """The voltages, all multiplied by the same factor if they would need more than `limit` [W].

        Power grows with V^(3/2), so that the factor is (limit / power)^(2/3)."""
        return voltage * jnp.maximum(self.power(time, voltage, position) / limit, 1.0) ** (-2.0 / 3.0)


class PowerLimited(VoltageLaw):
    """A voltage law whose voltages are scaled down together where they would need more than the power
    limit, after the law's own limits. limit: largest electric power of all tethers [W]."""

    law: VoltageLaw
    collector: Collector
    limit: Scalar

    limits: ClassVar[Limits] = Limits(None)
    name: ClassVar[str] = "voltage of limited power"

    @property
    def measures_motion(self) -> bool:
        return self.law.measures_motion

    def knots(self, measurements: Measurements, levels: tuple[Scalar, ...]) -> tuple[Array, ...]:
        return self.law.knots(measurements, levels)

    def kinks(self, measurements: Measurements, levels: tuple[Scalar, ...]) -> tuple[VoltageKink, ...]:
        """Those of the law, and that of the power limit. Where the limit acts, a kink of one tether is one
        of all others, and the thrust begins at another voltage of the law: jumps are NaN there."""
        time, volts, position = measurements.time, self.commanded(measurements), measurements.position
        excess = self.collector.power(time, volts, position) / self.limit - 1.0
        acts, limited = excess > 0.0, self.voltage(measurements)
        kinks = self.law.kinks(measurements, levels)
        own = [x._replace(jump=jnp.where(acts, jnp.nan, x.jump)) for x in kinks]
        begins = [
            VoltageKink(limited - level, jnp.where(acts, jnp.nan, 0.0), level + jnp.zeros_like(volts))
            for level in levels
        ]
        return (*own, *begins, VoltageKink(excess + jnp.zeros_like(volts), -2.0 / 3.0 * volts, volts))

    def holding(self, volts: PerTether) -> "PowerLimited":
        return dataclasses.replace(self, law=self.law.holding(volts))

    def commanded(self, measurements: Measurements) -> PerTether:
        return self.law.voltage(measurements)

    def voltage(self, measurements: Measurements) -> PerTether:
        volts, position = self.commanded(measurements), measurements.position
        return self.collector.within_power(measurements.time, volts, self.limit, position)


def power_limited(law: VoltageLaw, collector: Collector, limit: Scalar) -> VoltageLaw:
    """The law within the power limit [W]. A constant voltage in a steady wind stays constant."""
    if isinstance(law, Constant) and isinstance(collector.wind, SteadyWind):
        return Constant(collector.within_power(jnp.zeros(()), law.value, limit))
    return PowerLimited(law, collector, limit)
