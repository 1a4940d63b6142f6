"""The state of a method with fixed steps, and what is known of the iterations of a step."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from esail_jax import iteration_matrix
from esail_jax.array_types import Array, Float, Int, Rotation, Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.numerics import bordered, structured
from esail_jax.steppers.results import RESULTS
from esail_jax.steppers.step_error import StepErrors
from esail_jax.steppers.stepper import AbstractState
from esail_jax.system import Power, System

MAX_HALVINGS = 6
"""Largest number of halvings of a step whose iterations do not converge. After it the run fails."""

TICKS = 2**MAX_HALVINGS
"""Units of time per whole step: the end of every step, halved or not, is an exact multiple of the unit."""


class StepState(NamedTuple):
    """The motion at the end of a step, and the memory of earlier steps that the next step needs.

    a: the auxiliary acceleration of generalized-alpha; vdot_difference, vdot_second_difference: differences
    of vdot over the last steps, for the next first guess; work: external work and dissipated energy [J]
    since the start of the run; power: their rates [W]."""

    q: Coordinates
    v: Coordinates
    vdot: Coordinates
    a: Coordinates
    lam: Multipliers
    vdot_difference: Coordinates
    vdot_second_difference: Coordinates
    work: Power
    power: Power


class FixedStepState(AbstractState):
    """The state after a block.

    origin: time of the call of `init` [s]; tick: step/TICKS [s]; ticks: time since `origin` in this unit;
    halvings: present number of halvings of the step; errors: the estimated errors so far."""

    now: StepState
    origin: Scalar
    tick: Scalar
    ticks: Int[Array, ""]
    halvings: Int[Array, ""]
    errors: StepErrors
    taken: Scalar
    rejected: Scalar
    result: RESULTS

    @property
    def time(self) -> Scalar:
        return self.origin + self.ticks * self.tick


class Unknowns(NamedTuple):
    """The unknowns of a step."""

    vdot: Coordinates
    lam: Multipliers


class IterationInfo(NamedTuple):
    """The convergence of a step's iterations.

    iterations: their number; increment: the last increment of tether nodes and of the hub [m]; left: the
    expected remaining error of both [m], which `tolerance` [m] limits; rate: the ratio of the last two
    increments, of this step or of an earlier one with the same factors; constraint, residual: largest
    constraint violation [m] and largest unbalanced force of a node beyond the root [N], before the last
    correction and without scaling; tether: the number of the tether with the largest increment.
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
        """Tells whether the remaining error is within tolerance; false for NaN."""
        return (self.left <= self.tolerance).all()


def no_info() -> IterationInfo:
    """The record of a step that was not tried."""
    zero, none, two = jnp.zeros(()), jnp.zeros((), int), jnp.zeros(2)
    return IterationInfo(none, two, two, zero, two, zero, zero, none)


class FrozenFactors(NamedTuple):
    """An iteration matrix, its factors, and the attitude at which it was assembled."""

    matrix: bordered.Bordered
    factors: structured.Factors
    rotation: Rotation

    def solve(
        self, system: System, turned: Rotation, forces: Coordinates, constraints: Multipliers
    ) -> tuple[Coordinates, Multipliers]:
        """(dq, s dlam) for a right-hand side in inertial axes. turned: the rotation from the
        attitude of the factors to the present one."""
        rhs = iteration_matrix.to_vector(system, forces.rotate(turned.T), constraints)
        dq, dlam = iteration_matrix.from_vector(system, structured.solve(self.matrix, self.factors, rhs))
        return dq.rotate(turned), dlam
