"""Windows of a traced run that is divided at instants which are tracers, such as those of temperatures.

The instants have no value when the run is traced, and the windows are computed within its program. Every
window ends at one instant: a saved one, a cut, or an end of a segment. The ends of segments have no
derivative. They need none: the motion is continuous there, and what changes with the instants on both sides
of them is what the segments see (`environment/temperature.py`).
"""

import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Float, Int
from esail_jax.simulation.schedule import Schedule, Windows


def divided_windows(
    schedule: Schedule, instants: Float[Array, " knot"]
) -> tuple[Windows, Int[Array, " time"], np.ndarray]:
    """Returns the windows of a schedule that is also divided at other instants [s], and for every saved
    time the index of its window and its place in that window. Instants outside of the run divide nothing:
    they become windows at its end, in which nothing happens."""
    fixed, _, _ = schedule.windows()
    known = np.unique(np.concatenate([row[:n] for row, n in zip(fixed.times, fixed.count, strict=True)]))
    begin, end = schedule.begin, known[-1]
    knots = lax.stop_gradient(instants)
    inner = (knots > begin) & (knots < end)
    switches = jnp.concatenate([jnp.asarray(schedule.switches, float), jnp.where(inner, knots, jnp.inf)])
    times = jnp.sort(jnp.concatenate([known, jnp.where(inner, knots, end)]))

    before, after = switches < times[:, None], switches >= times[:, None]
    start = jnp.where(before & (switches > begin), switches, begin).max(1)
    until = jnp.where(after, switches, jnp.inf).min(1)
    previous = jnp.concatenate([jnp.full(1, begin), times[:-1]])
    begins = (previous == start) & (start > begin)
    number = jnp.searchsorted(times, np.array(schedule.times))
    ones = np.ones(len(times), int)
    samples = begins & jnp.isin(start, jnp.asarray(schedule.samples, float))
    windows = Windows(times[:, None], ones, start, begins, until, samples)
    return windows, number, np.zeros(len(schedule.times), int)
