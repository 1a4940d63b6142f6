"""The stages of a collocation step solved, and the derivative of their solution.

Simplified Newton iterations with the factors of `stages.py`; the derivative follows from the implicit
function theorem, by the same factors and the exact derivative of the equations. It is that of a solution
that is known already: nothing is solved twice for it.
"""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Float, Int, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.dynamics.attached_axes import Turn, axes_of
from esail_jax.dynamics.stages import (
    TABLE,
    KeptFactors,
    Point,
    Unknowns,
    correction,
    largest,
    stage_residuals,
    stage_states,
    turns_to,
)
from esail_jax.numerics.perturbed import jvp_of_perturbed
from esail_jax.numerics.vectors import greatest
from esail_jax.system import Residual, System

MAX_ITERATIONS = 10
"""After which a step has failed: what converges so slowly is cheaper with half the step."""

MORE_ITERATIONS = 2
"""What the linear equations of a derivative take beyond the iterations of the step itself: seven digits
or more. A number fixed in advance, so that reverse mode is the exact transpose of forward mode."""


def solve_stages(
    system: System,
    start: Point,
    h: Scalar,
    guess: Unknowns,
    kept: KeptFactors,
    enough: Float[Array, "2"],
) -> tuple[Unknowns, Int[Array, ""], Scalar]:
    """Simplified Newton iterations, until what is left, judged by the last two increments of the
    positions, is `enough` [m] (of tethers and hub): unknowns, iterations, and what is left over that.
    Guess and factors decide how fast, not where to."""

    def iterate(carry):
        unknowns, count, before, _ = carry
        residual, axes = stage_residuals(system, start, h, unknowns)
        change = correction(system, residual, turns_to(axes, kept), kept)
        unknowns = jax.tree.map(jnp.add, unknowns, change)
        moved = jax.tree.map(lambda x: h**2 * jnp.tensordot(TABLE.squared, x, 1), change.vdot)
        increment = largest(system, jax.tree.map(greatest, moved), enough)
        rate = jnp.where(count > 0, increment / before, 0.5)
        left = increment * jnp.where(rate < 1.0, rate / (1.0 - rate), jnp.inf)
        return unknowns, count + 1, increment, left

    def unfinished(carry):
        *_, count, _, left = carry
        return ~(left <= 1.0) & (count < MAX_ITERATIONS) & (jnp.isfinite(left) | (count < 2))

    infinite = jnp.asarray(jnp.inf)
    carry = (guess, jnp.zeros((), int), infinite, infinite)
    unknowns, count, _, left = lax.while_loop(unfinished, iterate, carry)
    return unknowns, count, left


@jax.custom_jvp
def known_stages(
    system: System,
    start: Point,
    h: Scalar,
    unknowns: Unknowns,
    kept: KeptFactors,
    iterations: Int[Array, ""],
) -> Unknowns:
    """The solution itself, with its derivative with respect to system, start and h. The factors decide how
    fast that is found: they carry no derivative. iterations: that solved the stages."""
    return unknowns


@functools.partial(known_stages.defjvp, symbolic_zeros=True)
def _known_stages_jvp(primals, tangents):
    """d(unknowns) = -J^-1 d(residual): implicit function theorem, J being that of all stages together."""
    system, start, h, unknowns, kept, iterations = primals

    def residuals(system, start, h, unknowns):
        return stage_residuals(system, start, h, unknowns)[0]

    _, along = jax.linearize(lambda x: residuals(*primals[:3], x), unknowns)
    _, given = jvp_of_perturbed(lambda *x: residuals(*x, unknowns), primals[:3], tangents[:3])
    times, q, _ = stage_states(start, h, unknowns.vdot)
    axes = jax.vmap(lambda time, q: axes_of(system, time, q))(times, q)
    count = iterations + MORE_ITERATIONS
    return unknowns, linear_solution(system, along, given, turns_to(axes, kept), kept, count)


def linear_solution(
    system: System,
    along: Callable[[Unknowns], Residual],
    given: Residual,
    turns: Turn,
    kept: KeptFactors,
    count: Int[Array, ""],
) -> Unknowns:
    """x with along(x) + given = 0, by `count` of the same iterations, and their transpose for reverse mode.

    Roots move with the hub: in the square system that is solved, their rows are added to the hub's and
    their columns are taken out."""
    turns, kept = lax.stop_gradient((turns, kept))

    def with_roots(x):
        return x._replace(vdot=jax.vmap(lambda a: on_roots(system, a))(x.vdot))

    def without_roots(x):
        if system.roots is None:
            return x
        held = system.roots.releases.free(x.vdot.tether[:, 0, :, 0], jnp.zeros(()))
        return x._replace(vdot=x.vdot._replace(tether=x.vdot.tether.at[:, 0, :, 0].set(held)))

    nothing = jax.tree.map(jnp.zeros_like, Unknowns(given.forces, given.constraints))
    fold = jax.linear_transpose(with_roots, nothing)

    def equations(residual):
        return fold(Unknowns(residual.forces, residual.constraints))[0]

    def matrix(x):
        apart = jax.tree.map(jnp.subtract, x, without_roots(x))
        return jax.tree.map(jnp.add, equations(along(with_roots(x))), apart)

    def precondition(residual):
        residual = without_roots(residual)
        return without_roots(correction(system, Residual(residual.vdot, residual.lam), turns, kept))

    def solve(matrix, rhs, precondition=precondition):
        def improve(_, x):
            short = jax.tree.map(jnp.subtract, matrix(x), rhs)
            return jax.tree.map(jnp.add, x, precondition(short))

        first = jax.tree.map(jnp.negative, precondition(rhs))
        return lax.fori_loop(1, count, improve, first)

    def solve_transposed(transposed, rhs):
        backwards = jax.linear_transpose(precondition, rhs)
        return solve(transposed, rhs, lambda x: backwards(x)[0])

    rhs = jax.tree.map(jnp.negative, equations(given))
    return with_roots(lax.custom_linear_solve(matrix, rhs, solve, solve_transposed))


def on_roots(system: System, vdot: Coordinates) -> Coordinates:
    """A change of the accelerations with the roots where the hub's takes them; a frame's do not change."""
    if system.roots is None:
        return vdot
    root = jnp.zeros_like(vdot.tether[0, :, 0])
    if system.hub is not None:
        root = system.roots.positions(vdot.hub)
    root = system.roots.releases.free(vdot.tether[0, :, 0], root)
    return vdot._replace(tether=vdot.tether.at[0, :, 0].set(root))
