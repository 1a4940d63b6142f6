"""The smooth step of fifth order."""

from collections.abc import Sequence

import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Float

NEWTON_STEPS = 40
"""Newton steps of `inverse_smooth_step`: enough for levels down to 1e-9."""

MAX_STEP_SLOPE = 1.875
"""Largest slope of `smooth_step`; a straight ramp has 1."""


def smooth_step(x: Float[Array, "*any"]) -> Float[Array, "*any"]:
    """The polynomial 6 x^5 - 15 x^4 + 10 x^3 on [0, 1]; 0 below and 1 above. Its first two derivatives
    vanish at 0 and at 1."""
    x = jnp.clip(x, 0.0, 1.0)
    return x**3 * (10.0 + x * (6.0 * x - 15.0))


def pulse(time: Array, on: Array | float, off: Array | None, rise: Array) -> Array:
    """A number that rises from 0 to 1 from the instant `on` on, and falls back to 0 from `off` on [s].

    rise: duration of the rise and of the fall [s]; off: None if it stays at 1."""
    part = smooth_step((time - on) / rise)
    return part if off is None else part * smooth_step(1.0 - (time - off) / rise)


def inverse_smooth_step(y: Float[Array, "*any"]) -> Float[Array, "*any"]:
    """The x in (0, 1) with smooth_step(x) = y, to rounding; NaN unless y lies in (0, 1).

    Newton's method from the inflection point 1/2: beyond the first step it approaches x from one side,
    because the step is convex below 1/2 and concave above."""

    def improved(_, x):
        slope = 30.0 * (x * (1.0 - x)) ** 2
        return jnp.clip(x - (smooth_step(x) - y) / jnp.maximum(slope, 1e-30), 1e-9, 1.0 - 1e-9)

    inside = (y > 0.0) & (y < 1.0)
    return jnp.where(inside, lax.fori_loop(0, NEWTON_STEPS, improved, jnp.full(jnp.shape(y), 0.5)), jnp.nan)


def knots_of_pulse(on: Array, off: Array | None, rise: Array, levels: Sequence[Array]) -> tuple[Array, ...]:
    """The instants [s] at which rise and fall of a `pulse` begin and end, and those at which they reach
    levels between 0 and 1; NaN if they reach a level never."""
    parts = [inverse_smooth_step(level) for level in levels]
    rising = [on, on + rise, *(on + x * rise for x in parts)]
    falling = [] if off is None else [off, off + rise, *(off + (1.0 - x) * rise for x in parts)]
    return (*rising, *falling)
