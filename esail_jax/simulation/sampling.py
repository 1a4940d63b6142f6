"""Samples of the laws with a control period that users write: sample and hold.

Sampling instants are switch times of the run (`schedule.switch_times`): the stepper is initialised again
there, so that no step contains a jump of a voltage or of the tension of a motor.
"""

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from esail_jax.array_types import PerTether
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.own_terms import SampledWinchLaw
from esail_jax.scenes.scene import Scene
from esail_jax.steppers.stepper import Point
from esail_jax.system import System
from esail_jax.terms import find_term


class Control(NamedTuple):
    """What sampled laws hold. voltage: of the voltage law [V], and memory, its memory; None without one.
    tensions: of the winch laws [N], in their order, and memories, their memories."""

    voltage: PerTether | None
    memory: Any
    tensions: tuple[PerTether, ...] = ()
    memories: tuple[Any, ...] = ()

    @property
    def without_memory(self) -> "Control":
        """The same without memories."""
        return self._replace(memory=None, memories=())

    def held_by(self, system: System) -> System:
        """The system whose sampled laws hold this."""
        system = system if self.voltage is None else system.holding(self.voltage)
        if not self.tensions:
            return system
        held = iter(self.tensions)
        laws = tuple(
            dataclasses.replace(law, held=next(held)) if isinstance(law, SampledWinchLaw) else law
            for law in system.winch_laws
        )
        return eqx.tree_at(lambda x: x.winch_laws, system, laws)


def sampled_load(system: System) -> CoulombThrust | None:
    """The load whose voltage law is sampled; None if there is none."""
    load = find_term(system.loads, CoulombThrust)
    return load if load is not None and load.sampled is not None else None


def sampled_winches(system: System) -> tuple[SampledWinchLaw, ...]:
    """The winch laws that are sampled."""
    return tuple(law for law in system.winch_laws if isinstance(law, SampledWinchLaw))


def is_sampled(system: System) -> bool:
    """Tells whether a system has a sampled law."""
    return sampled_load(system) is not None or bool(sampled_winches(system))


def sample(system: System, point: Point, control: Control | None) -> Control:
    """What sampled laws hold after a sample at a point on the constraints, and their memories. All laws
    measure what was held before.

    control: those before the sample; None for the first sample of a run."""
    is_first = control is None
    system = system if is_first else control.held_by(system)
    measured = system.all_measurements(point.time, point.q, point.v)
    after, load = Control(None, None), sampled_load(system)
    if load is not None:
        law, of_law = load.sampled, load.with_wind(measured)._replace(voltage=load.sampled.held)
        memory = law.first_memory(of_law) if is_first else control.memory
        after = Control(*law.sample(of_law, memory, is_first))
    laws = sampled_winches(system)
    memories = [law.first_memory(measured) for law in laws] if is_first else control.memories
    sampled = [law.sample(measured, memory) for law, memory in zip(laws, memories, strict=True)]
    if not sampled:
        return after
    tensions, memories = zip(*sampled, strict=True)
    return after._replace(tensions=tensions, memories=memories)


def hint_at_law(scene: Scene, control: Control | None, result: str) -> str:
    """A sentence for the message of a failed run if what a user's law holds may be the reason, otherwise an
    empty text. control: that of the last sample; result: name of a member of `RESULTS`."""
    if control is not None and not all(np.isfinite(x).all() for x in control.tensions):
        return "The tensions that a WinchLaw returned at its last sample are not finite."
    if scene.voltage_law is None or result not in ("nonfinite", "newton_diverged", "min_step_reached"):
        return ""
    if control is None or control.voltage is None:
        return "A voltage of `voltage_law` that is not finite, or that jumps, has this effect."
    if np.isfinite(control.voltage).all():
        return ""
    return "The voltages that `voltage_law` returned at its last sample are not finite."
