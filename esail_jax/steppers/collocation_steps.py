"""What collocation hands on from step to step, and keeps of each: output is read off its polynomials."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Bool, Float, Int, Scalar
from esail_jax.steppers.collocation_stages import STAGES, TABLE, Point, Unknowns
from esail_jax.system import Power


class History(NamedTuple):
    """The last step's start and stages in the axes of the hub, for the next one's first guess; h [s] of
    that step, infinite when there was none."""

    values: Unknowns
    h: Scalar


class Progress(NamedTuple):
    """What a block of steps hands on. h: the step to try next; taken, rejected: steps so far; origin [s]:
    what steps of a given length are counted from."""

    now: Point
    history: History
    h: Scalar
    taken: Scalar
    rejected: Scalar
    origin: Scalar


class StepInfo(NamedTuple):
    """How a step went. iterations; increment: what the last one left undone, over what is allowed; error:
    its estimate over the tolerance."""

    iterations: Int[Array, ""]
    increment: Scalar
    error: Scalar


class Record(NamedTuple):
    """A step as it was taken (`taken` False: there was none), and what its polynomials are made of."""

    start: Point
    h: Scalar
    stages: Unknowns
    power: Power
    info: StepInfo
    taken: Bool[Array, ""]

    @property
    def end(self) -> Float[Array | np.ndarray, "*step"]:
        """Time [s] at the end of the step, or of several."""
        return self.start.time + self.h

    def at(self, time: Scalar) -> Point:
        """Within the step, from the polynomials of the accelerations and of the powers."""
        start, h, x = self.start, self.h, (time - self.start.time) / self.h
        powers = x ** jnp.arange(STAGES + 1)
        none, once, twice = (x**n * (powers @ TABLE.integrals(n)) for n in (0, 1, 2))

        def sum_of(weights, first, stages):
            return weights[0] * first + jnp.tensordot(weights[1:], stages, 1)

        vdot = start.vdot, self.stages.vdot
        q = jax.tree.map(lambda q, v, *a: q + h * x * v + h**2 * sum_of(twice, *a), start.q, start.v, *vdot)
        v = jax.tree.map(lambda v, *a: v + h * sum_of(once, *a), start.v, *vdot)
        vdot = jax.tree.map(lambda *a: sum_of(none, *a), *vdot)
        power = start.power, self.power
        work = jax.tree.map(lambda w, *p: w + h * sum_of(once, *p), start.work, *power)
        return Point(time, q, v, vdot, work, jax.tree.map(lambda *p: sum_of(none, *p), *power))


def no_record(state: Progress) -> Record:
    """Of a step that was not taken: zeros."""
    zero, powers = jnp.zeros(()), jnp.zeros(STAGES)
    stages = jax.tree.map(lambda x: jnp.zeros_like(x[1:]), state.history.values)
    start = jax.tree.map(jnp.zeros_like, state.now)
    info = StepInfo(jnp.zeros((), int), zero, zero)
    return Record(start, zero, stages, Power(powers, powers), info, jnp.asarray(False))
