"""Explicit Runge-Kutta methods with control of the local error, for y' = f(t, y).

    k_j = f(t + c_j h, y + h sum_l a_jl k_l),    y_new = y + h sum_j b_j k_j,    error = h sum_j e_j k_j

The coefficients and the step controller are diffrax's. The stages are written out here because its own
loop over them, made for any y and any term, takes three times as long on a chain of twenty rods.

A saved instant never forces a step: the last step passes it, and one more step from where that one
began, shorter and off the record, ends on it. The run's steps are the same whatever is saved.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.ad_checkpoint import checkpoint_name

from esail_jax.array_types import Array, Float, Scalar

METHODS = {"tsit5": diffrax.Tsit5(), "dopri5": diffrax.Dopri5(), "dopri8": diffrax.Dopri8()}
"""Tsitouras 5(4), Dormand & Prince 5(4) (MATLAB's ode45), Prince & Dormand 8(7). All end a step with
the first stage of the next."""

REACH = {"tsit5": 0.95, "dopri5": 1.0, "dopri8": 3.7}
"""h omega up to which an undamped vibration grows by less than 1e-4 a step. Damped ones, on the real
axis, are stable up to 3.3 and more."""

STEPS_PER_CHUNK = 64
"""Steps between the states that a reverse derivative keeps."""

STEP_SIZES = "step sizes"
"""Name of what `jax.checkpoint` around `advance` must keep: chosen once more they may differ by what
rounding decides, and a derivative would go back through steps that end elsewhere."""

MAX_STEPS = 2**14
"""Steps between two saved instants, at most, in a run under a trace."""

State = Any
RightHandSide = Callable[[Scalar, State], State]


class Point(NamedTuple):
    """An instant, the state there, and its derivative (the first stage of the next step)."""

    time: Scalar
    y: State
    slope: State


class Progress(NamedTuple):
    """What a run hands on. before, now: the ends of the last step; h: the step to try next;
    control: the step controller's memory; taken, rejected: steps so far."""

    before: Point
    now: Point
    h: Scalar
    control: Any
    taken: Scalar
    rejected: Scalar


class RungeKutta(eqx.Module):
    """method: of METHODS. step_size [s]: of every step, or None; then tolerance is the largest local
    error of any component of a step, relative to the sum of the component and its `scale`."""

    step_size: Scalar | None
    tolerance: Scalar | None
    scale: State | None
    method: str = eqx.field(static=True)

    @property
    def order(self) -> int:
        return METHODS[self.method].order(None)

    @property
    def controller(self) -> diffrax.PIDController:
        """Step size by the error of the last step, measured in the largest component."""
        return diffrax.PIDController(rtol=self.tolerance, atol=self.tolerance, norm=largest_component)

    def scaled(self, y: State) -> State:
        """In units of the scale."""
        return jax.tree.map(lambda a, unit: a / unit, y, self.scale)

    def point(self, f: RightHandSide, time: Scalar, y: State) -> Point:
        return Point(time, y, f(time, y))

    def step(self, f: RightHandSide, start: Point, h: Scalar) -> tuple[Point, State]:
        """The end of a step and the estimate of its error."""
        table = METHODS[self.method].tableau
        stages = [start.slope]
        y = start.y
        for c, row in zip(table.c, table.a_lower, strict=True):
            y = jax.tree.map(lambda y0, *k, row=row: y0 + h * combined(row, k), start.y, *stages)
            stages.append(f(start.time + float(c) * h, y))
        error = jax.tree.map(lambda *k: h * combined(table.b_error, k), *stages)
        return Point(start.time + h, y, stages[-1]), error  # the last row of a is b

    def start(self, f: RightHandSide, time: Scalar, y: State) -> Progress:
        """Where a run begins, with a first step size after Hairer, Norsett & Wanner (II.4)."""
        here, none = self.point(f, time, y), jnp.zeros(())
        h, control = self.step_size, None
        if h is None:

            def rate(_, t, y, __):
                return self.scaled(f(t, jax.tree.map(lambda a, unit: a * unit, y, self.scale)))

            end, control = self.controller.init(
                None, time, time + 1.0, self.scaled(y), None, None, rate, float(self.order)
            )
            h = end - time
        return Progress(here, here, h, control, none, none)

    def attempt(self, f: RightHandSide, state: Progress) -> Progress:
        """One step, kept or not."""
        here, h = state.now, state.h
        new, error = self.step(f, here, h)
        if self.step_size is not None:
            taken = state.taken + 1.0
            new = new._replace(time=taken * h)  # not a sum of rounded steps
            return state._replace(before=here, now=new, taken=taken)
        keep, _, after, _, control, _ = self.controller.adapt_step_size(
            here.time, here.time + h, self.scaled(here.y), self.scaled(new.y), None,
            self.scaled(error), float(self.order), state.control,
        )  # fmt: skip
        h = after - jnp.where(keep, here.time + h, here.time)

        def either(a, b):
            return jax.tree.map(lambda x, y: jnp.where(keep, x, y), a, b)

        kept = jnp.where(keep, 1.0, 0.0)
        before, now = either(here, state.before), either(new, here)
        return Progress(before, now, h, control, state.taken + kept, state.rejected + 1.0 - kept)

    def stuck(self, state: Progress) -> Array:
        """Has the state become infinite, or the step too small to change the time?"""
        finite = jnp.stack([jnp.isfinite(x).all() for x in jax.tree.leaves(state.now.y)]).all()
        return ~finite | ~(state.now.time + 0.25 * state.h > state.now.time)

    def pass_by(self, f: RightHandSide, state: Progress, target: Scalar, limit: Scalar) -> Progress:
        """Steps until `target` is passed, or `limit` steps are taken, or the run is stuck."""

        def going(state):
            return (state.now.time < target) & (state.taken < limit) & ~self.stuck(state)

        return lax.while_loop(going, lambda state: self.attempt(f, state), state)

    def look(self, f: RightHandSide, state: Progress, target: Scalar) -> State:
        """y at a `target` within the last step."""
        part = target - state.before.time
        return self.step(f, state.before, part)[0].y


def combined(weights: Any, stages: Any) -> Array:
    """Weighted sum of the stages; zero weights cost nothing."""
    return sum(float(w) * k for w, k in zip(weights, stages, strict=False) if w != 0.0)


def largest_component(error: State) -> Scalar:
    """Maximum norm over everything; infinite where a trial step ran into infinity or nowhere, so
    that the controller takes a smaller one."""
    largest = jnp.stack([jnp.abs(x).max() for x in jax.tree.leaves(error)]).max()
    return jnp.where(jnp.isnan(largest), jnp.inf, largest)


# ---- derivatives ------------------------------------------------------------------------------------


@jax.custom_jvp
def advance(
    method: RungeKutta, f: RightHandSide, state: Progress, target: Scalar
) -> tuple[Progress, State]:
    """Past `target`, and y there; at most MAX_STEPS steps.

    The derivative is that of the steps as they were taken: their sizes carry none. It is written as
    a replay of a fixed number of steps, in chunks of which reverse mode keeps only the ends, so that
    forward and reverse mode exist; a run that is not differentiated never executes it. Chunks beyond the
    last step are skipped, but not under `vmap` of a derivative, where all MAX_STEPS are computed:
    map such derivatives with `lax.map`.
    """
    state = method.pass_by(f, state, target, state.taken + MAX_STEPS)
    return state, method.look(f, state, target)


@advance.defjvp
def _advance_jvp(primals, tangents):
    reached, sizes = lax.stop_gradient(accepted_steps(*lax.stop_gradient(primals)))
    sizes = checkpoint_name(sizes, STEP_SIZES)
    points, moved = jax.jvp(lambda *x: replay(*x, sizes), primals, tangents)
    none = jax.tree.map(zero_tangent, reached)
    return (
        (reached, points[2]),
        (none._replace(before=moved[0], now=moved[1]), moved[2]),
    )


def zero_tangent(x: Array) -> Any:
    """The tangent of what does not move."""
    inexact = jnp.issubdtype(x.dtype, jnp.inexact)
    return jnp.zeros_like(x) if inexact else np.zeros(x.shape, jax.dtypes.float0)


def accepted_steps(
    method: RungeKutta, f: RightHandSide, state: Progress, target: Scalar
) -> tuple[Progress, Float[Array, " step"]]:
    """Where `advance` gets to, and the sizes [s] of its steps, then zeros."""
    first = state.taken

    def going(carry):
        state, _ = carry
        within = state.taken < first + MAX_STEPS
        return (state.now.time < target) & within & ~method.stuck(state)

    def body(carry):
        state, sizes = carry
        new = method.attempt(f, state)
        index = (state.taken - first).astype(int)
        return new, sizes.at[index].set(jnp.where(new.taken > state.taken, state.h, 0.0))

    return lax.while_loop(going, body, (state, jnp.zeros(MAX_STEPS)))


def replay(
    method: RungeKutta, f: RightHandSide, state: Progress, target: Scalar, sizes: Float[Array, " step"]
) -> tuple[Point, Point, State]:
    """Steps of given sizes: the ends of the last one, and y at `target` within it."""

    def one(carry, h):
        def go(carry):
            _, now = carry
            return now, method.step(f, now, h)[0]

        return lax.cond(h > 0.0, go, lambda carry: carry, carry), None

    @jax.checkpoint
    def some(carry, sizes):
        return lax.scan(one, carry, sizes)

    def chunk(carry, sizes):
        return lax.cond(sizes[0] > 0.0, some, lambda carry, _: (carry, None), carry, sizes)

    (before, now), _ = lax.scan(chunk, (state.before, state.now), sizes.reshape(-1, STEPS_PER_CHUNK))
    return before, now, method.look(f, state._replace(before=before), target)
