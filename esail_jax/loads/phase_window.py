"""A voltage that is on during a part of each turn of the sail."""

from typing import ClassVar

import jax.numpy as jnp

from esail_jax.array_types import Array, PerTether, Scalar
from esail_jax.loads.voltage import VoltageLaw
from esail_jax.loads.voltage_limits import Limits
from esail_jax.measurements import Measurements
from esail_jax.numerics.angles import safe_angle
from esail_jax.numerics.smooth_step import inverse_smooth_step, pulse, smooth_step

TURN = 2.0 * jnp.pi

FADED, WHOLE = 0.5, 0.9
"""Lengths of (cos phi, sin phi), which fades to zero as the wind turns into the spin axis, between which
the window fades to its mean. From 2e-4 rad between wind and axis on, the window is whole."""

PASSED, ABOUT, APPROACH = 1e-6, 1e-4, 0.02
"""Parts of the rise. An instant that lies ahead by less than the first has passed. A kink lies within the
second of the phase at which it is foreseen with the spin rate of the moment, from a step that ends the
third before it: foreseen from the beginning of a fall, it would be missed by more than the second."""


class PhaseWindow(VoltageLaw):
    """A window in the phase phi of the root: V = V_0 w(phi).

    w rises from 0 to 1 from the phase `on` to on + rise, and falls from `off` to off + rise [rad], along
    the smooth step of fifth order. With wind along the spin axis the phase is undefined, and w is its mean
    over a turn, (off - on)/2 pi.

    value: V_0 [V]; on, off, rise [rad].
    """

    value: PerTether
    on: PerTether
    off: PerTether
    rise: PerTether
    limits: Limits

    name: ClassVar[str] = "voltage in a window of the phase"

    def width(self) -> PerTether:
        """Angle [rad] from the begin of the rise to that of the fall."""
        return jnp.mod(self.off - self.on, TURN)

    def commanded(self, measurements: Measurements) -> PerTether:
        cosine, sine = measurements.root_phase
        since = jnp.mod(safe_angle(sine, cosine) - self.on, TURN)
        width = self.width()
        # The window of this turn, and the fall of the window of the turn before.
        window = pulse(since, 0.0, width, self.rise) + pulse(since + TURN, 0.0, width, self.rise)
        mean = width / TURN
        length = jnp.sqrt(cosine**2 + sine**2 + 1e-30)
        whole = smooth_step((length - FADED) / (WHOLE - FADED))
        return self.value * (mean + whole * (window - mean))

    def knots(self, measurements: Measurements, levels: tuple[Scalar, ...]) -> tuple[Array, ...]:
        """The instants at which the roots reach the ends of rise and fall, at the spin rate of the moment;
        and two about each instant at which the voltage reaches a level, so that its kink lies in a step of
        its own."""
        cosine, sine = measurements.root_phase
        phase = safe_angle(sine, cosine)
        parts = [inverse_smooth_step(level / self.value) for level in (*levels, *self.limits.kinks)]
        centres = [self.on + x * self.rise for x in parts]
        centres += [self.off + (1.0 - x) * self.rise for x in parts]
        edges = [self.on, self.on + self.rise, self.off, self.off + self.rise]
        edges += [x + part * self.rise for x in centres for part in (-APPROACH, -ABOUT, ABOUT)]
        ahead = [jnp.mod(edge - phase, TURN) for edge in edges]
        ahead = [jnp.where(x > PASSED * self.rise, x, x + TURN) for x in ahead]
        return tuple(measurements.time + x / jnp.abs(measurements.spin_rate) for x in ahead)
