"""Coulomb thrust of the solar wind on charged tethers ([PGV] Sec. 2.2.3)."""

import dataclasses
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from esail_jax.array_types import (
    Array,
    Float,
    Instants,
    Maybe,
    PerElement,
    PerTether,
    Scalar,
    Vector,
    VectorPerPoint,
)
from esail_jax.elements.tether import per_element
from esail_jax.environment.solar_wind import LocalWind, SteadyWind, Wind, WindOnOrbit
from esail_jax.loads.electron_current import Collector
from esail_jax.loads.own_law import SampledLaw, sampled_law
from esail_jax.loads.voltage import VoltageLaw, is_constant
from esail_jax.measurements import Measurements
from esail_jax.numerics.vectors import dot, reciprocal
from esail_jax.point_fields import PointFields
from esail_jax.terms import ControlledLoad


class CoulombThrust(ControlledLoad):
    """Coulomb thrust per undeformed length, f = (sigma/u) u_perp, u_perp = u - (i_t . u) i_t, i_t =
    r_x/|r_x| ([PGV] Eq. 27-30).

    relative: whether u is the wind's velocity relative to the point of the tether, u - dr/dt, in place of
    the wind's velocity itself ([PGV]). sigma/u is then that of the wind's own speed, so that the thrust is
    linear in the velocity of the tether, and of order |dr/dt|/u = 1e-4. On an orbit dr/dt includes the
    velocity of the moving frame, of order 0.1 u. voltage: V [V] of every element;
    None until the voltage law has commanded it. collector: the wires that collect electrons; None if the
    scene does not describe them. added: thrust per length [N/m] beyond sigma, for derivatives; None
    for none.
    """

    wind: Wind
    voltage_law: VoltageLaw
    voltage: Maybe[PerElement] = None
    relative: bool = eqx.field(static=True, default=False)
    collector: Collector | None = None
    added: PerElement | None = None

    name: ClassVar[str] = "coulomb"
    depends_on: ClassVar[tuple[str, ...]] = ("r", "r_x")

    @classmethod
    def of(
        cls,
        wind: Wind,
        voltage_law: VoltageLaw,
        elements: int,
        relative: bool = False,
        collector: Collector | None = None,
    ) -> "CoulombThrust":
        """The load on tethers of `elements` elements each. A constant voltage is set here, once."""
        voltage = per_element(voltage_law.value, elements) if is_constant(voltage_law) else None
        return cls(wind, voltage_law, voltage, relative, collector)

    @property
    def constant(self) -> bool:
        return self.voltage_law.constant

    def knots(self, measurements: Maybe[Measurements]) -> tuple[Array, ...]:
        if self.constant:
            return self.wind.knots
        measured = self.with_wind(measurements)
        return (*self.wind.knots, *self.voltage_law.knots(measured, self.wind.thresholds))

    @property
    def has_kinks(self) -> bool:
        return not self.constant or bool(self.wind.knots)

    def strength(self, time: Scalar, measurements: Maybe[Measurements]) -> PerTether:
        """Thrust per length sigma [N/m] of every tether across the wind, at the hub."""
        law = self.voltage_law
        volts = law.value if is_constant(law) else self.commanded(measurements)
        wind = self.wind_at(time, measurements)
        return wind.speed * wind.thrust_per_speed(volts)

    def kinks(
        self, time: Scalar, measurements: Maybe[Measurements]
    ) -> tuple[Float[Array, "kink tether"], Float[Array, "kink tether"]]:
        """Distances from the kinks of the strength that are no knots, such as a voltage from the cutoff
        voltage, and by how much the derivative of the strength with respect to them jumps."""
        if is_constant(self.voltage_law):
            none = jnp.zeros((0, *self.voltage_law.value.shape))
            return none, none
        wind, measured = self.wind_at(time, measurements), self.with_wind(measurements)
        kinks = self.voltage_law.kinks(measured, self.wind.thresholds)
        rows = [(x.margin, x.jump * wind.speed * slope_of(wind, x.volts)) for x in kinks]
        if not rows:
            none = jnp.zeros((0, *measurements.chords.shape[1:]))
            return none, none
        margins, jumps = zip(*rows, strict=True)
        return jnp.stack(margins), jnp.stack(jumps)

    def wind_at(self, time: Scalar, measurements: Maybe[Measurements]) -> SteadyWind:
        """The wind at the hub."""
        position: Maybe[Vector] = None if measurements is None else measurements.position
        if position is None and isinstance(self.wind, WindOnOrbit):
            position, _ = self.wind.orbit.at(time)
        return self.wind.at_sail(time, position)

    def with_added_strength(self, added: PerElement) -> "CoulombThrust":
        """The load with a thrust per length [N/m] that is added to that of its voltages."""
        return dataclasses.replace(self, added=added)

    @property
    def is_sampled(self) -> bool:
        return self.sampled is not None

    @property
    def measures_motion(self) -> bool:
        return self.voltage_law.measures_motion

    @property
    def law_name(self) -> str:
        return self.voltage_law.name

    @property
    def command(self) -> PerElement | None:
        return self.voltage

    def commanded(self, measurements: Measurements) -> PerTether:
        """Voltage V [V] of every tether, within its limits."""
        return self.voltage_law.voltage(self.with_wind(measurements))

    def with_wind(self, measurements: Measurements) -> Measurements:
        """The measurements with the direction of the wind."""
        return measurements._replace(wind=self.wind.direction(measurements.position))

    @property
    def sampled(self) -> SampledLaw | None:
        """The voltage law, if it is a sampled one."""
        return sampled_law(self.voltage_law)

    def holding(self, volts: PerTether, elements: int) -> "CoulombThrust":
        """The load whose sampled law holds other voltages [V], on tethers of `elements` elements."""
        law = self.voltage_law.holding(volts)
        voltage = per_element(volts, elements) if law.constant else None
        return dataclasses.replace(self, voltage_law=law, voltage=voltage)

    def with_command(self, command: Float[Array, "*state element"]) -> "CoulombThrust":
        return dataclasses.replace(self, voltage=command)

    def force(self, time: Instants, fields: PointFields, rates: PointFields) -> VectorPerPoint:
        wind = self.wind.at(time, fields.r)
        u = wind.velocity(fields.r)
        if self.relative:
            u = u - rates.r
            if isinstance(wind, LocalWind):
                u = u - wind.frame_velocity
        along = dot(fields.r_x, u) * reciprocal(dot(fields.r_x, fields.r_x))
        strength = wind.thrust_per_speed(self.voltage)
        if self.added is not None:
            strength = strength + self.added / wind.speed
        return strength * (u - along * fields.r_x)


def slope_of(wind: SteadyWind, volts: PerTether) -> PerTether:
    """The derivative of sigma/u with respect to the voltage [N s/(m^2 V)], just above voltages [V]."""
    above = volts + 1e-9 * (1.0 + jnp.abs(volts))
    return jax.jvp(wind.thrust_per_speed, (above,), (jnp.ones_like(above),))[1]
