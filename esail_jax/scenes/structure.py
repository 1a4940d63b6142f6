"""What of a scene is compiled, and what are numbers.

`split` separates what decides the compiled program (`Structure`, hashable) from the numbers (one
dictionary of arrays)."""

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, PerTether
from esail_jax.scenes.rules import rule_of
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.tables import TABLES

SCHEDULE = ("integrator.t_end", "integrator.step", "output.interval", "event.time", "event.release")
"""Structure of the run, not of the compiled program."""

Numbers = dict[str, Array]


@dataclasses.dataclass(frozen=True)
class Structure:
    """What is compiled: the choices of a scene, and which numbers it has."""

    choices: tuple[tuple[str, Any], ...]
    numbers: frozenset[str]

    def __getitem__(self, key: str) -> Any:
        return dict(self.choices)[key]

    def has(self, table: str) -> bool:
        """Is any number of this table, or this very key, there?"""
        return any(key == table or key.startswith(table + ".") for key in self.numbers)


def split(scene: Scene) -> tuple[Structure, Numbers]:
    """The scene's structure and its numbers; those per tether or rod as arrays, one for each."""
    choices, numbers = [], {}
    for table in TABLES:
        content = getattr(scene, table)
        for field in dataclasses.fields(content) if content is not None else ():
            key, value, rule = f"{table}.{field.name}", getattr(content, field.name), rule_of(field)
            if rule.structure:
                choices += [(key, value)] if key not in SCHEDULE else []
            elif value is not None:
                value = jnp.asarray(value, float)
                tail = {"member": (), "vectors": (3,)}.get(rule.shape)
                shape = value.shape if tail is None else (scene.members.count, *tail)
                numbers[key] = jnp.broadcast_to(value, shape)
    if scene.integrator.step is not None:
        numbers["integrator.step"] = jnp.asarray(scene.integrator.step, float)
    if scene.event is not None:
        numbers["event.release_time"] = release_times(scene)
    return Structure(tuple(choices), frozenset(numbers)), numbers


def release_times(scene: Scene) -> PerTether:
    """When each tether is let go [s], infinite if never."""
    times = np.full(scene.tethers.count, np.inf)
    times[np.array(scene.event.release) - 1] = scene.event.time
    return jnp.asarray(times)
