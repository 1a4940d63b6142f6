"""From a scene to what a run starts with."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.elements.tether import KINDS
from esail_jax.scenes.build import Model, build
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.methods import FIXED_STEP
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import split
from esail_jax.simulation import blocks, explicit
from esail_jax.simulation.entry import problem_of
from esail_jax.simulation.programs import programs, shapes_of
from esail_jax.simulation.schedule import Plan, plan
from esail_jax.steppers.fixed_step import KEEP

UNBALANCED = 1e-6
"""Part of the tip's centrifugal force by which a steady elongation may miss its equilibrium."""


class Prepared(NamedTuple):
    """A scene ready to run.

    scene: as given; resolved: with its method; problem, carry and programs: those of `entry.py`, or of
    `explicit.py` and `blocks.py`, whose methods make their own steps and need no plan.
    """

    scene: Scene
    resolved: Scene
    problem: Any
    carry: Any
    plan: Plan | None
    programs: Any

    @property
    def collocated(self) -> bool:
        """Is it run by collocation?"""
        return self.resolved.integrator.method == "collocation"


def plan_of(resolved: Scene) -> Plan | None:
    """The plan of a scene's run; None if its method makes its own steps."""
    schedule = resolved.integrator
    if schedule.method not in FIXED_STEP:
        return None
    if resolved.chain is None:
        tethers = resolved.tethers
        coefs = KINDS[tethers.element].COEFS_PER_NODE
        unknowns = 3 * coefs * (tethers.elements + 1) * tethers.count
    else:
        unknowns = 3 * (resolved.chain.rods + 1)
    return plan(schedule.t_end, schedule.step, resolved.output.interval, unknowns, KEEP, resolved.event)


def prepare(scene: Scene) -> Prepared:
    """Compile and build a scene, and lay out its run.

    Raises SceneError if it has no steady elongation, RuntimeError in 32-bit mode.
    """
    require_64_bit()
    resolved = with_method(scene)
    structure, numbers = split(resolved)
    layout = plan_of(resolved)
    step = resolved.integrator.step
    step = None if step is None else np.asarray(step)
    if resolved.integrator.method == "collocation":
        compiled = blocks.programs(structure, shapes_of(numbers), step is not None)
        model, *started = compiled.start(numbers, step)
        check_steady(scene, model)
        return Prepared(scene, resolved, *started, None, compiled)
    if layout is None:
        compiled = explicit.programs(structure, shapes_of(numbers), step is not None)
        return Prepared(scene, resolved, *compiled.start(numbers, step), None, compiled)
    compiled = programs(structure, numbers, layout)
    model = compiled.build(numbers)
    if scene.chain is None:
        check_steady(scene, model)
    return Prepared(scene, resolved, *problem_of(numbers, model), layout, compiled)


def empty_carry(scene: Scene) -> Any:
    """Shapes of the carry of a scene's run; nothing is compiled but a choice of method."""
    resolved = with_method(scene)
    structure, numbers = split(resolved)
    if plan_of(resolved) is None:
        step = resolved.integrator.step
        step = None if step is None else np.asarray(step)
        way = blocks if resolved.integrator.method == "collocation" else explicit
        return jax.eval_shape(lambda n: way.problem_of(structure, n, step)[-1], numbers)
    return jax.eval_shape(lambda n: problem_of(n, build(structure, n))[1], numbers)


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
