"""The unknowns of a fixed step by chord iterations, and the derivative of their solution.

The derivative is that of the equations at their solution (implicit function theorem) with a fresh tangent,
whatever the iterations did; a forward run does not pay for it.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Float, Int, Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.numerics.symbolic_zeros import (
    is_symbolic,
    jvp_of_perturbed,
    materialised,
    perturbed,
    unused_matvec,
)
from esail_jax.steppers.fixed_step import FixedStep, FrozenFactors, IterationInfo, Unknowns
from esail_jax.system import Power, Residual, System

MARGIN = 10.0
"""By which iterations are taken to converge worse than they last did with the same factors."""


@jax.custom_jvp
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
    """Chord iterations. Guess and factors decide how fast they converge, not where to: they carry
    no derivative. rate: as in `FixedStep.step`."""
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
    return lax.while_loop(unfinished, iterate, (guess, Power(zero, zero), start))


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
    linear = Linearised(stepper, system, end, Start(q0, v0), unknowns)
    unknowns_dot = linear_solution(linear, start_dot, given)
    at = (*primals[:5], unknowns)
    power_dot = jvp_if_wanted(lambda *x: equations(*x)[1], at, (*tangents[:5], unknowns_dot))
    none = np.zeros((), jax.dtypes.float0)
    zero = jnp.zeros(())
    info_dot = IterationInfo(none, *(jnp.zeros(2),) * 2, zero, jnp.zeros(2), zero, zero, none)
    return (unknowns, power, info), (unknowns_dot, power_dot, info_dot)


class Start(NamedTuple):
    """q0 and v0 of a step, or a change of them."""

    q: Coordinates
    v: Coordinates


class Linearised(NamedTuple):
    """The equations of a step at their solution, for changes of the start and of the unknowns."""

    stepper: FixedStep
    system: System
    end: Scalar
    start: Start
    unknowns: Unknowns

    def rows(self, system: System, moved: Start, change: Unknowns) -> Unknowns:
        """Left-hand sides after both."""
        q0, v0 = jax.tree.map(jnp.add, self.start, moved)
        unknowns = jax.tree.map(jnp.add, self.unknowns, change)
        return Unknowns(*self.stepper.residual(system, self.end, q0, v0, unknowns)[0])

    @property
    def nothing(self) -> tuple[Start, Unknowns]:
        """No change."""
        return jax.tree.map(jnp.zeros_like, (self.start, self.unknowns))

    def forwards(self) -> Callable[[Start, Unknowns], Unknowns]:
        """The derivative of `rows`."""
        return jax.linearize(lambda *x: self.rows(self.system, *x), *self.nothing)[1]

    def backwards(self) -> Callable[[Unknowns], tuple[Start, Unknowns]]:
        """Its transpose."""
        system = self.stepper.transposable(self.system)
        return jax.vjp(lambda *x: self.rows(system, *x), *self.nothing)[1]

    def inverse(self) -> Callable[[Unknowns], Unknowns]:
        """Of the derivative by the unknowns: factors of a fresh tangent."""
        fresh = self.stepper.tangent(self.system, self.end, *self.start, self.unknowns)

        def solved(rows):
            change, _ = self.stepper.correct(self.system, Residual(*rows), fresh, jnp.eye(3))
            return jax.tree.map(jnp.negative, change)

        return solved


def linear_solution(linear: Linearised, moved: Start, given: Residual) -> Unknowns:
    """x with A_1 moved + A_2 x + given = 0, and the transpose for reverse mode. A_1 moved is part of the
    solution, (1, 0; A_1, A_2) (moved, x) = (moved, -given): so that reverse mode has the transpose of A_1
    that `transposable` knows, not the one the compiler would be given."""
    linear = lax.stop_gradient(linear)
    nothing, zero = linear.nothing

    def improved(product, inverse, rows):
        x = inverse(rows)
        if linear.system.controlled:
            # The tangent does not know how voltages depend on the attitude: a part in a million.
            left = jax.tree.map(jnp.subtract, rows, product(x))
            x = jax.tree.map(jnp.add, x, inverse(left))
        return x

    def solve(_, rhs):
        moved, rows = rhs
        along = linear.forwards()
        rows = jax.tree.map(jnp.subtract, rows, along(moved, zero))
        return moved, improved(lambda x: along(nothing, x), linear.inverse(), rows)

    def solve_transposed(_, rhs):
        moved, rows = rhs
        back = linear.backwards()
        inverse = jax.linear_transpose(linear.inverse(), zero)
        x = improved(lambda x: back(x)[1], lambda x: inverse(x)[0], rows)
        return jax.tree.map(jnp.subtract, moved, back(x)[0]), x

    rows = jax.tree.map(jnp.negative, Unknowns(*given))
    # As one: the rule for the transpose refuses a part that nothing perturbs beside others.
    both = lax.optimization_barrier((moved, rows))
    return lax.custom_linear_solve(unused_matvec, both, solve, solve_transposed)[1]


def jvp_if_wanted(function: Callable, primals: tuple, tangents: tuple) -> Any:
    """The tangent of a function, whose transpose is left out in a run where nothing depends on it: most
    objectives do not ask for energies."""
    function, at, moves = perturbed(function, primals, tangents)
    at = lax.stop_gradient(at)
    along = functools.partial(jax.jvp, function, at)

    def solve(_, both):
        moves, y = both
        return moves, jax.tree.map(jnp.add, y, along(moves)[1])

    def solve_transposed(_, both):
        moves, y = both
        wanted = jnp.stack([(x != 0.0).any() for x in jax.tree.leaves(y)]).any()
        back = lax.cond(wanted, lambda y: jax.vjp(function, *at)[1](y), lambda _: nothing_of(at), y)
        return jax.tree.map(jnp.add, moves, back), y

    nothing = nothing_of(jax.eval_shape(function, *at))
    both = lax.optimization_barrier((moves, nothing))
    return lax.custom_linear_solve(unused_matvec, both, solve, solve_transposed)[1]


def nothing_of(like: Any) -> Any:
    """Zeros."""
    return jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), like)


def increment_norms(system: System, dq: Coordinates) -> tuple[Float[jax.Array, "2"], Int[jax.Array, ""]]:
    """Largest change [m] of a tether's nodal coordinates (slopes times l) and of the hub's, and
    which tether's it is."""
    tether = jnp.abs(system.tethers.scale_slopes(dq.tether)).max((0, 1, 2))
    hub = jnp.abs(dq.hub).max() if dq.hub is not None else jnp.zeros(())
    return jnp.stack([tether.max(), hub]), jnp.argmax(tether)


def largest(constraints: Multipliers) -> Scalar:
    """Largest constraint violation [m]."""
    leaves = jax.tree.leaves(constraints)
    return jnp.stack([jnp.abs(x).max() for x in leaves]).max() if leaves else jnp.zeros(())
