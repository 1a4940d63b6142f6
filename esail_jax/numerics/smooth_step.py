"""The smooth step of fifth order."""

import jax.numpy as jnp

from esail_jax.array_types import Array, Float, PerTether, Scalar

MAX_STEP_SLOPE = 1.875
"""Largest slope of `smooth_step`; a straight ramp has 1."""


def smooth_step(x: Float[Array, "*any"]) -> Float[Array, "*any"]:
    """The polynomial 6 x^5 - 15 x^4 + 10 x^3 on [0, 1]; 0 below and 1 above. Its first two derivatives
    vanish at 0 and at 1."""
    x = jnp.clip(x, 0.0, 1.0)
    return x**3 * (10.0 + x * (6.0 * x - 15.0))


def pulse(time: Scalar, on: PerTether, off: PerTether | None, rise: Scalar | PerTether) -> PerTether:
    """A number that rises from 0 to 1 from the instant `on` on, and falls back to 0 from `off` on [s].

    rise: duration of the rise and of the fall [s]; off: None if it stays at 1."""
    part = smooth_step((time - on) / rise)
    return part if off is None else part * smooth_step(1.0 - (time - off) / rise)
