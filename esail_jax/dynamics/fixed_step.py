"""What the implicit methods of fixed steps share: a step's state, and the chord iterations that find it.

The unknowns of a step are vdot (of energy-momentum, w) and the multipliers. The factors of the iteration
matrix, kept over `KEEP` steps, are turned with the hub. Inertia, elasticity, damping and rigidity look the
same from every direction, so factors made at one attitude serve at any other: what they lose is only the
change of shape, not the rotation.

The derivative of a step is that of the equations at their solution (implicit function theorem) with a fresh
tangent, whatever the iterations did; a forward run does not pay for it.
"""

from abc import abstractmethod
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax import newton_matrix
from esail_jax.array_types import Float, Int, Rotation, Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.numerics import bordered
from esail_jax.system import Power, System

KEEP = 20
"""Steps per factorisation. A block of this many steps is the unit of work everywhere: a resumed run
starts at a block, so that it factors where the uninterrupted one did."""

MAX_ITERATIONS = 12
"""Chord iterations after which a step has failed; good ones take one or two."""

MARGIN = 10.0
"""By which iterations are taken to converge worse than they last did with the same factors."""


class State(NamedTuple):
    """What one step hands to the next.

    rise, bend: first and second differences of vdot over the last steps, for the first guess.
    work: external work and dissipated energy [J] since the start of the run; power: their rates
    [W] at this instant.
    """

    q: Coordinates
    v: Coordinates
    vdot: Coordinates
    a: Coordinates
    lam: Multipliers
    rise: Coordinates
    bend: Coordinates
    work: Power
    power: Power


class KeptFactors(NamedTuple):
    """Factors of an iteration matrix, and the attitude they were made at."""

    matrix: bordered.Bordered
    factors: bordered.Factors
    rotation: Rotation

    def solve(
        self, system: System, turned: Rotation, forces: Coordinates, constraints: Multipliers
    ) -> tuple[Coordinates, Multipliers]:
        """(dq, s dlam) for a right-hand side given at an attitude `turned` from the factors'."""
        rhs = newton_matrix.to_vector(system, forces.rotate(turned.T), constraints)
        dq, dlam = newton_matrix.from_vector(system, bordered.solve(self.matrix, self.factors, rhs))
        return dq.rotate(turned), dlam


class StepInfo(NamedTuple):
    """How a step went.

    iterations; increment [m]: the last one, of tether nodes and of the hub; left [m]: what it is expected
    to leave undone, and the tolerances [m] that this is held to; rate: last increment over the one before,
    of this step or of an earlier one with the same factors; constraint [m] and residual [N]: largest
    constraint violation and unbalanced force of a node beyond the root, before the last correction and
    any scaling; tether: the one with the largest increment.
    """

    iterations: Int[jax.Array, ""]
    increment: Float[jax.Array, "2"]
    left: Float[jax.Array, "2"]
    rate: Scalar
    tolerance: Float[jax.Array, "2"]
    constraint: Scalar
    residual: Scalar
    tether: Int[jax.Array, ""]

    def converged(self) -> jax.Array:
        """False also for NaN."""
        return (self.left <= self.tolerance).all()


class Unknowns(NamedTuple):
    """What a step solves for."""

    vdot: Coordinates
    lam: Multipliers


class FixedStep(eqx.Module):
    """A method that finds vdot and lam of a step by chord iterations: numbers are leaves, so that a new
    step size does not compile again. The rest of what `solve_step` asks of one is in its subclasses:
    `attitude`, `residual`, `correct`, `tangent` and `tolerances`."""

    step_size: Scalar

    most_iterations: ClassVar[int] = MAX_ITERATIONS
    trusted: ClassVar[float] = 1.0
    """Tolerances that a last increment may have where so little of it is expected to be left. Above 1 the
    power of a step, that of the state before its last correction, is off by as much."""

    @abstractmethod
    def factor(
        self, system: System, time: Scalar, q: Coordinates, v: Coordinates, lam: Multipliers
    ) -> KeptFactors:
        """Iteration matrix at a state, and its factors."""

    @abstractmethod
    def step(
        self, system: System, time: Scalar, state: State, kept: KeptFactors, rate: Scalar
    ) -> tuple[State, StepInfo]:
        """From t to t + h, until what is left is within tolerance. rate: that of an earlier step with
        these factors, infinite if there was none."""

    def block(
        self, system: System, time: Scalar, state: State, steps: int
    ) -> tuple[State, tuple[State, StepInfo]]:
        """`steps` steps with one factorisation; also every state after a step."""
        kept = self.factor(system, time, state.q, state.v, state.lam)

        def advance(carry, index):
            state, rate = carry
            state, info = self.step(system, time + index * self.step_size, state, kept, rate)
            return (state, lax.stop_gradient(info.rate)), (state, info)

        (state, _), results = lax.scan(advance, (state, jnp.asarray(jnp.inf)), jnp.arange(steps))
        return state, results


@jax.custom_jvp
def solve_step(
    stepper: FixedStep,
    system: System,
    end: Scalar,
    q0: Coordinates,
    v0: Coordinates,
    guess: Unknowns,
    kept: KeptFactors,
    rate: Scalar,
) -> tuple[Unknowns, Power, StepInfo]:
    """Chord iterations. Guess and factors decide how fast they converge, not where to: they carry
    no derivative. rate: as in `FixedStep.step`."""
    turned = stepper.attitude(system, end, q0, v0, guess.vdot) @ kept.rotation.T

    def iterate(carry):
        unknowns, _, info = carry
        residual, power = stepper.residual(system, end, q0, v0, unknowns)
        change, dq = stepper.correct(system, residual, kept, turned)
        unknowns = jax.tree.map(jnp.add, unknowns, change)
        norms, worst = increment_norms(system, dq)
        size, before = ((x / info.tolerance).max() for x in (norms, info.increment))
        rate = jnp.where(info.iterations > 0, size / before, info.rate)
        part = jnp.where(size <= stepper.trusted, jnp.minimum(1.0, MARGIN * rate), 1.0)
        info = StepInfo(
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
    start = StepInfo(none, infinite, infinite, rate, stepper.tolerances(system, q0), zero, zero, none)
    return lax.while_loop(unfinished, iterate, (guess, Power(zero, zero), start))


@solve_step.defjvp
def _solve_step_jvp(primals, tangents):
    """d(unknowns) = -(dR/dx)^{-1} dR: implicit function theorem with the exact tangent."""
    stepper, system, end, q0, v0, *_ = primals
    given, given_dot = primals[:5], tangents[:5]
    unknowns, power, info = solve_step(*primals)
    equations = type(stepper).residual
    _, (residual_dot, _) = jax.jvp(lambda *x: equations(*x, unknowns), given, given_dot)
    fresh = lax.stop_gradient(stepper.tangent(system, end, q0, v0, unknowns))
    unknowns_dot, _ = stepper.correct(system, residual_dot, fresh, jnp.eye(3))
    _, (residual_dot, power_dot) = jax.jvp(equations, (*given, unknowns), (*given_dot, unknowns_dot))
    if system.steering is not None:
        # The matrix does not know how voltages depend on the attitude: a part in a million.
        change, _ = stepper.correct(system, residual_dot, fresh, jnp.eye(3))
        unknowns_dot = jax.tree.map(jnp.add, unknowns_dot, change)
        _, (_, power_dot) = jax.jvp(equations, (*given, unknowns), (*given_dot, unknowns_dot))
    none = np.zeros((), jax.dtypes.float0)
    zero = jnp.zeros(())
    info_dot = StepInfo(none, *(jnp.zeros(2),) * 2, zero, jnp.zeros(2), zero, zero, none)
    return (unknowns, power, info), (unknowns_dot, power_dot, info_dot)


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
