"""Which method runs a chain that does not name one, with which step or tolerance.

An explicit method needs about t_end * (fastest rate) / (reach of the method) steps, whatever accuracy
is asked for: the rods' axial vibrations set them. Below `MOST_STEPS` of them the eighth-order method
with error control is the cheapest at any useful accuracy (`experiments/mw_rods`); above, the implicit
method, whose step follows the motion one sees instead.
"""

import dataclasses

import jax
import numpy as np

from esail_jax.dynamics.rod_chain import fastest_rate
from esail_jax.dynamics.runge_kutta import REACH
from esail_jax.scenes.build import build_chain, split
from esail_jax.scenes.scene import Scene

EXPLICIT = "dopri8"
"""The explicit method of choice."""

TOLERANCE = 1e-9
"""Relative local error: tip positions of the built-in chains to ten digits."""

MOST_STEPS = 1e6
"""Explicit steps that are acceptable: some ten seconds for a chain of twenty rods."""

STEPS_PER_RADIAN = 100.0
"""Implicit steps in the time a rod takes to turn by one radian."""

fastest = jax.jit(
    lambda structure, numbers: fastest_rate(build_chain(structure, numbers)[0]), static_argnums=0
)


def with_method(scene: Scene) -> Scene:
    """The scene with every entry of [integrator] that its run needs."""
    table = scene.integrator
    if table.method is None:
        table = dataclasses.replace(table, **choice(scene))
    elif table.method != "generalized-alpha" and table.step is None and table.tolerance is None:
        table = dataclasses.replace(table, tolerance=TOLERANCE)
    return dataclasses.replace(scene, integrator=table)


def choice(scene: Scene) -> dict[str, str | float]:
    """Method and step or tolerance for a chain. Numbers under a trace have no value to choose by:
    then the explicit method, which controls its own error."""
    table = scene.integrator
    explicit: dict[str, str | float] = {"method": EXPLICIT}
    if table.step is None and table.tolerance is None:
        explicit["tolerance"] = TOLERANCE
    parts = (scene.chain, scene.initial, scene.gravity, scene.orbit)
    numbers = [x for part in parts if part is not None for x in vars(part).values()]
    if any(isinstance(x, jax.core.Tracer) for x in numbers) or table.tolerance is not None:
        return explicit
    step = REACH[EXPLICIT] / float(fastest(*split(scene)))
    too_fine = table.t_end / step > MOST_STEPS if table.step is None else table.step > step
    if not too_fine or scene.chain.bending:
        return explicit
    implicit = {"step": 1.0 / (STEPS_PER_RADIAN * turning_rate(scene))} if table.step is None else {}
    return {"method": "generalized-alpha", "spectral_radius": 0.25, **implicit}


def turning_rate(scene: Scene) -> float:
    """Estimate [rad/s] of how fast rods turn: from their initial rates, under gravity over their own
    length, and with the orbit; at least once over the run."""
    length = np.asarray(scene.chain.length)
    rates = [1.0 / scene.integrator.t_end]
    rates.append(np.max(np.linalg.norm(np.atleast_2d(scene.initial.rod_rate), axis=-1) / length))
    if scene.gravity is not None:
        rates.append(np.sqrt(np.max(np.linalg.norm(scene.gravity.acceleration) / length)))
    if scene.orbit is not None:
        rates.append(2.0 * float(scene.orbit.mean_motion))
    return float(max(rates))
