"""From a scene to what a run starts with."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.constants import ASTRONOMICAL_UNIT
from esail_jax.coordinates import Coordinates
from esail_jax.dynamics.generalized_alpha import KEEP
from esail_jax.entry import Carry, Problem, fresh_state
from esail_jax.scenes.build import build, build_jitted, split
from esail_jax.scenes.keys import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.schedule import Plan, plan
from esail_jax.system import Power, System

UNBALANCED = 1e-6
"""Part of the tip's centrifugal force by which a steady elongation may miss its equilibrium."""


def starting_carry(q: Coordinates, v: Coordinates, system: System) -> Carry:
    """The carry an entry of kind "begin" takes."""
    zero = jnp.zeros(())
    nothing = Power(zero, zero)
    rest = jax.tree.map(jnp.zeros_like, q)
    state = fresh_state(q, v, rest, system.no_multipliers(), nothing, nothing)
    return Carry(state, zero, jnp.zeros((), int))


class Prepared(NamedTuple):
    """A scene ready to run."""

    scene: Scene
    problem: Problem
    carry: Carry
    plan: Plan


def prepare(scene: Scene, jit: bool = True) -> Prepared:
    """Build a scene and lay out its run. Raises SceneError if it has no steady elongation."""
    if not jax.config.jax_enable_x64:
        raise RuntimeError(
            "esail_jax needs 64-bit numbers (positions of 1e4 m and elongations of 1e-6 m meet in "
            "one vector), but JAX is set to 32 bit: remove `jax_enable_x64 = False`."
        )
    structure, numbers = split(scene)
    model = (build_jitted if jit else build)(structure, numbers)
    origin = numbers["initial.heliocentric_position_au"] * ASTRONOMICAL_UNIT
    problem = Problem(model.system, jnp.asarray(model.spectral_radius), origin)
    if jit:
        check_steady(scene, model)
    unknowns = int(np.prod(model.q.tether.shape))
    schedule = scene.integrator
    layout = plan(schedule.t_end, schedule.step, scene.output.interval, unknowns, KEEP)
    return Prepared(scene, problem, starting_carry(model.q, model.v, model.system), layout)


def check_steady(scene: Scene, model: Any) -> None:
    """Refuse a spin at which the elements have no steady stretch."""
    q, spin = model.q.tether, float(np.abs(scene.initial.spin_rate))
    lengths = model.system.tethers.element_length * model.system.tethers.elements
    mass = model.system.tethers.line_density * lengths + model.system.tethers.tip_mass
    allowed = UNBALANCED * np.asarray(mass * lengths) * spin**2 + 1e-9
    unbalanced = np.asarray(model.unbalanced)
    radial = np.asarray(jnp.linalg.norm(q[0, :, -1] - q[0, :, 0], axis=0))
    bad = ~(unbalanced <= allowed) | ~np.isfinite(radial)
    if bad.any():
        raise SceneError(
            "initial.spin_rate",
            f"leave tether {int(np.argmax(bad))} a steady elongation",
            f"is {spin}: its elements cannot hold the centrifugal force",
        )
