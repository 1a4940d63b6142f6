"""Choice of the method of time integration, and of its step or tolerance, where a scene leaves them out;
and the stepper of a method. No other module depends on the names of methods.

An explicit method needs about t_end * (fastest rate) / `REACH` steps, whatever accuracy is asked for,
because the axial vibrations of the rods bound its step. A chain that needs at most `MOST_EXPLICIT_STEPS` of
them is run by the eighth-order explicit method with error control: it gives ten correct digits at the cost
at which the implicit method gives four to six (`experiments/mw_rods`). A stiffer chain is run by the
implicit method, whose step follows the visible motion instead."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Maybe
from esail_jax.compilation.kept import program_of
from esail_jax.compilation.options import START_OPTIONS
from esail_jax.rod_chain import RodChain, RodState, error_scale, fastest_rate, turning_rate
from esail_jax.scenes.build import build_chain
from esail_jax.scenes.build_parts import origin_of, wind_of
from esail_jax.scenes.integration import (
    CHAIN_METHOD,
    COLLOCATION_TOLERANCE,
    METHODS,
    STIFF_CHAIN_METHOD,
    Integrator,
    method_name,
)
from esail_jax.scenes.own_terms import OWN_TERMS
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import Numbers, Structure, split
from esail_jax.scenes.voltage import OWN_LAW
from esail_jax.steppers import runge_kutta as explicit
from esail_jax.steppers.collocation import Collocation
from esail_jax.steppers.energy_momentum import EnergyMomentum
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.steppers.stepper import AbstractStepper
from esail_jax.system import System
from kept_programs.calls import call

STRAIN_FRACTION = 1e-5
"""Largest tolerance of a sail as a fraction of its tethers' strain: tension is computed from differences of
positions. Reactions are then accurate to about 1e-3 of their range up to a million times the baseline's
stiffness."""


FINEST_TOLERANCE = 1e-13
"""Smallest tolerance of a sail: positions have rounding errors of this size."""


MOST_EXPLICIT_STEPS = 1e7
"""Largest acceptable number of explicit steps: some minutes for a chain of twenty rods."""


STEPS_PER_RADIAN = 1000.0
"""Implicit steps in the time in which a rod turns by one radian, as estimated from its initial rate,
gravity and orbit. A free end snaps round about ten times faster; on [MW]'s steel chain the error is then
4e-6 m of 1.1 m."""


INSTANTS = 65
"""Instants of a run at which the rates of a chain that is paid out are evaluated."""


def rates(structure: Structure, numbers: Numbers, end: Array) -> tuple[Array, Array]:
    """Rates of a chain [rad/s]: of its fastest vibration, and at which its rods turn. The former is the
    mean over the run, until `end` [s], of a chain that is paid out: explicit steps follow it."""
    chain, start = build_chain(structure, numbers)
    first = chain.at(jnp.zeros(()))
    if chain.system.payout is None:
        return fastest_rate(first), turning_rate(first, start)
    instants = end * jnp.linspace(0.0, 1.0, INSTANTS)
    return jax.vmap(lambda t: fastest_rate(chain.at(t)))(instants).mean(), turning_rate(first, start)


def with_method(scene: Scene) -> Scene:
    """The scene with its method and all keys of [integrator] that the method needs."""
    table = scene.integrator
    if table.method is None:
        chosen = chain_method(scene) if scene.chain is not None else {"method": method_name(scene)}
        table = dataclasses.replace(table, **chosen)
    method = None if table.method is None else METHODS.get(table.method)
    if method is not None:
        missing: dict[str, Any] = {
            key: x for key, x in method.defaults.items() if getattr(table, key) is None
        }
        if table.step is not None:
            missing.pop("tolerance", None)
        if "tolerance" in missing and method.tolerance_from_strain:
            missing["tolerance"] = sail_tolerance(scene)
        table = dataclasses.replace(table, **missing)
    return dataclasses.replace(scene, integrator=table)


def sail_tolerance(scene: Scene) -> float | Array:
    """Default tolerance of a sail: COLLOCATION_TOLERANCE, or less for tethers that hardly stretch."""
    _, numbers = split(scene)
    own = (f"{OWN_LAW}.", f"{OWN_TERMS}.")
    numbers = {key: x for key, x in numbers.items() if not key.startswith(own)}
    program = program_of(tolerance_from_strain, (), (numbers,), START_OPTIONS)
    if any(isinstance(x, jax.core.Tracer) for x in numbers.values()):
        return call(program, lax.stop_gradient(numbers))
    return float(program(numbers))


def tolerance_from_strain(numbers: Numbers) -> Array:
    """Tolerance of a sail with these numbers, in the unit of `integrator.tolerance`."""
    return jnp.clip(STRAIN_FRACTION * smallest_strain(numbers), FINEST_TOLERANCE, COLLOCATION_TOLERANCE)


def smallest_strain(numbers: Numbers) -> Array:
    """Strain [-] at the root of the tether that stretches least. It is the larger of two estimates: by the
    spin, (m_u + rho A L / 2) omega^2 L / EA, and by the wind across the tether, f L / EA."""
    length, spin = numbers["tethers.length"], numbers["initial.spin_rate"]
    density, area = numbers["tethers.density"], numbers["tethers.area"]
    mass = numbers.get("remote_units.mass", 0.0) + 0.5 * density * area * length
    force = mass * spin**2 * length
    if "solar_wind.speed" in numbers:
        origin = origin_of(numbers)
        wind = wind_of(numbers, origin).at_sail(jnp.zeros(()), origin)
        voltage = numbers.get("voltage.value", jnp.zeros(length.shape))
        across = wind.thrust_per_speed(voltage) * wind.speed
        force = jnp.maximum(force, across * length)
    return (force / (numbers["tethers.youngs_modulus"] * area)).min()


def chain_method(scene: Scene) -> dict[str, str | float]:
    """Method, and step or tolerance, of a chain that names no method.

    The explicit method is taken if its steps are not too many, and wherever the implicit one cannot be:
    with bending or a given tolerance. Traced numbers have no value to choose by: the explicit method is
    taken, as it controls its own error."""
    table = scene.integrator
    by_default: dict[str, str | float] = {"method": CHAIN_METHOD}
    values = [x for part in scene.tables.values() for x in vars(part).values()]
    if any(isinstance(x, jax.core.Tracer) for x in values) or table.tolerance is not None:
        return by_default
    structure, numbers = split(scene)
    given = (numbers, jnp.asarray(table.t_end, float))
    program = program_of(rates, (structure,), given, START_OPTIONS)
    fastest, turning = (float(rate) for rate in program(*given))
    step = explicit.REACH[CHAIN_METHOD] / fastest
    too_fine = table.t_end / step > MOST_EXPLICIT_STEPS if table.step is None else table.step > step
    if not too_fine or (not METHODS[STIFF_CHAIN_METHOD].chain_bending and scene.chain.bending):
        return by_default
    implicit = {}
    if table.step is None:
        implicit["step"] = 1.0 / (STEPS_PER_RADIAN * max(turning, 1.0 / table.t_end))
    return {"method": STIFF_CHAIN_METHOD, **implicit}


def accuracy_of(table: Integrator) -> str:
    """The step or the tolerance of a resolved `[integrator]` in words, for people."""
    if table.step is not None:
        return f"step {table.step:g} s"
    return "" if table.tolerance is None else f"tolerance {table.tolerance:g}"


class Given(NamedTuple):
    """The data from which a stepper is made: the name of the method, the numbers of the scene, the model,
    and the start of a chain (None for a sail)."""

    method: str
    numbers: Numbers
    model: System | RodChain
    rods: Maybe[RodState]


def stepper_of(
    structure: Structure, numbers: Numbers, model: System | RodChain, rods: RodState | None
) -> AbstractStepper:
    """The stepper of a resolved scene (`method_choice.with_method`). rods: the start of a chain."""
    method = structure["integrator.method"]
    return STEPPERS[method](Given(method, numbers, model, rods))


def collocation(given: Given) -> AbstractStepper:
    """Collocation with a tolerance, or with a fixed step."""
    numbers = given.numbers
    tolerance = numbers.get("integrator.tolerance", jnp.asarray(COLLOCATION_TOLERANCE))
    return Collocation(numbers.get("integrator.step"), tolerance)


def generalized_alpha(given: Given) -> AbstractStepper:
    """Generalized-alpha with its step and spectral radius."""
    numbers = given.numbers
    return GeneralizedAlpha(numbers["integrator.step"], numbers["integrator.spectral_radius"])


def energy_momentum(given: Given) -> AbstractStepper:
    """The energy-momentum method with its step."""
    return EnergyMomentum(given.numbers["integrator.step"])


def runge_kutta(given: Given) -> AbstractStepper:
    """An explicit method with a tolerance and the scale of its errors, or with a fixed step."""
    numbers = given.numbers
    step = numbers.get("integrator.step")
    chain = cast(RodChain, given.model)  # these methods run chains only
    scale = error_scale(chain, given.rods) if step is None else None
    return explicit.RungeKutta(step, numbers.get("integrator.tolerance"), scale, given.method)


STEPPERS: dict[str, Callable[[Given], AbstractStepper]] = {
    "collocation": collocation,
    "generalized-alpha": generalized_alpha,
    "energy-momentum": energy_momentum,
    **dict.fromkeys(explicit.METHODS, runge_kutta),
}


def stepper_class(method: str) -> type[AbstractStepper]:
    """The class of the stepper of a method."""
    return CLASSES[method]


CLASSES: dict[str, type[AbstractStepper]] = {
    "collocation": Collocation,
    "generalized-alpha": GeneralizedAlpha,
    "energy-momentum": EnergyMomentum,
    **dict.fromkeys(explicit.METHODS, explicit.RungeKutta),
}
