"""The loop that takes steps until the saved instants of a window are passed, and its derivative.

The host calls `advance` for one window after the other (`host.py`); a traced run calls `move` in a scan
over windows (`traced.py`). The projection on the constraints and the observables follow in `look.py`."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.ad_checkpoint import checkpoint_name

from esail_jax.array_types import Array, Bool, Float, Int, Scalar
from esail_jax.compilation.jit import traced_once
from esail_jax.numerics.lockstep import any_member, buffer_set, while_active
from esail_jax.numerics.own_derivative import custom_jvp
from esail_jax.numerics.symbolic_zeros import jvp_of_perturbed
from esail_jax.simulation.law_jumps import largest_jump
from esail_jax.simulation.problem import Problem
from esail_jax.steppers.results import RESULTS
from esail_jax.steppers.stepper import (
    AbstractState,
    AbstractStepper,
    AbstractSteps,
    Motion,
    Point,
    nan_like,
)

TAPES = "steps as taken"
"""Checkpoint name of all that is known of the steps of a window (`Taken`). It must be saved: step sizes
that are computed again in the backward pass may differ by rounding, and the gradient would be that of other
steps. If a single number of it were not saved, the steps would be taken again for that number."""


class Window(NamedTuple):
    """Saved instants [s] in increasing order, of which the first `count` are used."""

    times: Float[Array | np.ndarray, " instant"]
    count: Int[Array | np.ndarray, ""]  # type: ignore[assignment]  # hides `tuple.count`


class Advanced(NamedTuple):
    """The result of `advance`: the motion; the points at the instants, NaN where they were not passed;
    what `keep` returned for each block; the number of instants passed and of batches taken; the time
    reached [s], and the numbers of steps taken and rejected, which the host would otherwise have to
    compute."""

    motion: Motion
    points: Point
    kept: Any
    passed: Int[Array, ""]
    batches: Int[Array, ""]
    time: Scalar
    counts: Float[Array, "2"]


def advance(
    problem: Problem,
    motion: Motion,
    window: Window,
    max_steps: Scalar,
    max_batches: Int[Array, ""],
    keep: Callable[[AbstractSteps], Any] | None = None,
    room: int = 0,
) -> Advanced:
    """Takes blocks of steps until all instants of the window are passed, `max_batches` batches of blocks
    were taken, the run has `max_steps` steps, or the stepper fails.

    A batch is `stepper.blocks_per_batch` blocks, or fewer where an instant is passed. keep: a function of
    a block's steps, whose results are returned with `room` batches of blocks along a new first axis."""
    stepper, model = problem.stepper, problem.model
    times = window.times

    def passed(motion, row):
        index = jnp.minimum(row, len(times) - 1)
        return (row < window.count) & (times[index] <= motion.state.time)

    def may_step(motion, batches):
        going = motion.state.result == RESULTS.successful
        return going & (batches < max_batches) & (motion.counts[0] < max_steps)

    def active(carry):
        motion, row, batches = carry
        return passed(motion, row) | ((row < window.count) & may_step(motion, batches))

    def turn(carry, buffers, is_active):
        motion, row, batches = carry
        points, kept = buffers

        def look(row, points, is_active):
            # A branch of its own: XLA runs the small operations of a point faster apart from the buffers.
            time = times[row]
            point = lax.cond(
                any_member(is_active), lambda: point_of(problem, motion, time), lambda: nothing
            )
            return row + 1, buffer_set(points, row, point, is_active)

        row, points = while_active(lambda row: is_active & passed(motion, row), look, row, points)

        due = times[jnp.minimum(row, len(times) - 1)]
        wanted = is_active & (row < window.count) & may_step(motion, batches)
        limit = max_steps - motion.earlier[0]

        def waiting(carry):
            (state, *_), count = carry
            going = (state.time < due) & (state.taken < limit) & (state.result == RESULTS.successful)
            return wanted & going & (count < stepper.blocks_per_batch)

        def block(carry, part, is_active):
            motion, count = carry
            state, steps = block_of(stepper, model, motion.state)
            if keep is not None:
                part = buffer_set(part, count, keep(steps), is_active)
            jump = (
                motion.jump
                if motion.jump is None
                else jnp.maximum(motion.jump, largest_jump(stepper, model, steps))
            )
            return (Motion(state, steps, motion.earlier, jump), count + 1), part

        (motion, count), part = while_active(waiting, block, (motion, none), empty)
        if keep is not None:
            # A turn without a block writes into a place that the next turn fills, or into the last place,
            # which is dropped.
            kept = buffer_set(kept, batches, part, is_active)
        return (motion, row, batches + jnp.minimum(count, 1)), (points, kept)

    none = jnp.zeros((), int)
    points = room_for(len(times), lambda: point_of(problem, motion, times[0]))
    nothing = jax.tree.map(lambda x: x[0], points)
    empty = () if keep is None else room_for(stepper.blocks_per_batch, lambda: keep(motion.last))
    empty = jax.tree.map(jnp.zeros_like, empty)
    kept = jax.tree.map(lambda x: jnp.zeros((room + 1, *x.shape), x.dtype), empty)
    (motion, row, batches), (points, kept) = while_active(
        active, turn, (motion, none, none), (points, kept)
    )
    kept = jax.tree.map(lambda x: x[:-1].reshape(-1, *x.shape[2:]), kept)
    motion = with_limit(motion, row < window.count, max_steps)
    return Advanced(motion, points, kept, row, batches, motion.state.time, motion.counts)


@traced_once()
def block_of(stepper: AbstractStepper, model: Any, state: AbstractState) -> tuple[Any, AbstractSteps]:
    """The result of `stepper.block`."""
    return stepper.block(model, state)


@traced_once()
def point_of(problem: Problem, motion: Motion, time: Scalar) -> Point:
    """Dense output at a time [s] within the last block."""
    return problem.stepper.evaluate(problem.model, motion.last.pick(motion.last.find(time)), time)


def room_for(count: int, one: Callable[[], Any]) -> Any:
    """Buffers with NaN for `count` results of a function, along a new first axis."""
    shapes = jax.eval_shape(one)
    return nan_like(jax.tree.map(lambda x: jnp.zeros((count, *x.shape), x.dtype), shapes))


def with_limit(motion: Motion, unfinished: Bool[Array, ""], max_steps: Scalar) -> Motion:
    """The motion, with the result `too_many_steps` if `max_steps` ended it."""
    state = motion.state
    ended = unfinished & (state.result == RESULTS.successful) & (motion.counts[0] >= max_steps)
    return with_result(motion, RESULTS.where(ended, RESULTS.too_many_steps, state.result))


def with_result(motion: Motion, result: RESULTS) -> Motion:
    """The motion with another result."""
    state = motion.state
    values = {field: getattr(state, field) for field in state.__dataclass_fields__}
    return motion._replace(state=type(state)(**values | {"result": result}))


# ---- under a trace ------------------------------------------------------------------------------


NO_LIMIT = 2**62
"""A number of batches that no run reaches."""


@jax.custom_jvp
def move(
    problem: Problem, motion: Motion, window: Window, max_steps: Scalar
) -> tuple[Motion, Point, Int[Array, ""]]:
    """The motion after the instants of a window, the points at the instants, and the number of
    instants passed.

    The derivative, in forward and in reverse mode, is that of the steps that were taken. They are recorded,
    in at most `stepper.blocks_per_window` batches of blocks, and replayed in loops of fixed length."""
    advanced = advance(problem, motion, window, max_steps, jnp.asarray(NO_LIMIT))
    return advanced.motion, advanced.points, advanced.passed


@functools.partial(move.defjvp, symbolic_zeros=True)
def _move_jvp(primals, tangents):
    problem, motion, window, max_steps = primals
    stepper, room = problem.stepper, problem.stepper.blocks_per_window
    given = lax.stop_gradient((problem, motion, window, max_steps))
    advanced = advance(*given, jnp.asarray(room), stepper.tape, room)
    short = (advanced.passed < window.count) & (advanced.motion.state.result == RESULTS.successful)
    result = RESULTS.where(short, RESULTS.too_many_steps, advanced.motion.state.result)
    ended = with_result(advanced.motion, result)
    taken = lax.stop_gradient(Taken(advanced.kept, ended, advanced.batches, advanced.points))
    taken = jax.tree.map(lambda x: checkpoint_name(x, TAPES), taken)
    results, moved = as_taken_and_moved(taken, primals, tangents)
    return (*results, advanced.passed), (*moved, none_like(advanced.passed))


class Taken(NamedTuple):
    """What is known of a window once its steps were taken: their records, the motion after them, the number
    of batches, and the points at its instants."""

    tapes: Any
    ended: Motion
    batches: Int[Array, ""]
    points: Point


@custom_jvp
def as_taken(
    problem: Problem, motion: Motion, window: Window, max_steps: Scalar, taken: Taken
) -> tuple[Motion, Point]:
    """The motion after a window and the points at its instants as they are known, with the
    derivatives, of any order, of the steps that were taken."""
    return taken.ended, taken.points


@functools.partial(as_taken.defjvp, symbolic_zeros=True)
def _as_taken_jvp(primals, tangents):
    return as_taken_and_moved(primals[4], primals[:4], tangents[:4])


def as_taken_and_moved(taken: Taken, primals: tuple, tangents: tuple) -> tuple[tuple, tuple]:
    """The result of `as_taken` and its tangent, which is that of the steps taken again."""

    def replayed(problem, motion, window, max_steps):
        times = jnp.where(jnp.arange(len(window.times)) < window.count, window.times, window.times[0])
        steps = taken.ended, taken.tapes, taken.batches
        return problem.stepper.replay(problem.model, motion, *steps, times)

    return as_taken(*primals, taken), jvp_of_perturbed(replayed, primals, tangents)[1]


def none_like(count: Array) -> Any:
    """The tangent of an integer, which JAX represents by the type float0."""
    return jnp.zeros(count.shape, jax.dtypes.float0)


def keep_tapes(body: Callable) -> Callable:
    """The function with a checkpoint: reverse mode saves the tapes and computes everything else
    again."""
    return jax.checkpoint(body, policy=jax.checkpoint_policies.save_only_these_names(TAPES))
