"""The state of collocation between two blocks, and the record of a step, from which dense output
follows."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from esail_jax.array_types import Array, Bool, Float, Int, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.steppers.collocation_stages import STAGES, TABLE, StageUnknowns, StepEnd, stage_states
from esail_jax.steppers.kinks import Nodes
from esail_jax.steppers.log import Log
from esail_jax.steppers.results import RESULTS
from esail_jax.steppers.stepper import AbstractState, AbstractSteps
from esail_jax.system import Power


class History(NamedTuple):
    """The accelerations and multipliers at the start and the stages of the last step, in the axes of the
    hub, from which the first guess of the next step is extrapolated; h [s]: the length of that step,
    infinite before the first one."""

    values: StageUnknowns
    h: Scalar


class CollocationState(AbstractState):
    """The state after a block.

    now: the end of the last step; h: the step size to try next [s]; origin: time of the call of `init` [s],
    from which steps of a given size are counted."""

    now: StepEnd
    history: History
    h: Scalar
    taken: Scalar
    rejected: Scalar
    origin: Scalar
    result: RESULTS

    @property
    def time(self) -> Scalar:
        return self.now.time


class IterationInfo(NamedTuple):
    """The convergence of a step. iterations: their number; increment: the remaining error over the allowed
    one; error: the estimated local error over the tolerance."""

    iterations: Int[Array, "*attempt"]
    increment: Float[Array, "*attempt"]
    error: Float[Array, "*attempt"]


class CollocationSteps(AbstractSteps):
    """The record of one step, or of several along leading axes: its start, its length h [s], the time at
    its end [s], accelerations and multipliers at its stages, and the powers there. taken: false for a
    rejected step and for an unused place (h = 0).

    The end is that of the state after the step. The start plus h may differ from it in the last digit, and
    an instant at the end would then lie in no step."""

    start: StepEnd
    h: Float[Array, "*attempt"]
    end: Float[Array, "*attempt"]
    stages: StageUnknowns
    power: Power
    info: IterationInfo
    taken: Bool[Array, "*attempt"]

    @property
    def log(self) -> Log:
        iterations = self.info.iterations.astype(float)
        return Log(self.h > 0.0, self.taken, self.end, self.h, {"iterations_per_step": iterations})

    def pick(self, index: tuple[Int[Array, ""], ...]) -> "CollocationSteps":
        return jax.tree.map(lambda x: x[index], self)

    def at(self, time: Scalar) -> StepEnd:
        """The motion at a time [s] within one step, from the polynomials of accelerations and
        powers."""
        start, h, x = self.start, self.h, (time - self.start.time) / self.h
        # One by one: an array of exponents has an infinite third derivative at x = 0.
        powers = jnp.stack([x**n for n in range(STAGES + 1)])
        none, once, twice = (x**n * (powers @ TABLE.integrals(n)) for n in (0, 1, 2))

        def sum_of(weights, first, stages):
            return weights[0] * first + jnp.tensordot(weights[1:], stages, 1)

        vdot = start.vdot, self.stages.vdot
        q = jax.tree.map(lambda q, v, *a: q + h * x * v + h**2 * sum_of(twice, *a), start.q, start.v, *vdot)
        v = jax.tree.map(lambda v, *a: v + h * sum_of(once, *a), start.v, *vdot)
        vdot = jax.tree.map(lambda *a: sum_of(none, *a), *vdot)
        power = start.power, self.power
        work = jax.tree.map(lambda w, *p: w + h * sum_of(once, *p), start.work, *power)
        return StepEnd(time, q, v, vdot, work, jax.tree.map(lambda *p: sum_of(none, *p), *power))


def nodes_of_step(start: StepEnd, h: Scalar, vdot: Coordinates) -> Nodes:
    """The motion at the start and at the stages of a step. vdot: accelerations at the stages."""
    first, stages = (start.time, start.q, start.v), stage_states(start, h, vdot)
    return Nodes(*jax.tree.map(lambda a, x: jnp.concatenate([a[None], x]), first, stages))


def no_step(state: CollocationState) -> CollocationSteps:
    """zeros, the record of an unused place."""
    zero, powers = jnp.zeros(()), jnp.zeros(STAGES)
    stages = jax.tree.map(lambda x: jnp.zeros_like(x[1:]), state.history.values)
    start = jax.tree.map(jnp.zeros_like, state.now)
    info = IterationInfo(jnp.zeros((), int), zero, zero)
    return CollocationSteps(
        start, zero, zero, stages, jax.tree.map(lambda _: powers, state.now.power), info, jnp.asarray(False)
    )


def zero_length_steps(state: CollocationState, count: int) -> CollocationSteps:
    """`count` records of length zero, in which dense output finds the start of a motion."""
    step = no_step(state)
    # The polynomial is divided by the length of the step, which must not be zero.
    step = eqx.tree_at(
        lambda s: (s.start, s.h, s.end, s.taken),
        step,
        (state.now, jnp.asarray(TINY), state.now.time, jnp.asarray(True)),
    )
    return jax.tree.map(lambda x: jnp.broadcast_to(x, (count, *x.shape)), step)


TINY = 1e-30
"""Length of a step whose end equals its start to rounding [s]."""
