"""Samples of a user's voltage law with a control period: sample and hold.

Sampling instants are switch times of the run (`schedule.switch_times`): the stepper is initialised again
there, so that no step contains a jump of a voltage.
"""

from typing import Any, NamedTuple

import numpy as np

from esail_jax.array_types import PerTether
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.scenes.scene import Scene
from esail_jax.steppers.stepper import Point
from esail_jax.system import System
from esail_jax.terms import find_term


class Control(NamedTuple):
    """The voltages that a sampled law holds [V], and its memory (None for a law without one)."""

    voltage: PerTether
    memory: Any


def sampled_load(system: System) -> CoulombThrust | None:
    """The load whose voltage law is sampled; None if there is none."""
    load = find_term(system.loads, CoulombThrust)
    return load if load is not None and load.sampled is not None else None


def sample(system: System, point: Point, control: Control | None) -> Control:
    """The voltages and the memory after a sample at a point on the constraints.

    control: those before the sample; None for the first sample of a run."""
    load = sampled_load(system)
    law = load.sampled if control is None else load.sampled.holding(control.voltage)
    measured = system.all_measurements(point.time, point.q, point.v)
    measured = load.with_wind(measured)._replace(voltage=law.held)
    memory = law.first_memory(measured) if control is None else control.memory
    return Control(*law.sample(measured, memory, control is None))


def hint_at_law(scene: Scene, control: Control | None, result: str) -> str:
    """A sentence for the message of a failed run if the voltages of a user's law may be the reason,
    otherwise an empty text. control: those of the last sample; result: name of a member of `RESULTS`."""
    if scene.voltage_law is None or result not in ("nonfinite", "newton_diverged", "min_step_reached"):
        return ""
    if control is None:
        return "A voltage of `voltage_law` that is not finite, or that jumps, has this effect."
    if np.isfinite(control.voltage).all():
        return ""
    return "The voltages that `voltage_law` returned at its last sample are not finite."
