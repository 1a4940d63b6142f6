"""Which step or tolerance a method gets, and which method runs a chain that does not name one.

An explicit method needs about t_end * (fastest rate) / (reach of the method) steps, whatever accuracy
is asked for: the rods' axial vibrations set them. Below `MOST_STEPS` of them the eighth-order method
with error control is taken: it gives ten digits for the price at which the implicit one gives four to
six (`experiments/mw_rods`). Above, the implicit method, whose step follows the motion one sees instead.
"""

import dataclasses
import functools

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array
from esail_jax.rod_chain import fastest_rate, turning_rate
from esail_jax.scenes.build import build_chain
from esail_jax.scenes.build_loads import wind_of
from esail_jax.scenes.consistency import FIXED_STEP, method_of
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import Numbers, Structure, split
from esail_jax.steppers.runge_kutta import REACH

PAPER = {"step": 0.1, "spectral_radius": 0.25}
"""Generalized-alpha in [PGV] Sec. 4."""

EXPLICIT = "dopri8"
"""The explicit method of choice."""

TOLERANCE = 1e-9
"""Relative local error: tip positions of the built-in chains to nine digits or more."""

COLLOCATION_TOLERANCE = 5e-10
"""Local error of a sail's positions relative to its tethers: every observable of the built-in scenes to
1e-3 of its range with a margin, and the energy of a free sail to less than 1e-9."""

STRAIN_SHARE = 1e-5
"""Part of the tethers' strain that it is at most: their tension is a difference of positions. With it
reactions stay right to some 1e-3 of their range up to a million times the baseline's stiffness."""

FINEST_TOLERANCE = 1e-13
"""What rounding leaves of positions."""

MOST_STEPS = 1e7
"""Explicit steps that are acceptable: some minutes for a chain of twenty rods."""

STEPS_PER_RADIAN = 1000.0
"""Implicit steps in the time a rod takes to turn by one radian, as far as its start, gravity and orbit
tell. A free end snaps round some ten times faster: on [MW]'s steel chain this leaves 4e-6 m of 1.1 m."""


@functools.partial(jax.jit, static_argnums=0)
def rates(structure: Structure, numbers: Numbers) -> tuple[Array, Array]:
    """Fastest vibration [rad/s], and how fast rods turn."""
    chain, start = build_chain(structure, numbers)
    return fastest_rate(chain), turning_rate(chain, start)


def with_method(scene: Scene) -> Scene:
    """The scene with every entry of [integrator] that its run needs."""
    table = scene.integrator
    if table.method is None:
        found = choice(scene) if scene.chain is not None else {"method": method_of(scene)}
        table = dataclasses.replace(table, **found)
    if table.method == "generalized-alpha":
        given = {name: x for name, x in vars(table).items() if x is not None}
        table = dataclasses.replace(table, **(PAPER | given))
    elif table.method in FIXED_STEP:
        step = PAPER["step"] if table.step is None else table.step
        table = dataclasses.replace(table, step=step)
    elif table.step is None and table.tolerance is None:
        tolerance = TOLERANCE if table.method in REACH else sail_tolerance(scene)
        table = dataclasses.replace(table, tolerance=tolerance)
    return dataclasses.replace(scene, integrator=table)


def sail_tolerance(scene: Scene) -> float | Array:
    """That of a sail: less than COLLOCATION_TOLERANCE for tethers that hardly stretch."""
    _, numbers = split(scene)
    share = lax.stop_gradient(STRAIN_SHARE * smallest_strain(numbers))
    tolerance = jnp.clip(share, FINEST_TOLERANCE, COLLOCATION_TOLERANCE)
    return tolerance if isinstance(tolerance, jax.core.Tracer) else float(tolerance)


@jax.jit
def smallest_strain(n: Numbers) -> Array:
    """Of the roots [-], (m_u + rho A L / 2) omega^2 L / EA by the spin or f L / EA across the wind, what
    is larger, of the tether that stretches least."""
    length, spin = n["tethers.length"], n["initial.spin_rate"]
    mass = n.get("remote_units.mass", 0.0) + 0.5 * n["tethers.density"] * n["tethers.area"] * length
    force = mass * spin**2 * length
    if "solar_wind.speed" in n:
        wind = wind_of(n, jnp.zeros(3)).at(jnp.zeros(()))
        voltage = n.get("voltage.value", jnp.zeros(length.shape))
        across = wind.thrust_per_speed(voltage) * wind.speed
        force = jnp.maximum(force, across * length)
    return (force / (n["tethers.youngs_modulus"] * n["tethers.area"])).min()


def choice(scene: Scene) -> dict[str, str | float]:
    """Method and step or tolerance for a chain. Numbers under a trace have no value to choose by:
    then the explicit method, which controls its own error."""
    table = scene.integrator
    explicit: dict[str, str | float] = {"method": EXPLICIT}
    if table.step is None and table.tolerance is None:
        explicit["tolerance"] = TOLERANCE
    numbers = [x for part in vars(scene).values() if part is not None for x in vars(part).values()]
    if any(isinstance(x, jax.core.Tracer) for x in numbers) or table.tolerance is not None:
        return explicit
    fastest, turning = (float(rate) for rate in rates(*split(scene)))
    step = REACH[EXPLICIT] / fastest
    too_fine = table.t_end / step > MOST_STEPS if table.step is None else table.step > step
    if not too_fine or scene.chain.bending:
        return explicit
    implicit = {}
    if table.step is None:
        implicit["step"] = 1.0 / (STEPS_PER_RADIAN * max(turning, 1.0 / table.t_end))
    return {"method": "generalized-alpha", **implicit}
