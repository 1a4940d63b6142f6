"""Replay of the steps of collocation from their records, as differentiable functions.

No equation is solved again: the stages are known, and the implicit function theorem gives their derivative
(`collocation_solution.known_stages`).

Steps and blocks have a checkpoint within `lax.cond` and another one around it. The inner one keeps the
intermediate values of a step out of the results of `cond`. The outer one keeps its arguments out of the
results of the loop, which would store a copy of the system and of the factors for every step: JAX sees that
the arguments of a checkpoint do not change in a loop, but not that the results of `cond` do not."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Bool, Float, Int, Scalar
from esail_jax.numerics.lockstep import any_member, cond_of_members, select, true_or_of_members
from esail_jax.numerics.symbolic_zeros import nothing_of, with_tangent_of
from esail_jax.steppers.collocation_solution import known_stages
from esail_jax.steppers.collocation_stages import (
    StageUnknowns,
    StepEnd,
    end_of_step,
    factor,
    stage_powers,
    work_of_step,
)
from esail_jax.steppers.collocation_steps import CollocationState, CollocationSteps, nodes_of_step
from esail_jax.steppers.kinks import kinked, kinks_passed
from esail_jax.steppers.knots import behind
from esail_jax.steppers.stepper import AbstractStepper, Motion, Point, points_within
from esail_jax.system import Power, System


def replay_window(
    stepper: AbstractStepper,
    system: System,
    motion: Motion,
    ended: Motion,
    tapes: CollocationSteps,
    blocks: Int[Array, ""],
    times: Float[Array, " instant"],
) -> tuple[Motion, Point]:
    """Replays the blocks of a window. Arguments and results are those of `AbstractStepper.replay`."""
    assert isinstance(motion.state, CollocationState) and isinstance(ended.state, CollocationState)
    start = motion.state.now
    counted = jnp.arange(len(tapes.taken)) < blocks
    tapes = lax.stop_gradient(replace(tapes, taken=tapes.taken & counted[:, None]))

    @jax.checkpoint
    def block(now, records):
        return replay_steps(system, now, records)

    now, (records, kicks) = lax.scan(jax.checkpoint(unless_empty(block)), start, tapes)
    flat, kicks = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), (records, kicks))
    afresh = system.knots(start.time, start.q, start.v) is not None
    begins = jnp.zeros(records.taken.shape, bool).at[:, 0].set(afresh) & records.taken
    (work, power), flat = replay_work(system, start, flat, begins.ravel(), kicks)
    records = jax.tree.map(lambda x, like: x.reshape(like.shape), flat, records)
    points = points_within(stepper, system, motion.last, records, records.taken, times)
    # The time has no derivative: step sizes are given.
    now = now._replace(time=ended.state.now.time, work=work, power=power)
    index = jnp.maximum(blocks - 1, 0)
    last = jax.tree.map(lambda x, y: jnp.where(blocks > 0, x[index], y), records, motion.last)
    # The other parts of the state decide how fast a step is solved, not its result.
    state = lax.stop_gradient(ended.state)
    return motion._replace(state=replace(state, now=now), last=last), points


def unless_empty(block: Callable) -> Callable:
    """The function of a block of steps, which skips a block without steps. Its records are then
    zeros, which are written faster than copied."""

    def nothing(carry, records):
        return carry, nothing_of(jax.eval_shape(block, carry, records)[1])

    def one(carry, records):
        return lax.cond(any_member(records.taken.any()), block, nothing, carry, records)

    return one


class Kick(NamedTuple):
    """What kinks of loads within a step add to the work and to the power at its end."""

    work: Power
    power: Power


def replay_steps(
    system: System, now: StepEnd, records: CollocationSteps
) -> tuple[StepEnd, tuple[CollocationSteps, Kick | None]]:
    """The end of the last step of a block and the records of the steps, as differentiable functions
    of the system and of the start of the first step. Step sizes carry no derivative. Work and powers, on
    which nothing else depends, are left to `replay_work`, with what kinks add to them."""
    h = records.h[0]
    now = now._replace(time=records.start.time[0])
    if system.knots(now.time, now.q, now.v) is not None:
        now = behind(system, now)
    lam = jax.tree.map(lambda x: x[0, 0], records.stages.lam)
    factors = lax.stop_gradient(factor(*lax.stop_gradient((system, now, h, lam))))

    @jax.checkpoint
    def step(now, record):
        # A rejected step may be infinite, and infinity times zero is NaN.
        stages = jax.tree.map(lambda x: jnp.where(record.taken, x, 0.0), record.stages)
        # The recorded start: the derivative of a step needs no earlier step to be computed again. A member
        # of a batch without this step goes on from where it is.
        now = with_tangent_of(select(true_or_of_members(record.taken), record.start, now), now)
        unknowns = known_stages(system, now, h, stages, factors)
        q, v = end_of_step(system, now, h, unknowns, factors)
        end = now._replace(q=q, v=v, vdot=jax.tree.map(lambda x: x[-1], unknowns.vdot))
        end, kick = behind_kinks(system, now, h, unknowns, end)
        return end, (replace(record, start=now, stages=unknowns), kick)

    @jax.checkpoint
    def step_or_stay(now, record):
        now = now._replace(time=record.start.time)
        none = no_kick(system, now)

        def stay(now, record):
            return now, (replace(record, start=now), none)

        return cond_of_members(record.taken, step, stay, now, record)

    return lax.scan(step_or_stay, now, records)


def no_kick(system: System, now: StepEnd) -> Kick | None:
    """The record of a step without kinks; None for a system whose loads have none."""
    return Kick(*jax.tree.map(jnp.zeros_like, (now.work, now.power))) if kinked(system) else None


def behind_kinks(
    system: System, now: StepEnd, h: Scalar, unknowns: StageUnknowns, end: StepEnd
) -> tuple[StepEnd, Kick | None]:
    """The end of a step with the derivatives that kinks of loads within the step give it
    (`kinks.py`), and what they add to work and power."""
    if not kinked(system):
        return end, None
    nodes = nodes_of_step(now, h, unknowns.vdot)
    kicks = kinks_passed(system, nodes, (nodes.time[-1], end.q, end.v))
    added = kicks.q, kicks.v, kicks.vdot
    q, v, vdot = jax.tree.map(jnp.add, (end.q, end.v, end.vdot), added)
    return end._replace(q=q, v=v, vdot=vdot), Kick(kicks.work, kicks.power)


def replay_work(
    system: System,
    start: StepEnd,
    records: CollocationSteps,
    begins: Bool[Array, " step"],
    kicks: Kick | None,
) -> tuple[tuple[Power, Power], CollocationSteps]:
    """Adds powers and work to consecutive records of `replay_steps`, beginning with those of `start`.
    begins: true for steps taken whose power at the start is that of the record, behind a knot; kicks: what
    kinks within the steps add.

    Returns the work and the power at the end, and the records."""

    @jax.checkpoint
    def powers(record):
        stages = jax.tree.map(lambda x: jnp.where(record.taken, x, 0.0), record.stages)
        return stage_powers(system, record.start, record.h, stages)

    def step(before, record):
        power = powers(record)
        work = jax.tree.map(jnp.add, before[0], work_of_step(record.h, before[1], power))
        return (work, jax.tree.map(lambda x: x[-1], power)), power

    @jax.checkpoint
    def step_or_stay(before, row):
        record, begins, kick = row
        none = jax.tree.map(jnp.zeros_like, record.power)
        before = before[0], select(begins, record.start.power, before[1])
        after, power = cond_of_members(record.taken, step, lambda *x: (x[0], none), before, record)
        if kick is not None:
            after = jax.tree.map(jnp.add, after, tuple(kick))
        return after, (before, power)

    rows = records, begins, kicks
    end, ((work, first), power) = lax.scan(step_or_stay, (start.work, start.power), rows)
    return end, replace(records, start=records.start._replace(work=work, power=first), power=power)
