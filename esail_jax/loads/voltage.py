"""Voltage laws: the voltage of every tether as a function of time and of what a sail can measure.

Limits 0 <= V <= V_max hold by construction: every law but the constant one ends in `limited`.
"""

from abc import abstractmethod
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Float, PerTether, Scalar, Vector
from esail_jax.measurements import Measurements

BLEND = 0.02
"""Part of V_max over which a limit is approached smoothly."""

STEEPEST = 1.875
"""Largest slope of the smooth step, over that of a straight ramp."""


NEWTON_STEPS = 6
"""That bring a modulation down to a slew rate."""

Volts = Float[Array, "*any"]


class VoltageLaw(eqx.Module):
    """V_i of every tether. maximum V_max [V], None: no upper limit."""

    smooth: ClassVar[bool] = False

    maximum: eqx.AbstractVar[Scalar | None]
    name: eqx.AbstractClassVar[str]

    @abstractmethod
    def commanded(self, measurements: Measurements) -> PerTether:
        """V [V] before limits."""

    def voltage(self, measurements: Measurements) -> PerTether:
        """V [V]."""
        return limited(self.commanded(measurements), self.maximum, self.smooth)


class Constant(VoltageLaw):
    """V = V_0 as given, without limits."""

    value: PerTether

    maximum: ClassVar[None] = None
    name: ClassVar[str] = "constant voltage"

    def commanded(self, measurements: Measurements) -> PerTether:
        return self.value

    def voltage(self, measurements: Measurements) -> PerTether:
        return self.value


class Harmonic(VoltageLaw):
    """V = V_0 (1 + sum_k a_k cos k phi + b_k sin k phi) in the phase of the root; a, b (harmonic, tether).

    Amplitudes are made smaller where V could change faster than slew_rate [V/s] at the spin rate given."""

    value: PerTether
    cosine: Float[Array, "harmonic tether"]
    sine: Float[Array, "harmonic tether"]
    maximum: Scalar | None
    slew_rate: Scalar | None
    spin_rate: Scalar

    name: ClassVar[str] = "harmonic voltage"
    smooth: ClassVar[bool] = True

    def commanded(self, measurements: Measurements) -> PerTether:
        c, s = measurements.root_phase
        once = lax.complex(c, s)
        waves = once ** jnp.arange(1, len(self.cosine) + 1)[:, None]
        change = (self.cosine * waves.real + self.sine * waves.imag).sum(0)
        return self.value * (1.0 + self.allowed() * change)

    def allowed(self) -> PerTether | float:
        """Part of the amplitudes that the slew rate allows."""
        if self.slew_rate is None:
            return 1.0
        orders = np.arange(1.0, len(self.cosine) + 1.0)
        amplitude = jnp.sqrt(self.cosine**2 + self.sine**2 + 1e-30)
        fastest = jnp.abs(self.value * self.spin_rate) * (orders[:, None] * amplitude).sum(0)
        return slow_enough(fastest, self.slew_rate)


class TimeTable(VoltageLaw):
    """Straight lines between the voltages `table` [V] (instant, tether) at increasing instants [s];
    constant before the first and after the last."""

    time: Float[Array, " instant"]
    table: Float[Array, "instant tether"]
    maximum: Scalar | None

    name: ClassVar[str] = "voltage table"

    def commanded(self, measurements: Measurements) -> PerTether:
        return jax.vmap(lambda x: jnp.interp(measurements.time, self.time, x), 1)(self.table)


class OnOff(VoltageLaw):
    """V_0 between `on` and `off` [s], off None: for good. It rises and falls within rise_time [s], as the
    smooth step of fifth order, whose first two derivatives vanish at its ends; more slowly where that
    would be faster than slew_rate [V/s]."""

    value: PerTether
    on: PerTether
    off: PerTether | None
    rise_time: Scalar
    maximum: Scalar | None
    slew_rate: Scalar | None

    name: ClassVar[str] = "switched voltage"

    def commanded(self, measurements: Measurements) -> PerTether:
        rise = self.rise_time
        if self.slew_rate is not None:
            rise = jnp.maximum(rise, STEEPEST * jnp.abs(self.value) / self.slew_rate)
        part = smooth_step((measurements.time - self.on) / rise)
        if self.off is not None:
            part = part * smooth_step(1.0 - (measurements.time - self.off) / rise)
        return self.value * part


class Feedback(VoltageLaw):
    """V = V_0 (1 + g (n . u) d . (e_i x n)): tethers whose thrust turns the spin axis n = X_B toward
    `target` (unit vector in I) pull more. d: what of the target lies in the spin plane; e_i: outward at
    root i; u: along the wind. gain g [-]; made smaller where V could change faster than slew_rate [V/s] as
    the roots turn at the spin rate given."""

    value: PerTether
    gain: Scalar
    target: Vector
    maximum: Scalar | None
    slew_rate: Scalar | None
    spin_rate: Scalar

    name: ClassVar[str] = "attitude feedback"
    smooth: ClassVar[bool] = True

    def commanded(self, measurements: Measurements) -> PerTether:
        axis = measurements.spin_axis
        miss = self.target - axis * (axis @ self.target)
        lever = miss @ jnp.cross(measurements.radial_directions, axis[:, None], axis=0)
        gain = self.gain * (axis @ measurements.wind)
        if self.slew_rate is not None:
            fastest = jnp.abs(self.value * self.spin_rate * gain) * jnp.sqrt(miss @ miss + 1e-30)
            gain = gain * slow_enough(fastest, self.slew_rate)
        return self.value * (1.0 + gain * lever)


class PlanarCone(VoltageLaw):
    """The law that keeps rigid tethers of a fixed anchor on their cone,

    sigma = sigma_bar / (1 - x cos phi)^3,  x = tan alpha tan Lambda,
    sigma_bar = 2 I omega_0^2 sin Lambda / (L^2 cos alpha),

    in the phase of the tether, which then turns with phi' = omega_0 / (1 - x cos phi). `modulation` makes x
    smaller where V could change faster than a slew rate.

    load_bar: sigma_bar [N/m]; cutoff_voltage V_1 and load_per_volt [N/(m V)] turn a load into a voltage.
    """

    load_bar: PerTether
    x: PerTether
    cutoff_voltage: Scalar
    load_per_volt: Scalar
    maximum: Scalar | None

    name: ClassVar[str] = "planar cone"

    def commanded(self, measurements: Measurements) -> PerTether:
        cosine, _ = measurements.tether_phase
        load = self.load_bar / (1.0 - self.x * cosine) ** 3
        return self.cutoff_voltage + load / self.load_per_volt


def cone_load(
    inertia: PerTether, spin_rate: Scalar, coning: Scalar, sailing: Scalar, length: PerTether
) -> PerTether:
    """sigma_bar [N/m] of `PlanarCone`. inertia I [kg m^2] of a tether about its root; angles in rad."""
    return 2.0 * inertia * spin_rate**2 * jnp.sin(coning) / (length**2 * jnp.cos(sailing))


def within_slew_rate(
    time: Float[Array, " instant"], table: Float[Array, "instant tether"], slew_rate: Scalar
) -> Float[Array, "instant tether"]:
    """Voltages at the instants of a table, one after the other no farther from the last than slew_rate
    [V/s] allows."""

    def reach(before, row):
        commanded, most = row
        here = before + jnp.clip(commanded - before, -most, most)
        return here, here

    _, others = lax.scan(reach, table[0], (table[1:], slew_rate * jnp.diff(time)))
    return jnp.concatenate([table[:1], others])


def modulation(
    x: PerTether, load_bar: PerTether, load_per_volt: Scalar, spin_rate: Scalar, slew_rate: Scalar
) -> PerTether:
    """x of `PlanarCone`, made smaller where V would change faster than slew_rate [V/s] as the tethers turn:

    |dV/dt| = sigma_bar omega_0 / load_per_volt  3 |x sin phi| / (1 - x cos phi)^5,

    largest at 8 |x| cos phi = sqrt(1 + 80 x^2) - 1. That is convex in x, so that Newton's method comes down
    to the rate allowed from above; the part of x that is then still too much is taken off."""
    allowed = slew_rate * load_per_volt / jnp.abs(spin_rate * load_bar)

    def fastest(x):
        cosine = 10.0 * x / (1.0 + jnp.sqrt(1.0 + 80.0 * x**2))
        return 3.0 * x * jnp.sqrt(1.0 - cosine**2) / (1.0 - x * cosine) ** 5

    size = jnp.abs(x)
    for _ in range(NEWTON_STEPS):
        rate, slope = jax.jvp(fastest, (size,), (jnp.ones_like(size),))
        size = jnp.where(rate > allowed, size - (rate - allowed) / slope, size)
    return jnp.sign(x) * size * slow_enough(fastest(size), allowed)


def slow_enough(fastest: PerTether, slew_rate: Scalar | PerTether) -> PerTether:
    """Part of a modulation that a slew rate allows. fastest: what it could change by [V/s]."""
    return jnp.minimum(1.0, slew_rate / jnp.maximum(fastest, 1e-30))


def limited(voltage: Volts, maximum: Scalar | None, smooth: bool) -> Volts:
    """0 <= V <= V_max, V itself between. smooth: bending within BLEND V_max of a limit, where there is an
    upper one, so that a derivative knows of it before it is reached."""
    if maximum is None:
        return jnp.maximum(voltage, 0.0)
    if not smooth:
        return jnp.clip(voltage, 0.0, maximum)
    width = BLEND * maximum
    return maximum - above_zero(maximum - above_zero(voltage, width), width)


def above_zero(x: Volts, width: Scalar | float) -> Volts:
    """0 below -width, x above width, a parabola between."""
    return jnp.where(x > width, x, jnp.maximum(x + width, 0.0) ** 2 / (4.0 * width))


def smooth_step(x: Float[Array, "*any"]) -> Float[Array, "*any"]:
    """6 x^5 - 15 x^4 + 10 x^3 from 0 to 1."""
    x = jnp.clip(x, 0.0, 1.0)
    return x**3 * (10.0 + x * (6.0 * x - 15.0))
