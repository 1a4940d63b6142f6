"""Steps that end where a load changes its form in time, at the *knots* of the system.

Between two knots the forces are smooth in time. A step across one would have the error of a kink, and a
step across two could pass over a pulse without a trace. Error control sees the former in the motion, but
not in its derivative with respect to the instant of the knot, and the latter not at all.

Steps end just before a knot: the last stage of a step then has the form before it, and all stages of the
next step have the form after it. The acceleration with which that step begins is computed again, just
behind the knot: it is the same, but its derivative is another one.
"""

import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Float, Scalar
from esail_jax.steppers.collocation_stages import StepEnd
from esail_jax.steppers.consistent import consistent_motion
from esail_jax.system import System

NEAR = 1e-12
"""Distance before a knot at which steps end: relative to the time, and at small times in seconds."""


def near(time: Float[Array, "*any"]) -> Float[Array, "*any"]:
    """The distance [s] before a knot at which steps end."""
    return NEAR * (1.0 + jnp.abs(time))


def knots_ahead(system: System, now: StepEnd) -> Float[Array, " knot"] | None:
    """The knots [s] of the system as foreseen from a state; None if it has none."""
    knots = system.knots(now.time, now.q, now.v)
    return None if knots is None else lax.stop_gradient(knots)


def fitting_step(knots: Float[Array, " knot"], time: Scalar, h: Scalar) -> tuple[Scalar, Scalar]:
    """The largest step size [s] up to `h` that leads to the next knot in equal steps, and the time
    [s] at which they end; `h` and infinity if there is none. A knot that is NaN is none."""
    stop = jnp.where(knots > time + 2.0 * near(time), knots, jnp.inf).min()
    stop = stop - near(jnp.where(jnp.isfinite(stop), stop, 0.0))
    steps = jnp.ceil((stop - time) / h * (1.0 - NEAR))
    return jnp.where(jnp.isfinite(stop), (stop - time) / jnp.maximum(steps, 1.0), h), stop


def behind(system: System, now: StepEnd) -> StepEnd:
    """The end of a step with acceleration and power just behind a knot that may be there."""
    motion = consistent_motion(system, now.time + 2.0 * near(now.time), now.q, now.v)
    return now._replace(vdot=motion.vdot, power=motion.power)
