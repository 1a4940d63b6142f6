"""The stepper of a scene, chosen by the name of its method. No other module depends on the name."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp

from esail_jax.rod_chain import RodChain, RodState, error_scale
from esail_jax.scenes.method_choice import COLLOCATION_TOLERANCE
from esail_jax.scenes.structure import Numbers, Structure
from esail_jax.steppers.collocation import Collocation
from esail_jax.steppers.energy_momentum import EnergyMomentum
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.steppers.runge_kutta import METHODS, RungeKutta
from esail_jax.steppers.stepper import AbstractStepper
from esail_jax.system import System


class Given(NamedTuple):
    """The data from which a stepper is made: the name of the method, the numbers of the scene, the model,
    and the start of a chain (None for a sail)."""

    method: str
    numbers: Numbers
    model: System | RodChain
    rods: RodState | None


def stepper_of(
    structure: Structure, numbers: Numbers, model: System | RodChain, rods: RodState | None
) -> AbstractStepper:
    """Returns the stepper of a resolved scene (`method_choice.with_method`). rods: the start of a chain."""
    method = structure["integrator.method"]
    return STEPPERS[method](Given(method, numbers, model, rods))


def collocation(given: Given) -> AbstractStepper:
    n = given.numbers
    tolerance = n.get("integrator.tolerance", jnp.asarray(COLLOCATION_TOLERANCE))
    return Collocation(n.get("integrator.step"), tolerance)


def generalized_alpha(given: Given) -> AbstractStepper:
    n = given.numbers
    return GeneralizedAlpha(n["integrator.step"], n["integrator.spectral_radius"])


def energy_momentum(given: Given) -> AbstractStepper:
    return EnergyMomentum(given.numbers["integrator.step"])


def runge_kutta(given: Given) -> AbstractStepper:
    n = given.numbers
    step = n.get("integrator.step")
    scale = error_scale(given.model, given.rods) if step is None else None
    return RungeKutta(step, n.get("integrator.tolerance"), scale, given.method)


STEPPERS: dict[str, Callable[[Given], AbstractStepper]] = {
    "collocation": collocation,
    "generalized-alpha": generalized_alpha,
    "energy-momentum": energy_momentum,
    **dict.fromkeys(METHODS, runge_kutta),
}


def stepper_class(method: str) -> type[AbstractStepper]:
    """Returns the class of the stepper of a method."""
    return CLASSES[method]


CLASSES: dict[str, type[AbstractStepper]] = {
    "collocation": Collocation,
    "generalized-alpha": GeneralizedAlpha,
    "energy-momentum": EnergyMomentum,
    **dict.fromkeys(METHODS, RungeKutta),
}
