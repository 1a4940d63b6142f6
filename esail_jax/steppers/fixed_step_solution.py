"""The solution of the equations of a fixed step by simplified Newton iterations, and its derivative.

The derivative follows from the implicit function theorem at the solution, with a new tangent matrix. It
does not depend on the iterations, and a run without derivatives does not compute it
(`implicit_derivative.py`)."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Float, Int, Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.numerics.lockstep import any_member
from esail_jax.numerics.own_derivative import custom_jvp
from esail_jax.numerics.symbolic_zeros import (
    bundled,
    is_symbolic,
    jvp_of_perturbed,
    materialised,
    nothing_of,
    perturbed,
    tied,
)
from esail_jax.steppers.fixed_step import FixedStep
from esail_jax.steppers.fixed_step_state import FrozenFactors, IterationInfo, Unknowns
from esail_jax.steppers.implicit_derivative import Linearised, implicit_change
from esail_jax.system import Power, Residual, System

MARGIN = 10.0
"""Safety factor: iterations may converge this much more slowly than before with the same factors."""


@custom_jvp
def solve_step(
    stepper: FixedStep,
    system: System,
    end: Scalar,
    q0: Coordinates,
    v0: Coordinates,
    guess: Unknowns,
    factors: FrozenFactors,
    rate: Scalar,
) -> tuple[Unknowns, Power, IterationInfo]:
    """Solves the equations of a step. Returns the unknowns, the power, and the convergence.

    Guess and factors decide how fast the iterations converge, not the solution; they carry no derivative.
    rate: as in `FixedStep.step`."""
    turned = stepper.attitude(system, end, q0, v0, guess.vdot) @ factors.rotation.T

    def iterate(carry):
        unknowns, _, info = carry
        residual, power = stepper.residual(system, end, q0, v0, unknowns)
        change, dq = stepper.correct(system, residual, factors, turned)
        unknowns = jax.tree.map(jnp.add, unknowns, change)
        norms, worst = increment_norms(system, dq)
        size, before = ((x / info.tolerance).max() for x in (norms, info.increment))
        rate = jnp.where(info.iterations > 0, size / before, info.rate)
        part = jnp.where(size <= stepper.trusted, jnp.minimum(1.0, MARGIN * rate), 1.0)
        info = IterationInfo(
            iterations=info.iterations + 1,
            increment=norms,
            left=part * norms,
            rate=rate,
            tolerance=info.tolerance,
            constraint=largest(residual.constraints),
            residual=jnp.abs(residual.forces.tether[0, :, 1:]).max(),
            tether=worst,
        )
        return unknowns, power, info

    def unfinished(carry):
        info = carry[-1]
        return ~info.converged() & (info.iterations < stepper.most_iterations)

    zero, none = jnp.zeros(()), jnp.zeros((), int)
    infinite = jnp.full(2, jnp.inf)
    start = IterationInfo(none, infinite, infinite, rate, stepper.tolerances(system, q0), zero, zero, none)
    return lax.while_loop(unfinished, iterate, (guess, system.no_power, start))


@functools.partial(solve_step.defjvp, symbolic_zeros=True)
def _solve_step_jvp(primals, tangents):
    """d(unknowns) = -(dR/dx)^{-1} dR: implicit function theorem with the exact tangent."""
    stepper, system, end, q0, v0, *_ = primals
    unknowns, power, info = solve_step(*primals)
    equations = type(stepper).residual

    def at_that_start(stepper, system, end):
        return equations(stepper, system, end, q0, v0, unknowns)[0]

    _, given = jvp_of_perturbed(at_that_start, primals[:3], tangents[:3])
    start_dot = Start(*jax.tree.map(materialised, tangents[3:5], is_leaf=is_symbolic))
    linear = LinearisedStep(stepper, system, end, Start(q0, v0), unknowns)
    unknowns_dot = linear_solution(linear, start_dot, given)
    at = (*primals[:5], unknowns)
    power_dot = jvp_if_wanted(lambda *x: equations(*x)[1], at, (*tangents[:5], unknowns_dot))
    none = np.zeros((), jax.dtypes.float0)
    zero = jnp.zeros(())
    info_dot = IterationInfo(none, *(jnp.zeros(2),) * 2, zero, jnp.zeros(2), zero, zero, none)
    return (unknowns, power, info), (unknowns_dot, power_dot, info_dot)


class Start(NamedTuple):
    """The data q0 and v0 of a step, or a change of them."""

    q: Coordinates
    v: Coordinates


@dataclasses.dataclass(frozen=True)
class LinearisedStep(Linearised[Start, Unknowns]):
    """The equations of a step with their stepper. end: the time at its end [s]."""

    stepper: FixedStep
    system: System
    end: Scalar
    start: Start
    unknowns: Unknowns

    def rows(self, system: System, moved: Start, change: Unknowns) -> Unknowns:
        q0, v0 = jax.tree.map(jnp.add, self.start, moved)
        unknowns = jax.tree.map(jnp.add, self.unknowns, change)
        return Unknowns(*self.stepper.residual(system, self.end, q0, v0, unknowns)[0])

    def transposable(self) -> System:
        return self.stepper.transposable(self.system)

    def inverse(self) -> Callable[[Unknowns], Unknowns]:
        """The inverse of the derivative with respect to the unknowns, from a new tangent matrix."""
        fresh = self.stepper.tangent(self.system, self.end, *self.start, self.unknowns)

        def solved(rows):
            change, _ = self.stepper.correct(self.system, Residual(*rows), fresh, jnp.eye(3))
            return jax.tree.map(jnp.negative, change)

        return solved


def linear_solution(linear: LinearisedStep, moved: Start, given: Residual) -> Unknowns:
    """The change of the unknowns with a change of the start. given: that of the left-hand sides by the
    numbers of the system."""
    nothing, zero = linear.nothing

    def improved(product, inverse, rows):
        x = inverse(rows)
        if linear.system.controlled:
            # The tangent matrix lacks the voltages' dependence on the attitude, about 1e-6 of it.
            left = jax.tree.map(jnp.subtract, rows, product(x))
            x = jax.tree.map(jnp.add, x, inverse(left))
        return x

    def solve(along, rows):
        return improved(lambda x: along(nothing, x), linear.inverse(), rows)

    def solve_transposed(rows):
        back = linear.backwards()
        inverse = jax.linear_transpose(linear.inverse(), zero)
        x = improved(lambda x: back(x)[1], lambda x: inverse(x)[0], rows)
        return back(x)[0], x

    return implicit_change(linear.forwards, moved, Unknowns(*given), zero, solve, solve_transposed)


def jvp_if_wanted(function: Callable, primals: tuple, tangents: tuple) -> Any:
    """The tangent of a function. At run time its transpose is skipped if the cotangent is zero:
    most objectives do not depend on energies."""
    function, at, moves = perturbed(function, primals, tangents)
    along = functools.partial(jax.jvp, function, at)

    def solve(_, both):
        moves, y = both
        return moves, jax.tree.map(jnp.add, y, along(moves)[1])

    def solve_transposed(_, both):
        moves, y = both
        wanted = jnp.stack([(x != 0.0).any() for x in jax.tree.leaves(y)]).any()
        back = lax.cond(
            any_member(wanted), lambda y: jax.vjp(function, *at)[1](y), lambda _: nothing_of(at), y
        )
        return jax.tree.map(jnp.add, moves, back), y

    nothing = nothing_of(jax.eval_shape(function, *at))

    def product(both):
        moves, y = both
        return bundled((moves, jax.tree.map(jnp.subtract, y, along(moves)[1])))

    both = bundled((moves, nothing))
    moves, y = lax.custom_linear_solve(product, both, solve, solve_transposed)
    return tied(y, moves)


def increment_norms(system: System, dq: Coordinates) -> tuple[Float[jax.Array, "2"], Int[jax.Array, ""]]:
    """The largest change [m] of nodal coordinates of the tethers (slopes times l), of lengths that are
    unknowns, and of the hub's points, and the number of the tether with the largest change."""
    tether = jnp.abs(system.tethers.scale_slopes(dq.tether)).max((0, 1, 2))
    if dq.ring is not None:
        tether = jnp.maximum(tether, jnp.abs(dq.ring).max((0, 1)))
    if dq.reel is not None:
        tether = jnp.maximum(tether, jnp.abs(dq.reel))
    hub = jnp.abs(dq.hub).max() if dq.hub is not None else jnp.zeros(())
    return jnp.stack([tether.max(), hub]), jnp.argmax(tether)


def largest(constraints: Multipliers) -> Scalar:
    """The largest constraint violation [m]."""
    leaves = jax.tree.leaves(constraints)
    return jnp.stack([jnp.abs(x).max() for x in leaves]).max() if leaves else jnp.zeros(())
