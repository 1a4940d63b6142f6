"""Limits of voltages: their range, approached smoothly where a derivative needs it, and their slew rate."""

import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Float, PerTether, Scalar

BLEND = 0.02
"""Half width, as a fraction of V_max, of the range in which a limit is approached smoothly."""

Volts = Float[Array, "*any"]


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


def limit(voltage: Volts, maximum: Scalar | None, smooth: bool) -> Volts:
    """The voltage within its limits 0 and V_max. maximum: V_max; None for no upper limit.

    smooth: with an upper limit, V bends within BLEND V_max of a limit, so that a derivative changes before
    the limit is reached.
    """
    if maximum is None:
        return jnp.maximum(voltage, 0.0)
    if not smooth:
        return jnp.clip(voltage, 0.0, maximum)
    width = BLEND * maximum
    return maximum - smooth_positive_part(maximum - smooth_positive_part(voltage, width), width)


def smooth_positive_part(x: Volts, width: Scalar | float) -> Volts:
    """Smoothed max(x, 0): 0 below -width, x above width, and a parabola in between."""
    return jnp.where(x > width, x, jnp.maximum(x + width, 0.0) ** 2 / (4.0 * width))
