"""The solution of the stages of a collocation step by simplified Newton iterations, and its derivative.

The factors are those of `collocation_stages.py`. The derivative follows from the implicit function theorem,
with the same factors and the exact derivative of the equations. It belongs to a solution that is known
already, so that no nonlinear equation is solved for it.
"""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Float, Int, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.numerics.own_derivative import custom_jvp
from esail_jax.numerics.symbolic_zeros import jvp_of_perturbed
from esail_jax.numerics.vectors import greatest
from esail_jax.steppers.collocation_stages import (
    TABLE,
    FrozenFactors,
    StageUnknowns,
    StepEnd,
    combined,
    correction,
    largest,
    residuals_at,
    stage_residuals,
    stage_states,
    turns_to,
)
from esail_jax.steppers.corotational_axes import Turn, axes_of
from esail_jax.steppers.implicit_derivative import Linearised, implicit_change
from esail_jax.steppers.transposable import Transposable
from esail_jax.system import Residual, System

MAX_ITERATIONS = 10
"""Largest number of iterations, after which a step has failed. With half the step size it is cheaper."""

LINEAR_TOLERANCE = 2e-10
"""Tolerance of the iterations for the linear equations of a derivative: the largest estimated remaining
error, relative to the first change."""

LEAST_RATE = 0.02
"""Smallest ratio of successive changes with which the remaining error is estimated. The second change is
several hundred times smaller than the first, but later changes decrease more slowly: with the true first
ratio the estimate would be too small."""

DIVERGED = 1e-3
"""Remaining error over the first change above which iterations have failed: a derivative with three digits
or less is not given."""

MAX_LINEAR_ITERATIONS = 30
"""Largest number of these iterations. They converge if those of the step did: the factors are the same."""


def solve_stages(
    system: System,
    start: StepEnd,
    h: Scalar,
    guess: StageUnknowns,
    factors: FrozenFactors,
    enough: Float[Array, "2"],
) -> tuple[StageUnknowns, Int[Array, ""], Scalar]:
    """Solves the stages of a step until the remaining error, estimated from the last two increments of the
    positions, is at most `enough` [m] (of tethers and of the hub).

    Returns the unknowns, the number of iterations, and the remaining error over `enough`. Guess and factors
    decide how fast the iterations converge, not the solution."""

    def iterate(carry):
        unknowns, count, before, _ = carry
        residual, axes = stage_residuals(system, start, h, jax.tree.map(reshaped, unknowns, guess))
        change = correction(system, residual, turns_to(axes, factors), factors)
        unknowns = jax.tree.map(lambda x, y: x + reshaped(y, x), unknowns, change)
        moved = jax.tree.map(lambda x: combined(TABLE.squared, x), change.vdot)
        increment = h**2 * largest(system, jax.tree.map(greatest, moved), enough)
        rate = jnp.where(count > 0, increment / before, 0.5)
        left = increment * jnp.where(rate < 1.0, rate / (1.0 - rate), jnp.inf)
        return unknowns, count + 1, increment, left

    def unfinished(carry):
        *_, count, _, left = carry
        return ~(left <= 1.0) & (count < MAX_ITERATIONS) & (jnp.isfinite(left) | (count < 2))

    infinite = jnp.asarray(jnp.inf)
    # All nodes of all tethers are on one axis: the compiler's loops over short axes are slow.
    flat = {"tether": guess.vdot.tether, "ring": guess.vdot.ring}
    flat = {name: x.reshape(*x.shape[:-2], -1) for name, x in flat.items() if x is not None}
    carried = guess._replace(vdot=guess.vdot._replace(**flat))
    carry = (carried, jnp.zeros((), int), infinite, infinite)
    unknowns, count, _, left = lax.while_loop(unfinished, iterate, carry)
    return jax.tree.map(reshaped, unknowns, guess), count, left


def reshaped(x: Array, like: Array) -> Array:
    """The array in the shape of another array."""
    return x.reshape(like.shape)


@custom_jvp
def known_stages(
    system: System,
    start: StepEnd,
    h: Scalar,
    unknowns: StageUnknowns,
    factors: FrozenFactors,
) -> StageUnknowns:
    """The unknowns as they are, with the derivative of the solution with respect to system, start
    and h. The factors are those of the linear solver and carry no derivative."""
    return unknowns


@functools.partial(known_stages.defjvp, symbolic_zeros=True)
def _known_stages_jvp(primals, tangents):
    """d(unknowns) = -J^-1 d(residual): implicit function theorem, J being that of all stages together."""
    unknowns = known_stages(*primals)
    system, start, h, _, factors = primals
    times, q, v = stage_states(start, h, unknowns.vdot)

    def carried(start, h):
        return StageStates(*stage_states(start, h, unknowns.vdot)[1:])

    def at_rest(system, time, h):
        at = with_moved_roots(system, unknowns)
        states = (q, v) if at is unknowns else stage_states(start, primals[2], at.vdot)[1:]
        return residuals_at(system, time + h * TABLE.nodes, *states, at)

    _, moved = jvp_of_perturbed(carried, (start, h), tangents[1:3])
    given = (system, start.time, h)
    _, short = jvp_of_perturbed(at_rest, given, (tangents[0], tangents[1].time, tangents[2]))
    axes = jax.vmap(lambda time, q: axes_of(system, time, q))(times, q)
    linear = LinearisedStages(system, times, h, StageStates(q, v), unknowns)
    change = linear_solution(linear, moved, short, turns_to(axes, factors), factors)
    by_places = jvp_of_perturbed(lambda system: with_moved_roots(system, unknowns), (system,), tangents[:1])
    return unknowns, jax.tree.map(jnp.add, change, by_places[1])


def with_moved_roots(system: System, unknowns: StageUnknowns) -> StageUnknowns:
    """The unknowns, as functions of the places of the roots on the hub where these are numbers of
    their own: the accelerations of the roots follow from them."""
    if system.hub is None or system.roots.azimuth is None:
        return unknowns
    return unknowns._replace(vdot=jax.vmap(lambda a: on_roots(system, a))(unknowns.vdot))


class StageStates(NamedTuple):
    """Positions and velocities of the stages, or their change with the start of the step for constant
    accelerations."""

    q: Coordinates
    v: Coordinates


@dataclasses.dataclass(frozen=True)
class LinearisedStages(Linearised[StageStates, StageUnknowns]):
    """The equations of all stages; changes of the start are those of the states.

    times: of the stages [s]; h: the step size [s]. Roots move with the hub: in the square system, their
    rows are added to those of the hub, and their columns are left out."""

    system: System
    times: Float[Array, " stage"]
    h: Scalar
    start: StageStates
    unknowns: StageUnknowns

    def with_roots(self, x: StageUnknowns) -> StageUnknowns:
        """The unknowns with the roots' accelerations from the hub."""
        return x._replace(vdot=jax.vmap(lambda a: on_roots(self.system, a))(x.vdot))

    def without_roots(self, x: StageUnknowns) -> StageUnknowns:
        """The unknowns with zeros for the roots that move with the hub."""
        roots = self.system.roots
        if roots is None:
            return x
        held = roots.releases.where_released(x.vdot.tether[:, 0, :, 0], jnp.zeros(()))
        return x._replace(vdot=x.vdot._replace(tether=x.vdot.tether.at[:, 0, :, 0].set(held)))

    def folded(self, residual: Residual) -> StageUnknowns:
        """The rows of the square system."""
        rows = StageUnknowns(residual.forces, residual.constraints)
        return jax.linear_transpose(self.with_roots, rows)(rows)[0]

    def rows(self, system: System, moved: StageStates, x: StageUnknowns) -> StageUnknowns:
        change = self.with_roots(x)
        once = jax.tree.map(lambda a: jnp.tensordot(TABLE.matrix, a, 1), change.vdot)
        twice = jax.tree.map(lambda a: jnp.tensordot(TABLE.squared, a, 1), change.vdot)
        q = jax.tree.map(lambda q, m, a: q + m + self.h**2 * a, self.start.q, moved.q, twice)
        v = jax.tree.map(lambda v, m, a: v + m + self.h * a, self.start.v, moved.v, once)
        unknowns = jax.tree.map(jnp.add, self.unknowns, change)
        rows = self.folded(residuals_at(system, self.times, q, v, unknowns))
        return jax.tree.map(lambda f, x, y: f + x - y, rows, x, self.without_roots(x))

    def transposable(self) -> System:
        return Transposable.of(self.system)


def linear_solution(
    linear: LinearisedStages,
    moved: StageStates,
    given: Residual,
    turns: Turn,
    factors: FrozenFactors,
) -> StageUnknowns:
    """The change of the unknowns with a change of the states, by simplified Newton iterations. given: that
    of the left-hand sides by the numbers of the system."""
    turns, factors = lax.stop_gradient((turns, factors))
    nothing, zero = linear.nothing
    along = linear.forwards()

    def precondition(residual):
        residual = linear.without_roots(residual)
        vdot, lam = residual
        return linear.without_roots(correction(linear.system, Residual(vdot, lam), turns, factors))

    def solve(along, rows):
        return improved(lambda x: ((), along(nothing, x)), precondition, rows, ((), zero))[1]

    def solve_transposed(rows):
        back_precondition = jax.linear_transpose(precondition, zero)
        return improved(linear.backwards(), lambda x: back_precondition(x)[0], rows, (nothing, zero))

    folded = linear.folded(given)
    return linear.with_roots(implicit_change(lambda: along, moved, folded, zero, solve, solve_transposed))


def improved(
    product: Callable[[StageUnknowns], tuple[Any, StageUnknowns]],
    precondition: Callable[[StageUnknowns], StageUnknowns],
    rhs: StageUnknowns,
    nothing: tuple[Any, StageUnknowns],
) -> tuple[Any, StageUnknowns]:
    """Solves A x = rhs by simplified Newton iterations and returns B x and x.

    product: the linear function x -> (B x, A x), where B x may be empty; precondition: the approximate
    solution of A x = -rhs; nothing: zeros in the form of (B x, x). B x is the sum of the products of the
    changes, so that x itself is not multiplied again.

    The iterations end when the remaining error of x, estimated from the last two changes in the norm of
    `work_norm`, is within LINEAR_TOLERANCE of the first change. The estimate assumes that the next changes
    decrease as the last one did. A part that decreases slowly and is still small can leave an error ten
    times as large. Iterations that end with a remaining error above DIVERGED of the first change give
    NaN."""

    def improve(carry):
        sums, left, count, before, first, _ = carry
        change = precondition(left)
        norm = work_norm(change, left)
        by_b, by_a = product(change)
        sums = jax.tree.map(jnp.add, sums, (by_b, change))
        left = jax.tree.map(jnp.add, left, by_a)
        first = jnp.where(count > 0, first, norm)
        rate = jnp.clip(norm / before, LEAST_RATE, 1.0)
        return sums, left, count + 1, norm, first, norm * rate / (1.0 - rate)

    def unfinished(carry):
        *_, count, _, first, error = carry
        return (error > LINEAR_TOLERANCE * first) & (count < MAX_LINEAR_ITERATIONS)

    left = jax.tree.map(jnp.negative, rhs)
    infinite = jnp.asarray(jnp.inf)
    carry = (nothing, left, jnp.zeros((), int), infinite, jnp.zeros(()), infinite)
    sums, *_, first, error = lax.while_loop(unfinished, improve, carry)
    return jax.tree.map(lambda x: jnp.where(error > DIVERGED * first, jnp.nan, x), sums)


def work_norm(change: StageUnknowns, rows: StageUnknowns) -> Scalar:
    """A norm of an increment: the square root of the sum of |change_i rows_i|.

    Every term is a force times an acceleration, also for slopes, multipliers and transposed equations."""
    terms = jax.tree.map(lambda x, y: jnp.abs(x * y).sum(), change, rows)
    return jnp.sqrt(sum(jax.tree.leaves(terms)))


def on_roots(system: System, vdot: Coordinates) -> Coordinates:
    """A change of the accelerations in which roots follow the hub. Roots of a frame do not
    change."""
    if system.roots is None:
        return vdot
    root = jnp.zeros_like(vdot.tether[0, :, 0])
    if system.hub is not None:
        root = system.roots.positions(vdot.hub)
    root = system.roots.releases.where_released(vdot.tether[0, :, 0], root)
    return vdot._replace(tether=vdot.tether.at[0, :, 0].set(root))
