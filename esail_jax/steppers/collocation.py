"""Collocation at damped Lobatto points in acceleration form (Hairer & Wanner II, IV.5-IV.8 and VII.4).

The accelerations of a step are a polynomial through s + 1 points; the first is the start of the step, the
last its end (`collocation_stages.py`). The order is 2 s - 1 = 7; that of generalized-alpha is 2. The
constraints enter by their second derivative, which makes the equations of index 1 and preserves the order.
Positions and velocities are projected on the constraints at the end of every step.

A block of up to `STEPS_PER_FACTORISATION` steps of one size uses one factorisation. The accelerations of
the last step vary slowly in the axes of the hub, and are extrapolated there for the first guess. The error
of every step is estimated and determines the size of the next steps."""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Int, Scalar, Vector
from esail_jax.coordinates import Coordinates
from esail_jax.numerics.angles import rotation_by
from esail_jax.numerics.lockstep import bounded_loop, select
from esail_jax.numerics.small_matrices import matmul
from esail_jax.steppers.collocation_replay import replay_window
from esail_jax.steppers.collocation_solution import MAX_ITERATIONS, solve_stages
from esail_jax.steppers.collocation_stages import (
    STAGES,
    TABLE,
    FrozenFactors,
    StageUnknowns,
    StepEnd,
    combined,
    end_of_step,
    factor,
    largest,
    lengths,
    rounding,
    stage_powers,
    stage_states,
    work_of_step,
)
from esail_jax.steppers.collocation_step_size import change_of_step, first_step, next_step
from esail_jax.steppers.collocation_steps import (
    CollocationState,
    CollocationSteps,
    History,
    IterationInfo,
    no_step,
    nodes_of_step,
    zero_length_steps,
)
from esail_jax.steppers.consistent import consistent_motion
from esail_jax.steppers.ended_tethers import message_of, with_ended_tethers
from esail_jax.steppers.kinks import kinked, kinks_passed
from esail_jax.steppers.knots import behind, fitting_step, knots_ahead
from esail_jax.steppers.log import Log, Statistic
from esail_jax.steppers.results import RESULTS
from esail_jax.steppers.stepper import AbstractStepper, Motion, Point
from esail_jax.system import System

STEPS_PER_FACTORISATION = 24
"""Largest number of steps per factorisation. In corotational axes the factors serve much longer; the bound
allows the step size to grow after this number of steps."""

FACTORISATION_COST = 5
"""A factorisation costs about as much as this many iterations. A block ends once its steps have needed this
many iterations more than they would have with the number of the block's fastest step."""

NEWTON_FRACTION = 0.01
"""The stages are solved to this fraction of the tolerance."""

ERROR_FACTOR = 1.0 / 64.0
"""The error estimate is multiplied by this: it belongs to a polynomial of one degree less and is therefore
too large. With this factor a tolerance of 1e-8 gives every observable of the baseline to 1e-3 over three
periods."""

ROUNDING = 5e-15
"""With a given step size, stages are solved to this fraction of the tether length, so that only the error
of the step itself remains."""

END_BLOCK_GAIN = 1.5
"""A block ends early if the step size could grow by this factor in two successive steps."""


class Collocation(AbstractStepper):
    """Damped Lobatto collocation with error control, or with a given step size.

    step_size: length of every step [s], or None for error control; tolerance: largest local error of a
    position, relative to the length of the tethers (for the hub, to its size). The stages are solved to a
    small fraction of the tolerance, or to rounding if the step size is given."""

    step_size: Scalar | None
    tolerance: Scalar

    name: ClassVar[str] = "collocation"
    order: ClassVar[int] = 2 * STAGES - 1
    steps_per_block: ClassVar[int] = STEPS_PER_FACTORISATION
    statistics: ClassVar[Mapping[str, Statistic]] = {"iterations_per_step": Statistic("-", "mean")}

    def init(self, model: System, start: Point, until: Scalar) -> tuple[CollocationState, CollocationSteps]:
        """The start with consistent accelerations, which also serve as a constant history:
        accelerations before an event do not predict those after it."""
        system, (time, q, v, work, _) = model, start
        vdot, lam, _, power = consistent_motion(system, time, q, v)
        zero = jnp.zeros(())
        now = StageUnknowns(vdot.rotate(system.rotation(time, q).T), lam)
        constant = jax.tree.map(lambda x: jnp.broadcast_to(x, (STAGES + 1, *x.shape)), now)
        h = self.step_size
        if h is None:
            h = jnp.minimum(first_step(system, time, q, vdot, self.tolerance), until - time)
        history = History(constant, jnp.asarray(jnp.inf))
        at_start = StepEnd(time, q, v, vdot, work, power)
        state = CollocationState(at_start, history, h, zero, zero, time, RESULTS.successful)
        return state, zero_length_steps(state, STEPS_PER_FACTORISATION)

    def block(self, model: System, state: CollocationState) -> tuple[CollocationState, CollocationSteps]:
        """Takes up to STEPS_PER_FACTORISATION steps with one factorisation, fewer if a step fails, could be
        much longer, or converges slowly with these factors.

        Steps end at knots (`knots.py`): up to there they have one size, and the size that they could have
        is kept for the steps beyond."""
        system, wanted, stop = model, state.h, None
        knots = knots_ahead(system, state.now)
        if knots is not None:
            state = replace(state, now=behind(system, state.now))
        if knots is not None and self.step_size is None:
            h, stop = fitting_step(knots, state.now.time, state.h)
            state = replace(state, h=h)
        lam = jax.tree.map(lambda x: x[-1], state.history.values.lam)
        factors, h = factor(system, state.now, state.h, lam), state.h

        def step(carry):
            state, fewest, steps, spent, error_before = carry
            state, good, record = self.attempt(system, state, factors)
            error, count = record.info.error, record.info.iterations
            fewest, steps, spent = jnp.minimum(fewest, count), steps + 1, spent + count
            going = good & (spent - steps * fewest < FACTORISATION_COST)
            if self.step_size is None:
                going &= change_of_step(jnp.maximum(error, error_before)) < END_BLOCK_GAIN
            if stop is not None:
                going &= state.now.time + 0.5 * h < stop
            return (state, fewest, steps, spent, error), going, record

        none = jnp.zeros((), int)
        carry = (state, jnp.asarray(MAX_ITERATIONS), none, none, jnp.asarray(jnp.inf))
        last, records = bounded_loop(step, carry, STEPS_PER_FACTORISATION, no_step(state))
        state = last[0]
        if self.step_size is None:
            following = next_step(state, records, h)
            if stop is not None:
                following = jnp.where(state.h == h, jnp.maximum(following, wanted), following)
            state = replace(state, h=following)
        else:
            # A step that failed with factors of an earlier one is tried again with fresh factors.
            state = replace(state, h=jnp.where(records.taken[0], h, state.h))
        return replace(state, result=self.outcome(system, state)), records

    def attempt(
        self, system: System, state: CollocationState, factors: FrozenFactors
    ) -> tuple[CollocationState, Array, CollocationSteps]:
        """Tries one step. Returns the state after it, with a smaller step size if it was rejected; whether
        it was accepted; and its record."""
        now, h = state.now, state.h
        guess = first_guess(system, state)
        part = ROUNDING if self.step_size is not None else NEWTON_FRACTION * self.tolerance
        enough = jnp.maximum(part * lengths(system, now.time, now.q), rounding(now.q))
        unknowns, iterations, left = solve_stages(system, now, h, guess, factors, enough)
        solved = left <= 1.0
        times, q, _ = stage_states(now, h, unknowns.vdot)
        values = in_hub_axes(system, state.history, times, q, unknowns)
        error = self.error(system, now, h, unknowns.vdot)
        good = solved & jnp.isfinite(error)
        if self.step_size is None:
            good &= error <= 1.0

        q_and_v = end_of_step(system, now, h, unknowns, factors)
        inside = system.within_lengths(q_and_v[0])
        if inside is not None:
            good &= inside
        power = stage_powers(system, now, h, unknowns)
        work = jax.tree.map(jnp.add, now.work, work_of_step(h, now.power, power))
        taken = state.taken + 1.0
        # A given step is multiplied: a sum would accumulate rounding errors.
        later = now.time + h if self.step_size is None else state.origin + taken * h
        last_vdot, last_power = jax.tree.map(lambda x: x[-1], (unknowns.vdot, power))
        end = StepEnd(later, *q_and_v, last_vdot, work, last_power)
        history = History(values, h)
        done = replace(state, now=end, history=history, h=h, taken=taken)

        shorter = jnp.zeros(())  # no other size is allowed: the run has failed
        if self.step_size is None:
            usual = solved & jnp.isfinite(error)
            by_error = jnp.where(usual if inside is None else usual & inside, change_of_step(error), 0.5)
            shorter = h * jnp.minimum(by_error, 0.9)
        again = replace(state, h=shorter, rejected=state.rejected + 1.0)
        after = select(good, done, again)
        info = IterationInfo(iterations, left, error)
        return after, good, CollocationSteps(now, h, later, unknowns, power, info, good)

    def error(self, system: System, now: StepEnd, h: Scalar, vdot: Coordinates) -> Scalar:
        """The estimated local error over the tolerance: the change of positions within the step if
        the polynomial of the accelerations does not pass through the start of the step."""
        scale = ERROR_FACTOR * TABLE.between() * h**2
        first, *others = TABLE.difference()

        def beyond(before, stages):
            return scale * (first * before + jnp.tensordot(np.array(others), stages, 1))

        errors = jax.tree.map(beyond, now.vdot, vdot)
        return largest(system, errors, self.tolerance * lengths(system, now.time, now.q))

    def outcome(self, system: System, state: CollocationState) -> RESULTS:
        """Tells whether the method can go on: the state is finite, the step changes the time, and no tether
        has come to its end."""
        finite = jnp.stack([jnp.isfinite(x).all() for x in jax.tree.leaves(state.now)]).all()
        moves = state.now.time + 0.25 * state.h > state.now.time
        failed = RESULTS.where(finite, RESULTS.newton_diverged, RESULTS.nonfinite)
        result = RESULTS.where(finite & moves, RESULTS.successful, failed)
        given = self.step_size
        h = state.h if given is None else jnp.where(state.h > 0.0, 0.0, given)
        return with_ended_tethers(system, state.now.q, state.now.v, h, given is not None, result)

    def evaluate(self, model: System, step: CollocationSteps, time: Scalar) -> Point:
        """Evaluates the polynomials of the step, with the derivatives that kinks of loads within the step,
        before the instant, give the result (`kinks.py`)."""
        point = step.at(time)
        parts = point.q, point.v, point.work
        if kinked(model):
            nodes = nodes_of_step(step.start, step.h, step.stages.vdot)
            kicks = kinks_passed(model, nodes, (time, point.q, point.v))
            parts = jax.tree.map(jnp.add, parts, (kicks.q, kicks.v, kicks.work))
        return Point(time, *parts, jnp.asarray(False))

    def failure(self, model: System, state: CollocationState, log: Log) -> str:
        sizes = np.asarray(log.size)[np.asarray(log.tried)]
        size = sizes[-1] if len(sizes) else float("nan")
        ended = message_of(model, float(state.time), state.now.q, state.result)
        if ended is not None:
            return ended
        hint = "" if self.step_size is None else " Ask for a shorter one."
        return f"At t = {float(state.time):.6g} s with a step of {size:.3g} s.{hint}"

    # ---- derivatives ----------------------------------------------------------------------------

    def tape(self, steps: CollocationSteps) -> CollocationSteps:
        """The whole record, so that no step is solved twice."""
        return steps

    def replay(
        self,
        model: System,
        motion: Motion,
        ended: Motion,
        tapes: CollocationSteps,
        blocks: Int[Array, ""],
        times: Float[Array, " instant"],
    ) -> tuple[Motion, Point]:
        """Reads the steps from their records; the implicit function theorem gives their derivative."""
        return replay_window(self, model, motion, ended, tapes, blocks, times)


# ---- first guess --------------------------------------------------------------------------------


def first_guess(system: System, state: CollocationState) -> StageUnknowns:
    """Accelerations and multipliers extrapolated from the last step in the axes of the hub, which
    are assumed to keep their angular velocity."""
    now, h = state.now, state.h
    x = 1.0 + TABLE.nodes * (h / state.history.h)
    weights = matmul(jnp.vander(x, STAGES + 1, increasing=True), TABLE.extrapolation())
    values = jax.tree.map(lambda old: combined(weights, old), state.history.values)
    spin, attitude = angular_velocity(system, now), system.rotation(now.time, now.q)
    times = now.time + h * TABLE.nodes

    def outward(time, vdot):
        turned = vdot.rotate(matmul(rotation_by(spin * (time - now.time)), attitude))
        return system.place_roots(time, turned, derivative=2)

    return StageUnknowns(jax.vmap(outward)(times, values.vdot), values.lam)


def in_hub_axes(
    system: System,
    history: History,
    times: Float[Array, " stage"],
    q: Coordinates,
    unknowns: StageUnknowns,
) -> StageUnknowns:
    """The stages in the axes of the hub, after the start of the step (the end of the last step)."""
    axes = jax.vmap(system.rotation)(times, q)
    body = jax.vmap(lambda a, r: a.rotate(r.T))(unknowns.vdot, axes)
    return jax.tree.map(
        lambda old, new: jnp.concatenate([old[-1:], new]), history.values, StageUnknowns(body, unknowns.lam)
    )


def angular_velocity(system: System, now: StepEnd) -> Vector:
    """The angular velocity [rad/s] of the hub or of the rotating frame, in inertial axes."""

    def attitude(tau):
        q = now.q if now.q.hub is None else now.q.axpy(tau, now.v)
        return system.rotation(now.time + tau, q)

    axes, rate = jax.jvp(attitude, (jnp.zeros(()),), (jnp.ones(()),))
    skew = matmul(rate, axes.T)
    return 0.5 * jnp.stack([skew[2, 1] - skew[1, 2], skew[0, 2] - skew[2, 0], skew[1, 0] - skew[0, 1]])
