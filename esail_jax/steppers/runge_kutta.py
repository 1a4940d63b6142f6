"""Explicit Runge-Kutta methods with control of the local error, for y' = f(t, y).

    k_j = f(t + c_j h, y + h sum_l a_jl k_l),    y_new = y + h sum_j b_j k_j,    error = h sum_j e_j k_j

The coefficients and the step controller are diffrax's. The stages are written out here because diffrax's
own loop over them, made for any y and any term, takes three times as long on a chain of twenty rods.

Dense output at an instant within a step is one more step of the method from the start of that step,
shorter and not part of the run."""

import functools
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Bool, Float, Int, Maybe, Scalar
from esail_jax.numerics.lockstep import any_member, cond_of_members, select
from esail_jax.rod_chain import RodChain, RodState
from esail_jax.steppers.log import Log, Statistic
from esail_jax.steppers.results import RESULTS, name_of
from esail_jax.steppers.stepper import AbstractState, AbstractStepper, AbstractSteps, Motion, Point
from esail_jax.system import Power

METHODS = {"tsit5": "Tsit5", "dopri5": "Dopri5", "dopri8": "Dopri8"}
"""The names of diffrax's solvers: Tsitouras 5(4), Dormand & Prince 5(4) (MATLAB's ode45), Prince & Dormand
8(7). All of them end a step with the first stage of the next."""

REACH = {"tsit5": 0.95, "dopri5": 1.0, "dopri8": 3.7}
"""Largest product h omega for which an undamped vibration grows by less than 1e-4 per step. On the negative
real axis (damped motion) the limit of stability is 3.3 or more."""


@functools.cache
def solver(method: str) -> Any:
    """diffrax's solver of a method. diffrax takes as long to import as JAX, and is not needed for a
    sail; therefore it is imported here."""
    import diffrax

    return getattr(diffrax, METHODS[method])()


STEPS_PER_CHUNK = 64
"""Number of steps between two states that reverse mode stores."""

State = Any
RightHandSide = Callable[[Scalar, State], State]


class Knot(eqx.Module):
    """An end of a step: time [s], the state y, and its derivative, which is the first stage of the next
    step."""

    time: Float[Array, "*attempt"]
    y: State
    slope: State


class RungeKuttaState(AbstractState):
    """The state after a block. now: the end of the last step; h: the step size to try next [s]; control:
    the memory of the step-size controller; origin: the time [s] from which steps of a given size are
    counted."""

    now: Knot
    h: Scalar
    control: Any
    origin: Scalar
    taken: Scalar
    rejected: Scalar
    result: RESULTS

    @property
    def time(self) -> Scalar:
        return self.now.time


class RungeKuttaSteps(AbstractSteps):
    """A step, or several along leading axes: its start and its length [s]. taken: false for a rejected
    step, and where there was no step (h = 0)."""

    start: Knot
    h: Float[Array, "*attempt"]
    end: Float[Array, "*attempt"]
    taken: Bool[Array, "*attempt"]

    @property
    def log(self) -> Log:
        return Log(self.h > 0.0, self.taken, self.end, self.h, {})

    def pick(self, index: tuple[Int[Array, ""], ...]) -> "RungeKuttaSteps":
        return jax.tree.map(lambda x: x[index], self)


class RungeKutta(AbstractStepper):
    """An explicit Runge-Kutta method for a chain of rods.

    method: its name in METHODS; step_size: the length of every step [s], or None for error control;
    tolerance: largest local error of a component, relative to the sum of the component and its `scale`
    (`rod_chain.error_scale`)."""

    step_size: Scalar | None
    tolerance: Maybe[Scalar]
    scale: State | None
    method: str = eqx.field(static=True)

    relative_coordinates: ClassVar[bool] = True
    energy_guard: ClassVar[bool] = True
    steps_per_block: ClassVar[int] = 1
    blocks_per_batch: ClassVar[int] = 8
    blocks_per_window: ClassVar[int] = 2**11
    instants_per_window: ClassVar[int] = 1
    statistics: ClassVar[Mapping[str, Statistic]] = {}

    @property
    def name(self) -> str:
        return self.method

    @property
    def order(self) -> int:
        return solver(self.method).order(None)

    @property
    def controller(self) -> Any:
        """The step-size controller (`diffrax.PIDController`), which uses the largest component of the error
        of the last step."""
        import diffrax

        return diffrax.PIDController(rtol=self.tolerance, atol=self.tolerance, norm=largest_component)

    def scaled(self, y: State) -> State:
        """y divided by the scale."""
        return jax.tree.map(lambda a, unit: a / unit, y, self.scale)

    def step(self, f: RightHandSide, start: Knot, h: Scalar) -> tuple[Knot, State]:
        """The end of a step and the estimate of its local error. h [s]."""
        table = solver(self.method).tableau
        stages = [start.slope]
        y = start.y
        for c, row in zip(table.c, table.a_lower, strict=True):
            y = jax.tree.map(lambda y0, *k, row=row: y0 + h * combined(row, k), start.y, *stages)
            stages.append(f(start.time + float(c) * h, y))
        error = jax.tree.map(lambda *k: h * combined(table.b_error, k), *stages)
        return Knot(start.time + h, y, stages[-1]), error  # the last row of a is b

    def init(
        self, model: RodChain, start: RodState | Point, until: Scalar
    ) -> tuple[RungeKuttaState, RungeKuttaSteps]:
        """The start, with the first step size of Hairer, Norsett & Wanner (II.4)."""
        time = jnp.zeros(())
        if isinstance(start, Point):
            time, start = start.time, model.state(start.q, start.v, start.work)
        y = start
        now, none = Knot(time, y, model(time, y)), jnp.zeros(())
        h, control = self.step_size, None
        if h is None:

            def rate(_, t, y, __):
                return self.scaled(model(t, jax.tree.map(lambda a, unit: a * unit, y, self.scale)))

            end, control = self.controller.init(
                None, time, time + 1.0, self.scaled(y), None, None, rate, float(self.order)
            )
            h = jnp.minimum(end - time, until - time)
        state = RungeKuttaState(now, *lax.stop_gradient((h, control)), time, none, none, RESULTS.successful)
        return state, one_step(RungeKuttaSteps(now, none, time, jnp.asarray(True)))

    def attempt(self, f: RightHandSide, state: RungeKuttaState) -> tuple[RungeKuttaState, RungeKuttaSteps]:
        """Tries one step. Returns the state after it and its record."""
        here, h = state.now, state.h
        new, error = self.step(f, here, h)
        if self.step_size is not None:
            taken = state.taken + 1.0
            new = replace(new, time=state.origin + taken * h)  # not a sum of rounded steps
            step = RungeKuttaSteps(here, h, new.time, jnp.asarray(True))
            return replace(state, now=new, taken=taken), step
        keep, _, after, _, control, _ = self.controller.adapt_step_size(
            here.time, here.time + h, self.scaled(here.y), self.scaled(new.y), None,
            self.scaled(error), float(self.order), state.control,
        )  # fmt: skip
        step = RungeKuttaSteps(here, h, new.time, keep)
        h = after - jnp.where(keep, here.time + h, here.time)
        now = select(keep, new, here)
        one = jnp.where(keep, 1.0, 0.0)
        taken, rejected = state.taken + one, state.rejected + 1.0 - one
        state = replace(state, now=now, h=h, control=control, taken=taken, rejected=rejected)
        return state, step

    def block(self, model: RodChain, state: RungeKuttaState) -> tuple[RungeKuttaState, RungeKuttaSteps]:
        """One attempted step. A longer block would have to copy each step into its record."""
        state, step = self.attempt(model, state)
        return replace(state, result=self.outcome(state)), one_step(step)

    def outcome(self, state: RungeKuttaState) -> RESULTS:
        """Tells whether the method can go on: the state is finite, and the step changes the time."""
        finite = jnp.stack([jnp.isfinite(x).all() for x in jax.tree.leaves(state.now.y)]).all()
        moves = state.now.time + 0.25 * state.h > state.now.time
        failed = RESULTS.where(finite, RESULTS.min_step_reached, RESULTS.nonfinite)
        return RESULTS.where(finite & moves, RESULTS.successful, failed)

    def evaluate(self, model: RodChain, step: RungeKuttaSteps, time: Scalar) -> Point:
        """Takes a step of the method from the start of the recorded step to the instant."""
        y = self.step(model, step.start, time - step.start.time)[0].y
        q, v = model.coordinates(y)
        zero = jnp.zeros(())
        return Point(time, q, v, Power(zero, zero) if y.work is None else y.work, jnp.asarray(True))

    def failure(self, model: RodChain, state: RungeKuttaState, log: Log) -> str:
        text = f"At t = {float(state.time):.6g} s."
        if self.step_size is not None:
            return f"{text} {too_long(self.step_size)}"
        if name_of(state.result) == "min_step_reached":
            lengths = np.linalg.norm(np.asarray(model.rods(state.now.y.x)), axis=0)
            shortest = float((lengths / np.asarray(model.system.tethers.lengths)).min())
            return f"{text} The shortest rod has {shortest:.2g} of its length left."
        return text

    def energy_hint(self) -> str:
        return super().energy_hint() if self.step_size is None else too_long(self.step_size)

    # ---- derivatives ----------------------------------------------------------------------------

    def tape(self, steps: RungeKuttaSteps) -> Scalar:
        """The size of an accepted step [s], else 0. Chosen again it could differ by rounding, and a
        derivative would be that of other steps."""
        return jnp.where(steps.taken, steps.h, 0.0)[0]

    def replay(
        self,
        model: RodChain,
        motion: Motion,
        ended: Motion,
        tapes: Float[Array, " block"],
        blocks: Int[Array, ""],
        times: Float[Array, " instant"],
    ) -> tuple[Motion, Point]:
        """Takes steps of the recorded sizes. Only the last step is recorded: the window has one instant,
        which lies in that step. Chunks after the last step are skipped."""

        def one(carry, h):
            def go(carry):
                _, now = carry
                new = self.step(model, now, h)[0]
                return RungeKuttaSteps(now, h, new.time, jnp.asarray(True)), new

            return cond_of_members(h > 0.0, go, lambda carry: carry, carry), None

        @jax.checkpoint
        def some(carry, sizes):
            return lax.scan(one, carry, sizes)[0]

        def chunk(carry, sizes):
            going = any_member((sizes > 0.0).any())
            return lax.cond(going, some, lambda carry, _: carry, carry, sizes), None

        assert isinstance(motion.state, RungeKuttaState) and isinstance(ended.state, RungeKuttaState)
        batch = jnp.arange(len(tapes)) // self.blocks_per_batch
        sizes = jnp.where(batch < blocks, tapes, 0.0)
        sizes = sizes[jnp.argsort(sizes == 0.0, stable=True)]
        carry = (motion.last.pick((jnp.zeros((), int),)), motion.state.now)
        (last, now), _ = lax.scan(chunk, carry, sizes.reshape(-1, STEPS_PER_CHUNK))
        points = jax.vmap(lambda time: self.evaluate(model, last, time))(times)
        state = replace(lax.stop_gradient(ended.state), now=replace(now, time=ended.state.now.time))
        return motion._replace(state=state, last=one_step(last)), points


def one_step(step: RungeKuttaSteps) -> RungeKuttaSteps:
    """The record of a block of one step."""
    return jax.tree.map(lambda x: x[None], step)


def too_long(step: Scalar) -> str:
    """The advice for a fixed step with which a chain diverges."""
    return (
        f"Steps of {float(step):.3g} s may be too long for the fastest vibration of "
        "the rods: try shorter ones, a tolerance, or generalized-alpha."
    )


def combined(weights: Any, stages: Any) -> Array:
    """The weighted sum of the stages. Zero weights cost nothing."""
    return sum(float(w) * k for w, k in zip(weights, stages, strict=False) if w != 0.0)


def largest_component(error: State) -> Scalar:
    """The maximum norm over all components. It is infinite if a trial step is not finite, so that
    the controller chooses a smaller step."""
    largest = jnp.stack([jnp.abs(x).max() for x in jax.tree.leaves(error)]).max()
    return jnp.where(jnp.isnan(largest), jnp.inf, largest)
