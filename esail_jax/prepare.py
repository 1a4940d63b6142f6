"""From a scene to what a run starts with."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.dynamics.generalized_alpha import KEEP
from esail_jax.elements.tether import KINDS
from esail_jax.entry import Carry, Problem, problem_of
from esail_jax.programs import Programs, programs
from esail_jax.scenes.build import Model, split
from esail_jax.scenes.keys import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.schedule import Plan, plan

UNBALANCED = 1e-6
"""Part of the tip's centrifugal force by which a steady elongation may miss its equilibrium."""


class Prepared(NamedTuple):
    """A scene ready to run."""

    scene: Scene
    problem: Problem
    carry: Carry
    plan: Plan
    programs: Programs


def plan_of(scene: Scene) -> Plan:
    """The plan of a scene's run."""
    tethers, schedule = scene.tethers, scene.integrator
    unknowns = 3 * KINDS[tethers.element].COEFS_PER_NODE * (tethers.elements + 1) * tethers.count
    return plan(schedule.t_end, schedule.step, scene.output.interval, unknowns, KEEP)


def prepare(scene: Scene) -> Prepared:
    """Compile and build a scene, and lay out its run.

    Raises SceneError if it has no steady elongation, RuntimeError in 32-bit mode.
    """
    require_64_bit()
    structure, numbers = split(scene)
    layout = plan_of(scene)
    compiled = programs(structure, numbers, layout)
    model = compiled.build(numbers)
    check_steady(scene, model)
    return Prepared(scene, *problem_of(numbers, model), layout, compiled)


def require_64_bit() -> None:
    """Raise RuntimeError if JAX computes in 32 bit."""
    if not jax.config.jax_enable_x64:
        raise RuntimeError(
            "esail_jax needs 64-bit numbers (positions of 1e4 m and elongations of 1e-6 m meet in "
            "one vector), but JAX is set to 32 bit: remove `jax_enable_x64 = False`."
        )


def check_steady(scene: Scene, model: Model) -> None:
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
