"""What the implicit methods of fixed steps share: a step's state, and what is asked of a method.

The unknowns of a step are vdot (of energy-momentum, w) and the multipliers, found by chord iterations
(`step_solution.py`). The factors of the iteration matrix, kept over `KEEP` steps, are turned with the hub.
Inertia, elasticity, damping and rigidity look the same from every direction, so factors made at one
attitude serve at any other: what they lose is only the change of shape, not the rotation.
"""

from abc import abstractmethod
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax

from esail_jax import iteration_matrix
from esail_jax.array_types import Float, Int, Rotation, Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.numerics import bordered
from esail_jax.system import Power, System

KEEP = 20
"""Steps per factorisation. A block of this many steps is the unit of work everywhere: a resumed run
starts at a block, so that it factors where the uninterrupted one did."""

MAX_ITERATIONS = 12
"""Chord iterations after which a step has failed; good ones take one or two."""


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
        rhs = iteration_matrix.to_vector(system, forces.rotate(turned.T), constraints)
        dq, dlam = iteration_matrix.from_vector(system, bordered.solve(self.matrix, self.factors, rhs))
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

    @property
    @abstractmethod
    def phase_error(self) -> Scalar:
        """c: the phase that an oscillation at omega loses in a step is c (h omega)^3."""

    @abstractmethod
    def factor(
        self, system: System, time: Scalar, q: Coordinates, v: Coordinates, lam: Multipliers
    ) -> KeptFactors:
        """Iteration matrix at a state, and its factors."""

    def transposable(self, system: System) -> System:
        """The system whose derivative with respect to the state is taken in reverse."""
        return system

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
