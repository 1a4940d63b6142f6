"""Implicit methods with steps of a given size: generalized-alpha and energy-momentum.

The unknowns of a step are the accelerations (for energy-momentum, their mean over the step) and the
multipliers. Simplified Newton iterations find them (`fixed_step_solution.py`). One factorisation of the
iteration matrix serves a block of up to `STEPS_PER_FACTORISATION` steps. The factors are rotated with the
hub: inertia, elasticity, damping and rigidity are the same in every direction, so that only the change of
shape makes old factors worse, not the rotation.

A block ends before a step that does not converge, and the next block begins there with fresh factors. If
its first step fails too, the step is halved, up to `MAX_HALVINGS` times; after a whole step it is doubled
again."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax import iteration_matrix
from esail_jax.array_types import Array, Bool, Float, Int, Rotation, Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.numerics import bordered
from esail_jax.numerics.lockstep import bounded_loop, select, while_active
from esail_jax.steppers.consistent import consistent_motion
from esail_jax.steppers.results import RESULTS
from esail_jax.steppers.step_error import StepErrors, after_block, no_errors
from esail_jax.steppers.stepper import (
    AbstractState,
    AbstractStepper,
    AbstractSteps,
    Log,
    Motion,
    Point,
    Statistic,
    replay_blocks,
)
from esail_jax.system import Power, System

STEPS_PER_FACTORISATION = 20
"""Largest number of steps in a block."""

MAX_HALVINGS = 6
"""Largest number of halvings of a step whose iterations do not converge. After it the run fails."""

TICKS = 2**MAX_HALVINGS
"""Units of time per whole step: the end of every step, halved or not, is an exact multiple of the unit."""

MAX_ITERATIONS = 12
"""Largest number of iterations of a step, after which the step has failed. Good steps need one or two."""

SNAP = 1e-9
"""An instant that differs from the end of a step by less than this fraction of the step is that end:
multiples of decimal fractions are rounded in binary."""


class StepState(NamedTuple):
    """The motion at the end of a step, and the memory of earlier steps that the next step needs.

    a: the auxiliary acceleration of generalized-alpha; vdot_difference, vdot_second_difference: differences
    of vdot over the last steps, for the next first guess; work: external work and dissipated energy [J]
    since the start of the run; power: their rates [W]."""

    q: Coordinates
    v: Coordinates
    vdot: Coordinates
    a: Coordinates
    lam: Multipliers
    vdot_difference: Coordinates
    vdot_second_difference: Coordinates
    work: Power
    power: Power


class FixedStepState(AbstractState):
    """The state after a block.

    origin: time of the call of `init` [s]; tick: step/TICKS [s]; ticks: time since `origin` in this unit;
    halvings: present number of halvings of the step; errors: the estimated errors so far."""

    now: StepState
    origin: Scalar
    tick: Scalar
    ticks: Int[Array, ""]
    halvings: Int[Array, ""]
    errors: StepErrors
    taken: Scalar
    rejected: Scalar
    result: RESULTS

    @property
    def time(self) -> Scalar:
        return self.origin + self.ticks * self.tick


class Node(NamedTuple):
    """The values and rates at an end of a step that dense output needs."""

    q: Coordinates
    v: Coordinates
    vdot: Coordinates
    work: Power
    power: Power

    @classmethod
    def of(cls, state: StepState) -> "Node":
        """The part of a state that is recorded."""
        return cls(state.q, state.v, state.vdot, state.work, state.power)


class IterationInfo(NamedTuple):
    """The convergence of a step's iterations.

    iterations: their number; increment: the last increment of tether nodes and of the hub [m]; left: the
    expected remaining error of both [m], which `tolerance` [m] limits; rate: the ratio of the last two
    increments, of this step or of an earlier one with the same factors; constraint, residual: largest
    constraint violation [m] and largest unbalanced force of a node beyond the root [N], before the last
    correction and without scaling; tether: the number of the tether with the largest increment.
    """

    iterations: Int[jax.Array, ""]
    increment: Float[jax.Array, "2"]
    left: Float[jax.Array, "2"]
    rate: Scalar
    tolerance: Float[jax.Array, "2"]
    constraint: Scalar
    residual: Scalar
    tether: Int[jax.Array, ""]

    def converged(self) -> jax.Array:
        """Tells whether the remaining error is within tolerance; false for NaN."""
        return (self.left <= self.tolerance).all()


class FixedStepSteps(AbstractSteps):
    """The record of the steps of a block.

    start: the start of the first step; ends, end, size: the end of each step, its time and its length [s];
    tried, taken: as in `Log`; errors: the estimated errors at the end of the block, relative to the ranges
    of the signals."""

    start: Node
    ends: Node
    end: Float[Array, "*block attempt"]
    size: Float[Array, "*block attempt"]
    tried: Bool[Array, "*block attempt"]
    taken: Bool[Array, "*block attempt"]
    info: IterationInfo
    errors: Float[Array, "*block 2"]

    @property
    def log(self) -> Log:
        info, shape = self.info, self.end.shape
        tip, force = (jnp.broadcast_to(self.errors[i], shape) for i in (0, 1))
        statistics = {
            "iterations_per_step": info.iterations.astype(float),
            "last_increment": info.increment.max(-1),
            "constraint_violation": info.constraint,
            "residual": info.residual,
            "tether": info.tether.astype(float),
            "tip_error": tip,
            "root_force_error": force,
        }
        return Log(self.tried, self.taken, self.end, self.size, statistics)

    def find(self, time: Scalar) -> tuple[Int[Array, ""], ...]:
        reaches = self.taken & (time <= self.end + SNAP * self.size)
        return jnp.unravel_index(jnp.argmax(reaches), reaches.shape)

    def pick(self, index: tuple[Int[Array, ""], ...]) -> "Interval":
        *block, k = index
        block = tuple(block)
        before = jax.tree.map(
            lambda x0, x: jnp.where(k == 0, x0[block], x[(*block, jnp.maximum(k - 1, 0))]),
            self.start,
            self.ends,
        )
        after = jax.tree.map(lambda x: x[index], self.ends)
        return Interval(before, after, self.end[index], self.size[index])


class Interval(NamedTuple):
    """One step: its start and its end, the time at the end, and its length [s]."""

    before: Node
    after: Node
    end: Scalar
    size: Scalar


class Tape(NamedTuple):
    """Number of steps taken in a block, and whether an attempt failed after them."""

    count: Int[Array, ""]
    failed: Bool[Array, ""]


class FrozenFactors(NamedTuple):
    """An iteration matrix, its factors, and the attitude at which it was assembled."""

    matrix: bordered.Bordered
    factors: bordered.Factors
    rotation: Rotation

    def solve(
        self, system: System, turned: Rotation, forces: Coordinates, constraints: Multipliers
    ) -> tuple[Coordinates, Multipliers]:
        """Returns (dq, s dlam) for a right-hand side in inertial axes. turned: the rotation from the
        attitude of the factors to the present one."""
        rhs = iteration_matrix.to_vector(system, forces.rotate(turned.T), constraints)
        dq, dlam = iteration_matrix.from_vector(system, bordered.solve(self.matrix, self.factors, rhs))
        return dq.rotate(turned), dlam


class Unknowns(NamedTuple):
    """The unknowns of a step."""

    vdot: Coordinates
    lam: Multipliers


class FixedStep(AbstractStepper):
    """A method with given step size [s] that finds vdot and lam of a step by simplified Newton
    iterations."""

    step_size: Scalar

    order: ClassVar[int] = 2
    steps_per_block: ClassVar[int] = STEPS_PER_FACTORISATION
    statistics: ClassVar[Mapping[str, Statistic]] = {
        "iterations_per_step": Statistic("-", "mean"),
        "last_increment": Statistic("m", "largest"),
        "constraint_violation": Statistic("m", "largest"),
        "residual": Statistic("N", "largest"),
        "tip_error": Statistic("-", "last"),
        "root_force_error": Statistic("-", "last"),
    }
    most_iterations: ClassVar[int] = MAX_ITERATIONS
    trusted: ClassVar[float] = 1.0
    """Largest last increment, relative to the tolerance, of an accepted step. The expected remaining error
    must be within tolerance in addition. With a value above 1 the power of a step, which is computed before
    the last correction, has an error of this size."""

    # ---- a method --------------------------------------------------------------------------------

    @property
    @abstractmethod
    def phase_error(self) -> Scalar:
        """The coefficient c of the phase error: an oscillation at omega loses the phase c (h omega)^3 per
        step."""

    @abstractmethod
    def factor(
        self, system: System, time: Scalar, q: Coordinates, v: Coordinates, lam: Multipliers
    ) -> FrozenFactors:
        """Returns the factors of the iteration matrix at a state."""

    @abstractmethod
    def attitude(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, vdot: Coordinates
    ) -> Rotation:
        """Returns the attitude to which the factors are rotated for a step."""

    @abstractmethod
    def residual(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, unknowns: Unknowns
    ) -> tuple[Any, Power]:
        """Returns the residual of the equations of a step (`system.Residual`) and the power of its
        forces."""

    @abstractmethod
    def correct(
        self, system: System, residual: Any, factors: FrozenFactors, turned: Rotation
    ) -> tuple[Unknowns, Coordinates]:
        """Returns the change of the unknowns in an iteration, and the corresponding change of q."""

    @abstractmethod
    def tangent(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, unknowns: Unknowns
    ) -> FrozenFactors:
        """Returns the factors of the exact derivative of the residual, for derivatives of the run."""

    @abstractmethod
    def tolerances(self, system: System, q: Coordinates) -> Float[Array, "2"]:
        """Returns the largest remaining errors [m] of a converged step, of tether nodes and of the hub."""

    @abstractmethod
    def step(
        self, system: System, time: Scalar, state: StepState, factors: FrozenFactors, rate: Scalar
    ) -> tuple[StepState, IterationInfo]:
        """Takes one step from `time` [s]. rate: the convergence rate of the iterations in an earlier step
        with these factors, infinite if there is none."""

    def transposable(self, system: System) -> System:
        """Returns the system that reverse mode differentiates with respect to the state."""
        return system

    def first_state(self, system: System, time: Scalar, state: StepState) -> StepState:
        """Returns the start with better first guesses, for a method that has them."""
        return state

    def rescaled(self, state: StepState, ratio: Scalar) -> StepState:
        """Returns the state for steps that are `ratio` times as long."""
        first = jax.tree.map(lambda x: ratio * x, state.vdot_difference)
        second = jax.tree.map(lambda x: ratio**2 * x, state.vdot_second_difference)
        return state._replace(vdot_difference=first, vdot_second_difference=second)

    # ---- the interface of a stepper ----------------------------------------------------------------

    def init(self, model: System, start: Point, until: Scalar) -> tuple[FixedStepState, FixedStepSteps]:
        """Returns the start with consistent accelerations. `until` is not used: the step size is given."""
        time, q, v, work, _ = start
        vdot, lam, _, power = consistent_motion(model, time, q, v)
        nothing = jax.tree.map(jnp.zeros_like, vdot)
        now = StepState(q, v, vdot, vdot, lam, nothing, nothing, work, power)
        now = self.first_state(model, time, now)
        zero, none = jnp.zeros(()), jnp.zeros((), int)
        errors = no_errors(model.tethers.count)
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
            errors.parts,
        )
        return state, steps

    def block(self, model: System, state: FixedStepState) -> tuple[FixedStepState, FixedStepSteps]:
        """Takes up to STEPS_PER_FACTORISATION steps with one factorisation. After a failed step the steps
        before it are repeated: failures are rare, and the loop then needs no selection after good steps."""
        one_step, wanted = self.stepping(model, state)

        def attempts(carry, records, _):
            limit, _, failure = carry
            begun = (state.now, jnp.asarray(jnp.inf), jnp.zeros((), int))
            (now, *_), (ends, info, good) = bounded_loop(
                one_step, begun, limit, nothing, STEPS_PER_FACTORISATION
            )
            count = jnp.minimum(good.sum(), limit)
            at = jnp.minimum(count, STEPS_PER_FACTORISATION - 1)
            failed_info = jax.tree.map(lambda x: x[at], info)
            failure = select(count < limit, failed_info, failure)
            return (count, limit, failure), (now, ends, info)

        nothing = (Node.of(state.now), no_info(), jnp.asarray(False))
        room = jax.tree.map(
            lambda x: jnp.broadcast_to(x, (STEPS_PER_FACTORISATION, *jnp.shape(x))), nothing
        )
        carry = (wanted, wanted + 1, no_info())
        (count, _, failure), (now, ends, info) = while_active(
            lambda carry: carry[0] < carry[1], attempts, carry, (state.now, *room[:2])
        )
        return self.finished(model, state, now, ends, info, Tape(count, count < wanted), failure)

    def stepping(self, model: System, state: FixedStepState) -> tuple[Callable, Int[Array, ""]]:
        """Returns the function of one step with the factors of this block, and the number of steps to take.
        With a halved step a block ends at the end of a whole step, where the step may be doubled."""
        now, ticks = state.now, TICKS >> state.halvings
        fine = replace(self, step_size=self.step_size * (ticks / TICKS))
        factors = fine.factor(model, state.time, now.q, now.v, now.lam)

        def one_step(carry):
            now, rate, index = carry
            time = state.origin + (state.ticks + index * ticks) * state.tick
            now, info = fine.step(model, time, now, factors, rate)
            good = info.converged()
            return (now, lax.stop_gradient(info.rate), index + 1), good, (Node.of(now), info, good)

        whole = (TICKS - state.ticks % TICKS) // ticks
        wanted = jnp.where(
            state.halvings > 0, jnp.minimum(whole, STEPS_PER_FACTORISATION), STEPS_PER_FACTORISATION
        )
        return one_step, wanted

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
        """Returns the state and the record after a block, and chooses the size of the next steps."""
        size = TICKS >> state.halvings
        index = jnp.arange(STEPS_PER_FACTORISATION)
        taken = index < tape.count
        end = state.origin + (state.ticks + (index + 1) * size) * state.tick
        ticks = state.ticks + tape.count * size
        length = size * state.tick
        errors = after_block(
            state.errors, model, state.time, length, state.now.q, ends.q, tape.count, self.phase_error
        )
        # The failed attempt is recorded after the steps that were taken.
        failed = tape.failed & (index == tape.count)
        tried = taken | failed
        info = jax.tree.map(
            lambda x, y: jnp.where(failed.reshape(-1, *(1,) * (x.ndim - 1)), y, x), info, failure
        )
        sizes = jnp.where(tried, length, 0.0)
        steps = FixedStepSteps(Node.of(state.now), ends, end, sizes, tried, taken, info, errors.parts)

        no_progress = tape.failed & (tape.count == 0)
        exhausted = no_progress & (state.halvings == MAX_HALVINGS)
        recovered = ~tape.failed & (state.halvings > 0) & (ticks % TICKS == 0)
        halvings = state.halvings + jnp.where(no_progress & ~exhausted, 1, 0) - jnp.where(recovered, 1, 0)
        ratio = 2.0 ** (state.halvings - halvings)
        now = select(halvings == state.halvings, now, self.rescaled(now, ratio))
        finite = jnp.isfinite(failure.increment).all()
        cause = RESULTS.where(finite, RESULTS.newton_diverged, RESULTS.nonfinite)
        state = replace(
            state,
            now=now,
            ticks=ticks,
            halvings=halvings,
            errors=errors,
            taken=state.taken + tape.count,
            rejected=state.rejected + tape.failed,
            result=RESULTS.where(exhausted, cause, state.result),
        )
        return state, steps

    def evaluate(self, model: System, step: Interval, time: Scalar) -> Point:
        """Evaluates cubic Hermite polynomials of q, v and the work, through values and rates at both ends.

        v is not the derivative of the cubic of q: the method's v and dq/dt differ by a constant times
        h^2 d^2v/dt^2 (0.17 at spectral radius 0.25), which would appear at saved instants only."""
        before, after, end, h = step
        theta = 1.0 + (time - end) / h
        t2, t3 = theta**2, theta**3
        h00, h10, h01, h11 = 2 * t3 - 3 * t2 + 1, t3 - 2 * t2 + theta, 3 * t2 - 2 * t3, t3 - t2

        def cubic(x0, r0, x1, r1):
            return h00 * x0 + h01 * x1 + h * (h10 * r0 + h11 * r1)

        q = jax.tree.map(cubic, before.q, before.v, after.q, after.v)
        v = jax.tree.map(cubic, before.v, before.vdot, after.v, after.vdot)
        work = jax.tree.map(cubic, before.work, before.power, after.work, after.power)
        between = (q, v, work)
        at_start, at_end = theta < SNAP, theta > 1.0 - SNAP
        nearest = select(at_start, (before.q, before.v, before.work), (after.q, after.v, after.work))
        exact = at_start | at_end
        return Point(time, *select(exact, nearest, between), exact)

    def failure(self, model: System, state: FixedStepState, log: Log) -> str:
        tried = np.asarray(log.tried)
        last = {name: np.asarray(x)[tried][-1] for name, x in log.statistics.items()}
        step, time = np.asarray(log.size)[tried][-1], np.asarray(log.end)[tried][-1]
        return (
            f"At t = {time:.6g} s with steps of {step:.3g} s, tether {int(last['tether'])}: last increment "
            f"{last['last_increment']:.3g} m after {int(last['iterations_per_step'])} iterations, "
            f"constraint violation {last['constraint_violation']:.3g} m. Smaller steps did not help."
        )

    def error_estimates(self, state: FixedStepState) -> dict[str, Scalar]:
        tip, force = state.errors.parts
        return {"tip_error": tip, "root_force_error": force}

    # ---- derivatives -------------------------------------------------------------------------------

    def tape(self, steps: FixedStepSteps) -> Tape:
        """Returns the number of steps, which `replay` computes again."""
        return Tape(steps.taken.sum(), (steps.tried & ~steps.taken).any())

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
            one_step, _ = self.stepping(model, state)

            def step(carry, index):
                def go(carry):
                    carry, _, (node, info, _) = one_step(carry)
                    return carry, (node, info)

                def stay(carry):
                    return carry, (Node.of(carry[0]), no_info())

                return lax.cond(index < tape.count, go, stay, carry)

            carry = (state.now, jnp.asarray(jnp.inf), jnp.zeros((), int))
            (now, *_), (ends, info) = lax.scan(step, carry, jnp.arange(STEPS_PER_FACTORISATION))
            return self.finished(model, state, now, ends, info, tape, no_info())

        return replay_blocks(self, model, motion, block, tapes, blocks, times)


def no_info() -> IterationInfo:
    """Returns the record of a step that was not tried."""
    zero, none, two = jnp.zeros(()), jnp.zeros((), int), jnp.zeros(2)
    return IterationInfo(none, two, two, zero, two, zero, zero, none)
