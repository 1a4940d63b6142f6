"""A stepper from outside the package: the classical Runge-Kutta method of order 4 with a fixed step.

    k_1 = f(t, y),                  k_2 = f(t + h/2, y + h/2 k_1),
    k_3 = f(t + h/2, y + h/2 k_2),  k_4 = f(t + h, y + h k_3),
    y(t + h) = y + h/6 (k_1 + 2 k_2 + 2 k_3 + k_4),      y = (q, v, work)

It shows how little a new method needs: a state, a record of its steps, and the four abstract functions of
`AbstractStepper`. Tape and replay are the default ones."""

from dataclasses import replace
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Bool, Float, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.steppers.consistent import consistent_motion, project
from esail_jax.steppers.log import Log
from esail_jax.steppers.results import RESULTS
from esail_jax.steppers.stepper import AbstractState, AbstractStepper, AbstractSteps, Point
from esail_jax.system import Power, System

STEPS = 8
"""Number of steps in a block."""


class Motion(NamedTuple):
    """The unknowns y of the differential equation: positions, velocities, and work."""

    q: Coordinates
    v: Coordinates
    work: Power


class RungeKutta4State(AbstractState):
    """The state after a block. origin: the time [s] from which steps are counted."""

    now: Motion
    origin: Scalar
    h: Scalar
    taken: Scalar
    rejected: Scalar
    result: RESULTS

    @property
    def time(self) -> Scalar:
        return self.origin + self.taken * self.h


class RungeKutta4Steps(AbstractSteps):
    """A step, or several along leading axes: its start, and the times at its start and its end [s]."""

    start: Motion
    begin: Float[Array, "*attempt"]
    end: Float[Array, "*attempt"]
    taken: Bool[Array, "*attempt"]

    @property
    def log(self) -> Log:
        return Log(self.taken, self.taken, self.end, self.end - self.begin, {})

    def pick(self, index: tuple[Array, ...]) -> "RungeKutta4Steps":
        return jax.tree.map(lambda x: x[index], self)


class RungeKutta4(AbstractStepper):
    """The method. step_size [s]: the length of every step."""

    step_size: Scalar

    name: ClassVar[str] = "runge-kutta-4"
    order: ClassVar[int] = 4
    steps_per_block: ClassVar[int] = STEPS

    def init(self, model: System, start: Point, until: Scalar) -> tuple[RungeKutta4State, RungeKutta4Steps]:
        zero, now = jnp.zeros(()), Motion(start.q, start.v, start.work)
        h = jnp.asarray(self.step_size)
        state = RungeKutta4State(now, start.time, h, zero, zero, RESULTS.successful)
        step = RungeKutta4Steps(now, start.time, start.time, jnp.asarray(True))
        return state, jax.tree.map(lambda x: jnp.broadcast_to(x, (STEPS, *jnp.shape(x))), step)

    def block(self, model: System, state: RungeKutta4State) -> tuple[RungeKutta4State, RungeKutta4Steps]:
        def step(state, _):
            later = replace(state, taken=state.taken + 1.0)
            record = RungeKutta4Steps(state.now, state.time, later.time, jnp.asarray(True))
            return replace(later, now=self.step(model, state.time, state.now, state.h)), record

        state, steps = lax.scan(step, state, length=STEPS)
        finite = jnp.stack([jnp.isfinite(x).all() for x in jax.tree.leaves(state.now)]).all()
        return replace(state, result=RESULTS.where(finite, state.result, RESULTS.nonfinite)), steps

    def evaluate(self, model: System, step: RungeKutta4Steps, time: Scalar) -> Point:
        """One step from the start of the recorded one to the instant."""
        q, v, work = self.step(model, step.begin, step.start, time - step.begin)
        return Point(time, q, v, work, jnp.asarray(True))

    def failure(self, model: System, state: RungeKutta4State, log: Log) -> str:
        return f"At t = {float(state.time):.6g} s."

    def step(self, model: System, time: Scalar, start: Motion, h: Scalar) -> Motion:
        """The end of a step, on the constraints."""

        def stage(c, slope):
            return rate(model, time + c * h, jax.tree.map(lambda y, k: y + c * h * k, start, slope))

        first = rate(model, time, start)
        second = stage(0.5, first)
        third = stage(0.5, second)
        slopes = first, second, third, stage(1.0, third)
        q, v, work = jax.tree.map(
            lambda y, a, b, c, d: y + h / 6.0 * (a + 2.0 * b + 2.0 * c + d), start, *slopes
        )
        return Motion(*project(model, time + h, q, v), work)


def rate(model: System, time: Scalar, y: Motion) -> Motion:
    """dy/dt = (v, accelerations, powers)."""
    q, v = project(model, time, y.q, y.v)
    found = consistent_motion(model, time, q, v)
    return Motion(v, found.vdot, found.power)
