"""Implicit methods with steps of a given size: generalized-alpha and energy-momentum.

The unknowns of a step are the accelerations (for energy-momentum, their mean over the step) and the
multipliers. Simplified Newton iterations find them (`fixed_step_solution.py`). One factorisation of the
iteration matrix serves a block of up to `STEPS_PER_FACTORISATION` steps. The factors are rotated with the
hub: inertia, elasticity, damping and rigidity are the same in every direction, so that only the change of
shape makes old factors worse, not the rotation.

A block ends before a step that does not converge, and the next block begins there with fresh factors. If
its first step fails too, the step is halved, up to `MAX_HALVINGS` times; after a whole step it is doubled
again.

A start may have trial steps. The end of a trial step serves only to improve the start, from which the steps
are then taken (`FixedStepMethod.after_trial`)."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Bool, Float, Int, Scalar
from esail_jax.numerics.lockstep import any_member, bounded_loop, cond_of_members, select, while_active
from esail_jax.steppers import step_error
from esail_jax.steppers.consistent import consistent_motion
from esail_jax.steppers.ended_tethers import message_of, with_ended_tethers
from esail_jax.steppers.fixed_step_method import FixedStepMethod
from esail_jax.steppers.fixed_step_state import (
    MAX_HALVINGS,
    TICKS,
    FixedStepState,
    IterationInfo,
    StepState,
    no_info,
)
from esail_jax.steppers.fixed_step_steps import FixedStepSteps, Interval, Node, Tape
from esail_jax.steppers.kinks import Nodes, kinked, kinks_passed
from esail_jax.steppers.log import Log, Statistic
from esail_jax.steppers.results import RESULTS
from esail_jax.steppers.step_error import StepErrors
from esail_jax.steppers.stepper import Motion, Point, replay_blocks
from esail_jax.system import System

STEPS_PER_FACTORISATION = 20
"""Largest number of steps in a block."""


class Attempts(NamedTuple):
    """What goes from one attempt of a block to the next.

    limit: number of steps that the next attempt takes; again: whether there is one; failure: convergence of
    the step that failed; start: the state from which the block starts; trying: whether the next attempt is
    a trial step, which improves that state at the start of a run; trials: number of trials that
    succeeded."""

    limit: Int[Array, ""]
    again: Bool[Array, ""]
    failure: IterationInfo
    start: StepState
    trying: Bool[Array, ""]
    trials: Int[Array, ""]


class FixedStep(FixedStepMethod):
    """Blocks of steps of a given size, with one factorisation per block, and their derivative."""

    steps_per_block: ClassVar[int] = STEPS_PER_FACTORISATION
    statistics: ClassVar[Mapping[str, Statistic]] = {
        "iterations_per_step": Statistic("-", "mean"),
        "last_increment": Statistic("m", "largest"),
        "constraint_violation": Statistic("m", "largest"),
        "residual": Statistic("N", "largest"),
        "tip_error": Statistic("-", "last"),
        "root_force_error": Statistic("-", "last"),
    }

    # ---- the interface of a stepper ----------------------------------------------------------------

    def init(self, model: System, start: Point, until: Scalar) -> tuple[FixedStepState, FixedStepSteps]:
        """The start with consistent accelerations. `until` is not used: the step size is given."""
        time, q, v, work, _ = start
        vdot, lam, _, power = consistent_motion(model, time, q, v)
        nothing = jax.tree.map(jnp.zeros_like, vdot)
        now = StepState(q, v, vdot, vdot, lam, nothing, nothing, work, power)
        zero, none = jnp.zeros(()), jnp.zeros((), int)
        errors = StepErrors.initial(model.tethers.count)
        tick = self.step_size / TICKS
        state = FixedStepState(now, time, tick, none, none, errors, zero, zero, RESULTS.successful)
        node, count = Node.of(now), STEPS_PER_FACTORISATION

        def repeated(x):
            return jnp.broadcast_to(x, (count, *jnp.shape(x)))

        ends, info = jax.tree.map(repeated, (node, no_info()))
        steps = FixedStepSteps(
            node,
            ends,
            repeated(time),
            repeated(self.step_size),
            repeated(False),
            repeated(True),
            info,
            none,
            errors.relative,
        )
        return state, steps

    def block(self, model: System, state: FixedStepState) -> tuple[FixedStepState, FixedStepSteps]:
        """Takes up to STEPS_PER_FACTORISATION steps with one factorisation. After a failed step the steps
        before it are repeated: failures are rare, and the loop then needs no selection after good steps.
        The same loop takes the trial steps, so that a run compiles a step once."""
        fine, one_step, wanted = self.stepping(model, state)

        def attempt(before, records, _):
            """Takes the steps, or a trial step. A failed step lowers the limit to the steps before it; a
            trial that succeeds gives a better start."""
            # Under `vmap` a member that has ended repeats its last turn, and writes the same records again.
            limit, _, failure, start, trying, trials = before
            most = jnp.where(trying, 1, limit)
            (now, *_), (ends, info, good) = bounded_loop(
                one_step, beginning(start), most, nothing, STEPS_PER_FACTORISATION
            )
            count = jnp.minimum(good.sum(), most)
            failed = ~trying & (count < limit)
            at = jnp.minimum(count, STEPS_PER_FACTORISATION - 1)
            failure = select(failed, jax.tree.map(lambda x: x[at], info), failure)
            better = trying & (count > 0)
            start = select(better, fine.after_trial(start, now), start)
            trials = trials + better
            again, limit = trying | failed, jnp.where(trying, limit, count)
            trying = better & (trials < self.trials)
            return Attempts(limit, again, failure, start, trying, trials), (now, ends, info)

        nothing = (Node.of(state.now), no_info(), jnp.asarray(False))
        room = jax.tree.map(
            lambda x: jnp.broadcast_to(x, (STEPS_PER_FACTORISATION, *jnp.shape(x))), nothing
        )
        trying = (state.taken == 0) & (self.trials > 0)
        first = Attempts(wanted, jnp.asarray(True), no_info(), state.now, trying, jnp.zeros((), int))
        last, (now, ends, info) = while_active(
            lambda attempts: attempts.again, attempt, first, (state.now, *room[:2])
        )
        tape = Tape(last.limit, last.limit < wanted, last.trials)
        return self.finished(model, state, now, ends, info, tape, last.failure)

    def stepping(
        self, model: System, state: FixedStepState
    ) -> tuple["FixedStep", Callable, Int[Array, ""]]:
        """The method with the present size of its steps, the function of one step with the factors
        of a block from this state, and the number of steps to take. With a halved step a block ends at the
        end of a whole step, where the step may be doubled."""
        now, ticks = state.now, TICKS >> state.halvings
        fine = replace(self, step_size=self.step_size * (ticks / TICKS))
        factors = fine.factor(model, state.time, now.q, now.v, now.lam)

        def one_step(carry):
            now, rate, index = carry
            time = state.origin + (state.ticks + index * ticks) * state.tick
            now, info = fine.step(model, time, now, factors, rate)
            good, inside = info.converged(), model.within_lengths(now.q)
            if inside is not None:
                good &= inside
            return (now, lax.stop_gradient(info.rate), index + 1), good, (Node.of(now), info, good)

        whole = (TICKS - state.ticks % TICKS) // ticks
        wanted = jnp.where(
            state.halvings > 0, jnp.minimum(whole, STEPS_PER_FACTORISATION), STEPS_PER_FACTORISATION
        )
        return fine, one_step, wanted

    def finished(
        self,
        model: System,
        state: FixedStepState,
        now: StepState,
        ends: Node,
        info: IterationInfo,
        tape: Tape,
        failure: IterationInfo,
    ) -> tuple[FixedStepState, FixedStepSteps]:
        """The state and the record after a block, and chooses the size of the next steps."""
        size = TICKS >> state.halvings
        index = jnp.arange(STEPS_PER_FACTORISATION)
        taken = index < tape.taken
        end = state.origin + (state.ticks + (index + 1) * size) * state.tick
        ticks = state.ticks + tape.taken * size
        length = size * state.tick
        errors = step_error.updated(
            state.errors, model, state.time, length, state.now.q, ends.q, tape.taken, self.phase_error
        )
        # The failed attempt is recorded after the steps that were taken.
        failed = tape.failed & (index == tape.taken)
        tried = taken | failed
        info = jax.tree.map(
            lambda x, y: jnp.where(failed.reshape(-1, *(1,) * (x.ndim - 1)), y, x), info, failure
        )
        sizes = jnp.where(tried, length, 0.0)
        before = Node.of(state.now)
        steps = FixedStepSteps(before, ends, end, sizes, tried, taken, info, tape.trials, errors.relative)

        no_progress = tape.failed & (tape.taken == 0)
        exhausted = no_progress & (state.halvings == MAX_HALVINGS)
        recovered = ~tape.failed & (state.halvings > 0) & (ticks % TICKS == 0)
        halvings = state.halvings + jnp.where(no_progress & ~exhausted, 1, 0) - jnp.where(recovered, 1, 0)
        ratio = 2.0 ** (state.halvings - halvings)
        now = select(halvings == state.halvings, now, self.rescaled(now, ratio))
        finite = jnp.isfinite(failure.increment).all()
        cause = RESULTS.where(finite, RESULTS.newton_diverged, RESULTS.nonfinite)
        cause = with_ended_tethers(model, state.now.q, state.now.v, length, True, cause)
        state = replace(
            state,
            now=now,
            ticks=ticks,
            halvings=halvings,
            errors=errors,
            taken=state.taken + tape.taken,
            rejected=state.rejected + tape.failed,
            result=RESULTS.where(exhausted, cause, state.result),
        )
        return state, steps

    def evaluate(self, model: System, step: Interval, time: Scalar) -> Point:
        return step.evaluate(time)

    def failure(self, model: System, state: FixedStepState, log: Log) -> str:
        ended = message_of(model, float(state.time), state.now.q, state.result)
        if ended is not None:
            return ended
        tried = np.asarray(log.tried)
        last = {name: np.asarray(x)[tried][-1] for name, x in log.statistics.items()}
        step, time = np.asarray(log.size)[tried][-1], np.asarray(log.end)[tried][-1]
        return (
            f"At t = {time:.6g} s with steps of {step:.3g} s, tether {int(last['tether'])}: last increment "
            f"{last['last_increment']:.3g} m after {int(last['iterations_per_step'])} iterations, "
            f"constraint violation {last['constraint_violation']:.3g} m. Smaller steps did not help."
        )

    def error_estimates(self, state: FixedStepState) -> dict[str, Scalar]:
        tip, force = state.errors.relative
        return {"tip_error": tip, "root_force_error": force}

    # ---- derivatives -------------------------------------------------------------------------------

    def tape(self, steps: FixedStepSteps) -> Tape:
        """The numbers of steps, which `replay` computes again."""
        return Tape(steps.taken.sum(), (steps.tried & ~steps.taken).any(), steps.trials)

    def replay(
        self,
        model: System,
        motion: Motion,
        ended: Motion,
        tapes: Tape,
        blocks: Int[Array, ""],
        times: Float[Array, " instant"],
    ) -> tuple[Motion, Point]:
        """Takes the blocks again, each in a loop of fixed length."""

        def block(state, tape):
            fine, one_step, _ = self.stepping(model, state)
            start = fine.after_trials(one_step, state.now, tape.trials)

            def step(carry, index):
                def go(carry):
                    (end, *others), _, (_, info, _) = one_step(carry)
                    begins = state.origin + state.ticks * state.tick + carry[2] * fine.step_size
                    end = behind_kinks(model, begins, fine.step_size, carry[0], end)
                    return (end, *others), (Node.of(end), info)

                def stay(carry):
                    return carry, (Node.of(carry[0]), no_info())

                return cond_of_members(index < tape.taken, go, stay, carry)

            (now, *_), (ends, info) = lax.scan(step, beginning(start), jnp.arange(STEPS_PER_FACTORISATION))
            return self.finished(model, state, now, ends, info, tape, no_info())

        return replay_blocks(self, model, motion, block, tapes, blocks, times)

    def after_trials(self, one_step: Callable, start: StepState, count: Int[Array, ""]) -> StepState:
        """The start after `count` trial steps that converged. The loop has a fixed length, because
        reverse mode cannot differentiate a loop that ends early."""
        if not self.trials:
            return start

        def go(start):
            (end, *_), *_ = one_step(beginning(start))
            return self.after_trial(start, end)

        def trial(start, number):
            return cond_of_members(number < count, go, lambda start: start, start), None

        def with_trials(start):
            return lax.scan(trial, start, jnp.arange(self.trials))[0]

        return lax.cond(any_member(count > 0), with_trials, lambda start: start, start)


def behind_kinks(system: System, time: Scalar, h: Scalar, start: StepState, end: StepState) -> StepState:
    """The end of a step with the derivatives that kinks of loads within the step give it
    (`kinks.py`). time [s]: the start of the step."""
    if not kinked(system):
        return end
    pairs = jax.tree.map(lambda *x: jnp.stack(x), (start.q, start.v), (end.q, end.v))
    nodes = Nodes(jnp.stack([time, time + h]), *pairs)
    kicks = kinks_passed(system, nodes, nodes.at(-1))
    added = kicks.q, kicks.v, kicks.work
    q, v, work = jax.tree.map(jnp.add, (end.q, end.v, end.work), added)
    return end._replace(q=q, v=v, work=work)


def beginning(start: StepState) -> tuple[StepState, Scalar, Int[Array, ""]]:
    """The argument of the first step of a block: the state, an infinite convergence rate, because
    there is no earlier step with these factors, and the number 0 of the step."""
    return start, jnp.asarray(jnp.inf), jnp.zeros((), int)
