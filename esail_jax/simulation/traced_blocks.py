"""A sail's run by collocation under a trace (jit, grad, jvp, vmap): one program, with its derivative."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Bool, Float, Scalar
from esail_jax.numerics.lockstep import march, repeat, written
from esail_jax.numerics.symbolic_zeros import jvp_of_perturbed, with_tangent_of
from esail_jax.scenes.structure import Numbers, Structure
from esail_jax.simulation.blocks import Problem, observed, point_at, point_within, problem_of, step_of
from esail_jax.simulation.entry import along_rows
from esail_jax.simulation.results import RESULTS
from esail_jax.simulation.schedule import next_switch
from esail_jax.steppers.collocation import KEEP, end_of_step, work_of_step
from esail_jax.steppers.collocation_solution import known_stages
from esail_jax.steppers.collocation_stages import Point, factor, stage_powers
from esail_jax.steppers.collocation_steps import Progress, Record, no_record
from esail_jax.system import System

ROWS_TOGETHER = 32
"""Saved instants of a traced run in one batch."""

MOST_BLOCKS = 200
"""Of a run that is differentiated: some five thousand steps."""


@functools.partial(jax.jit, static_argnums=(0, 1, 2))
def traced_run(
    structure: Structure,
    times: tuple[float, ...],
    stops: tuple[float, ...],
    numbers: Numbers,
    step: Array | None,
) -> tuple[dict[str, Array], Point, RESULTS, Array]:
    """The whole run as one program; `stops`: where it begins afresh, and its end."""
    _, problem, carry = problem_of(structure, numbers, step)
    progress, began, good, pieces = carry.progress, -np.inf, jnp.asarray(True), []
    for stop in stops:
        part = [time for time in times if began < time <= stop]
        instants = jnp.asarray(part if stop in part else [*part, stop])
        here = problem.since(jnp.asarray(max(began, 0.0)))
        points, reached, taken = states_at(here, progress, instants)
        good = good & (instants <= reached)
        pieces.append(seen_at(here, carry.start_energy, points, good, len(part)))
        began, good = stop, good[-1]
        final = jax.tree.map(lambda x: x[-1], points)
        if stop != stops[-1]:
            after = problem.since(final.time).system
            until = jnp.asarray(next_switch(stops, stop))
            progress = problem.method.start_again(after, final, taken, progress.rejected, until)
    rows = jax.tree.map(lambda *x: jnp.concatenate(x), *pieces)
    result = RESULTS.where(good, RESULTS.successful, RESULTS.newton_diverged)
    return rows, jax.tree.map(lambda x: jnp.where(good, x, jnp.nan), final), result, taken


def seen_at(
    problem: Problem, start_energy: Scalar, points: Point, good: Bool[Array, " row"], count: int
) -> dict[str, Array]:
    """Observables of the first `count` points, NaN where they are not good."""
    points, good = jax.tree.map(lambda x: x[:count], (points, good))
    rows = lax.map(lambda point: observed(problem, start_energy, point), points, batch_size=ROWS_TOGETHER)
    return {name: jnp.where(along_rows(good, x), x, jnp.nan) for name, x in rows.items()}


@jax.custom_jvp
def states_at(
    problem: Problem, progress: Progress, times: Float[Array, " row"]
) -> tuple[Point, Scalar, Scalar]:
    """States at the saved instants, the time reached, and the steps taken.

    The derivative is that of the steps as they were taken: their sizes carry none. It goes through their
    records in a loop of fixed length, so that forward and reverse mode exist."""
    rows = len(times)

    def going(state):
        progress, row = state
        return (row < rows) & ~problem.method.stuck(progress)

    def block(state, points, active):
        progress, records = problem.method.block(problem.system, state[0])

        def passed(row):
            return active & (row < rows) & (times[jnp.minimum(row, rows - 1)] <= progress.now.time)

        def keep(row, points, active):
            return row + 1, written(points, row, point_at(problem, records, times[row])[0], active)

        row, points = march(passed, keep, state[1], points)
        return (progress, row), points

    empty = jax.tree.map(lambda x: jnp.zeros((rows, *x.shape), x.dtype), progress.now)
    (progress, _), points = march(going, block, (progress, jnp.zeros((), int)), empty)
    return points, progress.now.time, progress.taken


@functools.partial(states_at.defjvp, symbolic_zeros=True)
def _states_at_jvp(primals, tangents):
    problem, progress, times = primals
    ended, records = recorded(problem, progress, times[-1])
    points, moved = jvp_of_perturbed(lambda *x: replay(*x, records), primals, tangents)
    none = jnp.zeros(())
    return (points, ended.now.time, ended.taken), (moved, none, none)


def recorded(problem: Problem, progress: Progress, end: Scalar) -> tuple[Progress, Record]:
    """The run until `end`, MOST_BLOCKS at most, with the records of all its steps, block by block."""

    def block(progress):
        progress, records = problem.method.block(problem.system, progress)
        going = (progress.now.time < end) & ~problem.method.stuck(progress)
        return progress, going, records

    nothing = jax.tree.map(lambda x: jnp.zeros((KEEP, *x.shape), x.dtype), no_record(progress))
    return repeat(block, progress, MOST_BLOCKS, nothing)


def replay(problem: Problem, progress: Progress, times: Float[Array, " row"], records: Record) -> Point:
    """States at the saved instants as functions of the system and the start, from the steps as they were
    taken; NaN beyond them."""

    @jax.checkpoint
    def block(now, records):
        return taken_again(problem.system, now, records)

    def one(now, records):
        return lax.cond(records.taken.any(), block, lambda *x: x, now, records)

    _, records = lax.scan(one, progress.now, lax.stop_gradient(records))
    flat = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), records)
    flat = work_again(problem.system, progress.now, flat)
    # All at once: a row's share in the derivative of all records would be as large as they are.
    index = jax.vmap(lambda time: step_of(flat, time))(times)
    steps = jax.tree.map(lambda x: x[index], flat)
    points = lax.map(lambda row: point_within(problem, *row)[0], (steps, times), batch_size=ROWS_TOGETHER)
    good = times <= jnp.where(flat.taken, flat.end, -jnp.inf).max()
    return jax.tree.map(lambda x: jnp.where(along_rows(good, x), x, jnp.nan), points)


def taken_again(system: System, now: Point, records: Record) -> tuple[Point, Record]:
    """The steps of a block, as functions of the system and of what the first of them starts from: the end
    of the last, and the records, with that derivative. The steps' length carries none. Without work and
    powers, which nothing else depends on (`work_again`)."""
    h = records.h[0]
    lam = jax.tree.map(lambda x: x[0, 0], records.stages.lam)
    kept = lax.stop_gradient(factor(*lax.stop_gradient((system, now, h, lam))))

    @jax.checkpoint
    def step(now, record):
        # What was not taken may be infinite: times zero that is no zero.
        stages = jax.tree.map(lambda x: jnp.where(record.taken, x, 0.0), record.stages)
        # From where it was taken: nothing before a step needs to be done again for its derivative.
        now = with_tangent_of(record.start, now)
        unknowns = known_stages(system, now, h, stages, kept, record.info.iterations)
        q, v = end_of_step(system, now, h, unknowns, kept)
        end = now._replace(q=q, v=v, vdot=jax.tree.map(lambda x: x[-1], unknowns.vdot))
        return end, record._replace(start=now, stages=unknowns)

    def step_or_stay(now, record):
        now = now._replace(time=record.start.time)
        return lax.cond(record.taken, step, lambda now, record: (now, record), now, record)

    return lax.scan(step_or_stay, now, records)


def work_again(system: System, start: Point, records: Record) -> Record:
    """Records of `taken_again` in a row, with the powers and the work from those of `start` on."""

    @jax.checkpoint
    def powers(record):
        stages = jax.tree.map(lambda x: jnp.where(record.taken, x, 0.0), record.stages)
        return stage_powers(system, record.start, record.h, stages)

    def step(before, record):
        power = powers(record)
        work = jax.tree.map(jnp.add, before[0], work_of_step(record.h, before[1], power))
        return (work, jax.tree.map(lambda x: x[-1], power)), power

    def step_or_stay(before, record):
        none = jax.tree.map(jnp.zeros_like, record.power)
        after, power = lax.cond(record.taken, step, lambda *x: (x[0], none), before, record)
        start = record.start._replace(work=before[0], power=before[1])
        return after, record._replace(start=start, power=power)

    return lax.scan(step_or_stay, (start.work, start.power), records)[1]
