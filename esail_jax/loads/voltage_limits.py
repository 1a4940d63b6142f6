"""Limits of voltages: their range, and their slew rate."""

import equinox as eqx
import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Float, PerTether, Scalar

Volts = Float[Array, "*any"]


def crossings(
    time: Float[Array, " instant"], table: Float[Array, "instant tether"], level: Scalar
) -> Float[Array, "interval tether"]:
    """The instants [s] at which voltages that change linearly between the rows of a table pass a level [V];
    NaN in intervals in which they do not."""
    before, change = table[:-1], jnp.diff(table, axis=0)
    part = (level - before) / jnp.where(change == 0.0, jnp.nan, change)
    inside = (part > 0.0) & (part < 1.0)
    return jnp.where(inside, time[:-1, None] + part * jnp.diff(time)[:, None], jnp.nan)


def within_slew_rate(
    time: Float[Array, " instant"], table: Float[Array, "instant tether"], slew_rate: Scalar
) -> Float[Array, "instant tether"]:
    """The table [V] limited in slew rate: no entry differs from the limited entry before it by more than
    slew_rate [V/s] allows."""

    def reach(before, row):
        commanded, max_change = row
        here = before + jnp.clip(commanded - before, -max_change, max_change)
        return here, here

    _, others = lax.scan(reach, table[0], (table[1:], slew_rate * jnp.diff(time)))
    return jnp.concatenate([table[:1], others])


def slew_rate_factor(fastest: PerTether, slew_rate: Scalar | PerTether) -> PerTether:
    """Fraction of a modulation that a slew rate allows. fastest: its largest rate [V/s]."""
    return jnp.minimum(1.0, slew_rate / jnp.maximum(fastest, 1e-30))


class Limits(eqx.Module):
    """The limits 0 and V_max of a voltage, which is cut off there.

    maximum: V_max [V]; None for no upper limit. blend: None, or half the width, as a fraction of V_max, of
    the range about each limit in which the voltage bends smoothly instead: derivatives then see a limit
    before it is reached, and a voltage that is asked to be at a limit is blend V_max/4 away from it."""

    maximum: Scalar | None
    blend: Scalar | None = None

    @property
    def kinks(self) -> tuple[Scalar, ...]:
        """The voltages [V] above zero at which the limits bend sharply."""
        return () if self.maximum is None or self.blend is not None else (self.maximum,)

    def __call__(self, voltage: Volts) -> Volts:
        """The voltage within the limits."""
        if self.maximum is None:
            return jnp.maximum(voltage, 0.0)
        if self.blend is None:
            return jnp.clip(voltage, 0.0, self.maximum)
        width = self.blend * self.maximum
        return self.maximum - smooth_positive_part(
            self.maximum - smooth_positive_part(voltage, width), width
        )


def smooth_positive_part(x: Volts, width: Scalar | float) -> Volts:
    """Smoothed max(x, 0): 0 below -width, x above width, and a parabola in between."""
    return jnp.where(x > width, x, jnp.maximum(x + width, 0.0) ** 2 / (4.0 * width))
