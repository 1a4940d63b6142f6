"""Windows of a traced run that is divided at instants which are tracers, such as those of temperatures.

The instants have no value when the run is traced, and the windows are computed within its program. Every
window ends at one instant: a saved one, a cut, or an end of a segment. The ends of segments have no
derivative. First derivatives need none: the motion is continuous there, and what changes with the instants
on both sides of them is what the segments see (`numerics/lines_in_time.py`). Second ones have a part of
their own (`traced.in_next_segment`).
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Float
from esail_jax.simulation.schedule import Plan, Schedule, Windows, repeated, rounded_up


class DividedPlan(NamedTuple):
    """The times of a run that is divided at instants without a value yet, as arguments of its program.

    start: of the run [s]; times: the saved instants; known: all instants at which a window ends, but for
    those without a value; switches, samples: those of the schedule. The last ones are repeated, or are
    infinite or negative, so that their numbers are rounded up."""

    start: Float[Array | np.ndarray, ""]
    times: Float[Array | np.ndarray, " time"]
    known: Float[Array | np.ndarray, " window"]
    switches: Float[Array | np.ndarray, " switch"]
    samples: Float[Array | np.ndarray, " sample"]


def divided_plan(schedule: Schedule) -> DividedPlan:
    """The plan of a schedule with `divided`."""
    windows = schedule.plan().windows
    known = np.unique(np.concatenate([row[:n] for row, n in zip(*windows[:2], strict=True)]))

    def padded(times, value):
        return repeated(np.array([*times, value]), rounded_up(len(times) + 1))

    return DividedPlan(
        np.asarray(schedule.start, float), padded(schedule.times, schedule.times[-1]),
        padded(known, known[-1]), padded(schedule.switches, np.inf), padded(schedule.samples, -1.0),
    )  # fmt: skip


def divided_windows(plan: DividedPlan, instants: Float[Array, " knot"]) -> Plan:
    """The windows of a plan that is also divided at these instants [s]. Instants outside of the run
    divide nothing: they become windows at its end, in which nothing happens."""
    begin, end = plan.start, plan.known[-1]
    knots = lax.stop_gradient(instants)
    inner = (knots > begin) & (knots < end)
    switches = jnp.concatenate([plan.switches, jnp.where(inner, knots, jnp.inf)])
    times = jnp.sort(jnp.concatenate([plan.known, jnp.where(inner, knots, end)]))

    before, after = switches < times[:, None], switches >= times[:, None]
    start = jnp.where(before & (switches > begin), switches, begin).max(1)
    until = jnp.where(after, switches, jnp.inf).min(1)
    previous = jnp.concatenate([jnp.reshape(begin, 1), times[:-1]])
    after_switch = (previous == start) & (start > begin)
    number = jnp.searchsorted(times, plan.times)
    ones = np.ones(len(times), int)
    samples = after_switch & jnp.isin(start, plan.samples)
    windows = Windows(times[:, None], ones, start, after_switch, until, samples)
    return Plan(windows, number, np.zeros(len(plan.times), int))
