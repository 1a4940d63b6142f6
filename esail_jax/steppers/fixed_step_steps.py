"""The steps of a method with fixed steps: their record, and dense output within one of them."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from esail_jax.array_types import Array, Bool, Float, Int, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.numerics.lockstep import select
from esail_jax.steppers.fixed_step_state import IterationInfo, StepState
from esail_jax.steppers.log import Log
from esail_jax.steppers.stepper import AbstractSteps, Point
from esail_jax.system import Power

SNAP = 1e-9
"""An instant that differs from the end of a step by less than this fraction of the step is that end:
multiples of decimal fractions are rounded in binary."""


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


class FixedStepSteps(AbstractSteps):
    """The record of the steps of a block.

    start: the start of the first step; ends, end, size: the end of each step, its time and its length [s];
    tried, taken: as in `Log`; trials: number of trial steps that converged; errors: the estimated errors at
    the end of the block, relative to the ranges of the signals."""

    start: Node
    ends: Node
    end: Float[Array, "*block attempt"]
    size: Float[Array, "*block attempt"]
    tried: Bool[Array, "*block attempt"]
    taken: Bool[Array, "*block attempt"]
    info: IterationInfo
    trials: Int[Array, "*block"]
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
        block, k = index[:-1], index[-1]
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

    def evaluate(self, time: Scalar) -> Point:
        """Evaluates cubic Hermite polynomials of q, v and the work, through values and rates at both ends.

        v is not the derivative of the cubic of q: the method's v and dq/dt differ by a constant times
        h^2 d^2v/dt^2 (0.17 at spectral radius 0.25), which would appear at saved instants only."""
        before, after, end, h = self
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


class Tape(NamedTuple):
    """Number of steps taken in a block, whether an attempt failed after them, and number of trial steps
    before them that converged."""

    taken: Int[Array, ""]
    failed: Bool[Array, ""]
    trials: Int[Array, ""]
