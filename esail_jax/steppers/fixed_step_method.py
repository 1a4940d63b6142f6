"""What an implicit method with steps of a given size has to define: the equations of one step."""

from abc import abstractmethod
from typing import Any, ClassVar

import jax

from esail_jax.array_types import Array, Float, Rotation, Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.steppers.fixed_step_state import FrozenFactors, IterationInfo, StepState, Unknowns
from esail_jax.steppers.stepper import AbstractStepper
from esail_jax.system import Power, System

MAX_ITERATIONS = 12
"""Largest number of iterations of a step, after which the step has failed. Good steps need one or two."""


class FixedStepMethod(AbstractStepper):
    """A method with given step size [s] that finds vdot and lam of a step by simplified Newton
    iterations."""

    step_size: Scalar

    order: ClassVar[int] = 2
    most_iterations: ClassVar[int] = MAX_ITERATIONS
    trials: ClassVar[int] = 0
    """Number of trial steps at the start of a run and after an event. The end of a trial step serves only
    to improve the start (`after_trial`), from which the steps are then taken. A trial step that does not
    converge improves nothing and is the last one."""

    trusted: ClassVar[float] = 1.0
    """Largest last increment, relative to the tolerance, of an accepted step. The expected remaining error
    must be within tolerance in addition. With a value above 1 the power of a step, which is computed before
    the last correction, has an error of this size."""

    @property
    @abstractmethod
    def phase_error(self) -> Scalar:
        """The coefficient c of the phase error: an oscillation at omega loses the phase c (h omega)^3 per
        step."""

    @abstractmethod
    def factor(
        self, system: System, time: Scalar, q: Coordinates, v: Coordinates, lam: Multipliers
    ) -> FrozenFactors:
        """The factors of the iteration matrix at a state."""

    @abstractmethod
    def attitude(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, vdot: Coordinates
    ) -> Rotation:
        """The attitude to which the factors are rotated for a step."""

    @abstractmethod
    def residual(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, unknowns: Unknowns
    ) -> tuple[Any, Power]:
        """The residual of the equations of a step (`system.Residual`) and the power of its
        forces."""

    @abstractmethod
    def correct(
        self, system: System, residual: Any, factors: FrozenFactors, turned: Rotation
    ) -> tuple[Unknowns, Coordinates]:
        """The change of the unknowns in an iteration, and the corresponding change of q."""

    @abstractmethod
    def tangent(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, unknowns: Unknowns
    ) -> FrozenFactors:
        """The factors of the exact derivative of the residual, for derivatives of the run."""

    @abstractmethod
    def tolerances(self, system: System, q: Coordinates) -> Float[Array, "2"]:
        """The largest remaining errors [m] of a converged step, of tether nodes and of the hub."""

    @abstractmethod
    def step(
        self, system: System, time: Scalar, state: StepState, factors: FrozenFactors, rate: Scalar
    ) -> tuple[StepState, IterationInfo]:
        """Takes one step from `time` [s]. rate: the convergence rate of the iterations in an earlier step
        with these factors, infinite if there is none."""

    def transposable(self, system: System) -> System:
        """The system that reverse mode differentiates with respect to the state."""
        return system

    def after_trial(self, start: StepState, end: StepState) -> StepState:
        """A better start; by default the start itself. end: the state after a trial step from
        `start`."""
        return start

    def rescaled(self, state: StepState, ratio: Scalar) -> StepState:
        """The state for steps that are `ratio` times as long."""
        first = jax.tree.map(lambda x: ratio * x, state.vdot_difference)
        second = jax.tree.map(lambda x: ratio**2 * x, state.vdot_second_difference)
        return state._replace(vdot_difference=first, vdot_second_difference=second)
