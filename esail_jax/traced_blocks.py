"""A sail's run by collocation under a trace (jit, grad, jvp, vmap): one program, with its derivative."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Bool, Float, Scalar
from esail_jax.blocks import Problem, observed, point_at, problem_of
from esail_jax.dynamics.collocation import KEEP
from esail_jax.dynamics.stages import Point
from esail_jax.dynamics.step_record import Progress, no_record
from esail_jax.entry import along_rows
from esail_jax.pieces import RESULTS
from esail_jax.scenes.build import Numbers, Structure

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
            progress = problem.method.start_again(after, final, taken, progress.rejected)
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

    The derivative is that of the steps as they were taken: their sizes carry none. It is written as the
    same blocks in a loop of fixed length, so that forward and reverse mode exist."""
    rows = len(times)

    def going(state):
        progress, row, _ = state
        return (row < rows) & ~problem.method.stuck(progress)

    def block(state):
        progress, row, points = state
        progress, records = problem.method.block(problem.system, progress)

        def passed(inner):
            return (inner[0] < rows) & (times[jnp.minimum(inner[0], rows - 1)] <= progress.now.time)

        def keep(inner):
            row, points = inner
            point = point_at(problem, records, times[row])[0]
            return row + 1, jax.tree.map(lambda all, x: all.at[row].set(x), points, point)

        row, points = lax.while_loop(passed, keep, (row, points))
        return progress, row, points

    empty = jax.tree.map(lambda x: jnp.zeros((rows, *x.shape), x.dtype), progress.now)
    progress, _, points = lax.while_loop(going, block, (progress, jnp.zeros((), int), empty))
    return points, progress.now.time, progress.taken


@states_at.defjvp
def _states_at_jvp(primals, tangents):
    result = states_at(*primals)
    _, moved = jax.jvp(replay, primals, tangents)
    return result, (moved, jnp.zeros(()), jnp.zeros(()))


def replay(problem: Problem, progress: Progress, times: Float[Array, " row"]) -> Point:
    """States at the saved instants from blocks in a loop of fixed length; NaN beyond it."""
    nothing = jax.tree.map(lambda x: jnp.broadcast_to(x, (KEEP, *x.shape)), no_record(progress))

    @jax.checkpoint
    def block(progress):
        return problem.method.block(problem.system, progress, reversible=True)

    def one(progress, _):
        going = (progress.now.time < times[-1]) & ~problem.method.stuck(progress)
        return lax.cond(going, block, lambda progress: (progress, nothing), progress)

    progress, records = lax.scan(one, progress, length=MOST_BLOCKS)
    flat = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), records)
    points = lax.map(lambda time: point_at(problem, flat, time)[0], times, batch_size=ROWS_TOGETHER)
    good = times <= progress.now.time
    return jax.tree.map(lambda x: jnp.where(along_rows(good, x), x, jnp.nan), points)
