"""Voltage laws: the voltage of every tether as a function of time and of what a sail can measure.

Limits 0 <= V <= V_max hold by construction: every law but the constant one ends in its `Limits`, and the
value of that one has passed through them if the scene has a `maximum`.
"""

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar, Literal, NamedTuple, Protocol, TypeGuard

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Float, PerTether, Scalar, Vector
from esail_jax.environment.orbit import orbital_frame
from esail_jax.loads.voltage_limits import Limits, crossings, slew_rate_factor
from esail_jax.measurements import Measurements
from esail_jax.numerics.smooth_step import MAX_STEP_SLOPE, knots_of_pulse, pulse

NEWTON_STEPS = 6
"""Newton steps of `modulation`."""

AxisName = Literal["hub", "angular-momentum"]
"""What attitude feedback measures as the spin axis: X_B, or the direction of the angular momentum."""


class VoltageKink(NamedTuple):
    """A place at which the voltage, or the thrust as a function of it, has a kink: the distance of a tether
    from it, the jump there of the derivative of the voltage (or of its part that thrusts) with respect to
    this distance, and the voltage there [V]."""

    margin: PerTether
    jump: PerTether
    volts: PerTether


class VoltageLaw(eqx.Module):
    """The voltage V_i of every tether as a function of measurements.

    A subclass gives `commanded`, `name` and `limits`."""

    if TYPE_CHECKING:
        # For mypy, an `AbstractVar` would be a field, which precedes those of every law.
        @property
        @abstractmethod
        def limits(self) -> Limits: ...
    else:
        limits: eqx.AbstractVar[Limits]
    name: eqx.AbstractClassVar[str]

    @property
    def constant(self) -> bool:
        """Tells whether the voltages depend on neither time nor state (`is_constant`)."""
        return False

    @property
    def measures_motion(self) -> bool:
        """Tells whether the law needs all measurements, also those of rates, positions and tensions."""
        return False

    def knots(self, measurements: Measurements, levels: tuple[Scalar, ...]) -> tuple[Array, ...]:
        """Instants [s] at which the voltage changes its form in time, as foreseen from a state. Steps end
        there: a pulse between two of them would otherwise be passed over, and derivatives with respect to
        its instants would have the error of a kink within a step. levels: voltages [V] at which the thrust
        changes its form."""
        return ()

    def kinks(self, measurements: Measurements, levels: tuple[Scalar, ...]) -> tuple[VoltageKink, ...]:
        """The kinks that are no knots: those of the thrust at levels [V], and those of the limits. By
        default the state decides when the voltage reaches them. A law whose knots they are has none."""
        asked = self.commanded(measurements)
        volts = asked if self.limits.blend is None else self.limits(asked)
        one = jnp.ones_like(asked)
        smooth = self.limits.blend is not None
        reached = [one if smooth else jnp.where(self.limits(x) == x, one, 0.0) for x in levels]
        begins = [
            VoltageKink(volts - level, jump, level * one)
            for level, jump in zip(levels, reached, strict=True)
        ]
        return (*begins, *(VoltageKink(asked - x, -one, x * one) for x in self.limits.kinks))

    def holding(self, volts: PerTether) -> "VoltageLaw":
        """The law that holds other voltages [V], if it is a sampled one (`own_law.SampledLaw`)."""
        return self

    @abstractmethod
    def commanded(self, measurements: Measurements) -> PerTether:
        """Voltages V [V] before limits."""

    def voltage(self, measurements: Measurements) -> PerTether:
        """Voltages V [V] within the limits."""
        return self.limits(self.commanded(measurements))


class HasValue(Protocol):
    """A law whose voltages are the same at all times and in all states. value: [V]."""

    @property
    def value(self) -> PerTether: ...


def is_constant(law: VoltageLaw) -> TypeGuard[HasValue]:
    """Tells whether the voltages of a law depend on neither time nor state; it then has them."""
    return law.constant


class Constant(VoltageLaw):
    """The constant voltage V = V_0. Its limits are those of the value from which it is made."""

    value: PerTether

    limits: ClassVar[Limits] = Limits(None)
    name: ClassVar[str] = "constant voltage"

    @property
    def constant(self) -> bool:
        return True

    def commanded(self, measurements: Measurements) -> PerTether:
        return self.value

    def voltage(self, measurements: Measurements) -> PerTether:
        return self.value


class Harmonic(VoltageLaw):
    """Harmonics of the root's phase: V = V_0 (1 + sum_k a_k cos k phi + b_k sin k phi).

    value: V_0 [V]. cosine, sine: a, b [-], (harmonic, tether). The amplitudes are reduced if V could change
    faster than slew_rate [V/s] at the spin rate of the moment.
    """

    value: PerTether
    cosine: Float[Array, "harmonic tether"]
    sine: Float[Array, "harmonic tether"]
    limits: Limits
    slew_rate: Scalar | None

    name: ClassVar[str] = "harmonic voltage"

    def commanded(self, measurements: Measurements) -> PerTether:
        c, s = measurements.root_phase
        once = lax.complex(c, s)
        waves = once ** jnp.arange(1, len(self.cosine) + 1)[:, None]
        change = (self.cosine * waves.real + self.sine * waves.imag).sum(0)
        return self.value * (1.0 + self.amplitude_factor(measurements.spin_rate) * change)

    def amplitude_factor(self, spin_rate: Scalar) -> PerTether | float:
        """Fraction of the amplitudes that the slew rate allows at a spin rate [rad/s]."""
        if self.slew_rate is None:
            return 1.0
        orders = np.arange(1.0, len(self.cosine) + 1.0)
        amplitude = jnp.sqrt(self.cosine**2 + self.sine**2 + 1e-30)
        fastest = jnp.abs(self.value * spin_rate) * (orders[:, None] * amplitude).sum(0)
        return slew_rate_factor(fastest, self.slew_rate)


class TimeTable(VoltageLaw):
    """Voltages interpolated linearly in a table; constant before the first and after the last instant.

    time: increasing instants [s]. table: voltages [V], (instant, tether).
    """

    time: Float[Array, " instant"]
    table: Float[Array, "instant tether"]
    limits: Limits

    name: ClassVar[str] = "voltage table"

    def knots(self, measurements: Measurements, levels: tuple[Scalar, ...]) -> tuple[Array, ...]:
        reached = [crossings(self.time, self.table, level) for level in (*levels, *self.limits.kinks)]
        return (self.time, *reached)

    def kinks(self, measurements: Measurements, levels: tuple[Scalar, ...]) -> tuple[VoltageKink, ...]:
        return ()

    def commanded(self, measurements: Measurements) -> PerTether:
        return jax.vmap(lambda x: jnp.interp(measurements.time, self.time, x), 1)(self.table)


class OnOff(VoltageLaw):
    """A voltage that is switched on and off: V_0 between the instants `on` and `off` [s], zero otherwise.

    off: None if the voltage stays on. Rise and fall take rise_time [s] along the smooth step of fifth
    order, whose first two derivatives vanish at its ends. They take longer if that would exceed slew_rate
    [V/s].
    """

    value: PerTether
    on: PerTether
    off: PerTether | None
    rise_time: Scalar
    limits: Limits
    slew_rate: Scalar | None

    name: ClassVar[str] = "switched voltage"

    @property
    def rise(self) -> Scalar | PerTether:
        """Time [s] that rise and fall take."""
        if self.slew_rate is None:
            return self.rise_time
        return jnp.maximum(self.rise_time, MAX_STEP_SLOPE * jnp.abs(self.value) / self.slew_rate)

    def knots(self, measurements: Measurements, levels: tuple[Scalar, ...]) -> tuple[Array, ...]:
        parts = [level / self.value for level in (*levels, *self.limits.kinks)]
        return knots_of_pulse(self.on, self.off, self.rise, parts)

    def kinks(self, measurements: Measurements, levels: tuple[Scalar, ...]) -> tuple[VoltageKink, ...]:
        return ()

    def commanded(self, measurements: Measurements) -> PerTether:
        return self.value * pulse(measurements.time, self.on, self.off, self.rise)


class Feedback(VoltageLaw):
    """Attitude feedback V = V_0 (1 + s g (n . u) d . (e_i x n)).

    Tethers whose thrust turns the spin axis n towards `target`, a unit vector in the inertial frame, get a
    higher voltage. d: the part of the target in the spin plane; e_i: radial direction of tether i; u: unit
    vector along the wind; s: sense of the spin about n, 1 or -1 (0 at rest), as the same torque turns the
    axis of a sail that spins the other way round in the opposite direction. gain: g [-], reduced if V could
    change faster than slew_rate [V/s] as the roots turn at the spin rate of the moment.

    measured_axis: "hub", n = X_B and e_i of the roots; "angular-momentum", n along the sail's angular
    momentum L about its centre of mass (opposite to X_B for a negative spin, as is the target then, so that
    s = 1), and e_i of the chords. Internal forces do not change L, so that its feedback excites no
    vibration. Feedback of X_B makes the nutation grow at the rate at which it turns the axis: for a body
    with the moments of inertia C and A, L = C w n + A n x n', and with the torque c d the exponents of
    small deviations are -c/(C w) and i w C/A + c/(C w).
    """

    value: PerTether
    gain: Scalar
    target: Vector
    limits: Limits
    slew_rate: Scalar | None
    measured_axis: AxisName = eqx.field(static=True, default="hub")

    name: ClassVar[str] = "attitude feedback"

    def commanded(self, measurements: Measurements) -> PerTether:
        axis, outward = measurements.spin_axis, measurements.radial_directions
        target = self.aim(measurements)
        sense: Scalar | float = measurements.sense
        if self.measured_axis == "angular-momentum":
            axis, target, sense = measurements.momentum_axis, sense * target, 1.0
            outward = measurements.outward_from(axis)
        miss = target - axis * (axis @ target)
        lever = miss @ jnp.cross(outward, axis[:, None], axis=0)
        gain = sense * self.gain * (axis @ measurements.wind)
        if self.slew_rate is not None:
            fastest = jnp.abs(self.value * measurements.spin_rate * gain) * jnp.sqrt(miss @ miss + 1e-30)
            gain = gain * slew_rate_factor(fastest, self.slew_rate)
        return self.value * (1.0 + gain * lever)

    def aim(self, measurements: Measurements) -> Vector:
        """The target in the inertial frame."""
        return self.target


class OrbitalFeedback(Feedback):
    """Attitude feedback to a target that is fixed in the orbital frame O, and turns with it."""

    def aim(self, measurements: Measurements) -> Vector:
        """The target in the inertial frame; O follows from the direction of the wind at the hub, Z_O."""
        return orbital_frame(measurements.wind) @ self.target


class PlanarCone(VoltageLaw):
    """The planar-cone law. It keeps rigid tethers of a fixed anchor on their cone:

    sigma = sigma_bar / (1 - x cos phi)^3,  x = tan alpha tan Lambda,
    sigma_bar = 2 I omega_0^2 sin Lambda / (L^2 cos alpha),

    in the phase phi of the tether, which then turns with phi' = omega_0 / (1 - x cos phi). `modulation`
    reduces x if V could change faster than slew_rate [V/s] at the spin rate of the moment.

    load_bar: sigma_bar [N/m]. cutoff_voltage: V_1 [V] and load_per_volt [N/(m V)] convert loads to
    voltages.
    """

    load_bar: PerTether
    x: PerTether
    cutoff_voltage: Scalar
    load_per_volt: Scalar
    limits: Limits
    slew_rate: Scalar | None

    name: ClassVar[str] = "planar cone"

    def commanded(self, measurements: Measurements) -> PerTether:
        (cosine, _), x = measurements.tether_phase, self.x
        if self.slew_rate is not None:
            x = modulation(x, self.load_bar, self.load_per_volt, measurements.spin_rate, self.slew_rate)
        load = self.load_bar / (1.0 - x * cosine) ** 3
        return self.cutoff_voltage + load / self.load_per_volt


def cone_load(
    inertia: PerTether, spin_rate: Scalar, coning: Scalar, sailing: Scalar, length: PerTether
) -> PerTether:
    """The load sigma_bar [N/m] of `PlanarCone`.

    inertia: I [kg m^2] of a tether about its root. Angles Lambda (coning) and alpha (sailing) are in rad.
    """
    return 2.0 * inertia * spin_rate**2 * jnp.sin(coning) / (length**2 * jnp.cos(sailing))


def modulation(
    x: PerTether, load_bar: PerTether, load_per_volt: Scalar, spin_rate: Scalar, slew_rate: Scalar
) -> PerTether:
    """The parameter x of `PlanarCone`, reduced if V would change faster than slew_rate [V/s] as the tethers
    turn:

    |dV/dt| = sigma_bar omega_0 / load_per_volt  3 |x sin phi| / (1 - x cos phi)^5,

    which is largest at 8 |x| cos phi = sqrt(1 + 80 x^2) - 1. This maximum is convex in x, so that Newton's
    method converges to the allowed rate from above; a last factor removes the remaining excess.
    """
    allowed = slew_rate * load_per_volt / jnp.abs(spin_rate * load_bar)

    def fastest(x):
        cosine = 10.0 * x / (1.0 + jnp.sqrt(1.0 + 80.0 * x**2))
        return 3.0 * x * jnp.sqrt(1.0 - cosine**2) / (1.0 - x * cosine) ** 5

    size = jnp.abs(x)
    for _ in range(NEWTON_STEPS):
        rate, slope = jax.jvp(fastest, (size,), (jnp.ones_like(size),))
        size = jnp.where(rate > allowed, size - (rate - allowed) / slope, size)
    return jnp.sign(x) * size * slew_rate_factor(fastest(size), allowed)
