"""Structure and numbers of a scene.

`split` separates the values that decide which program is compiled (`Structure`, hashable) from the numbers
that are the program's arguments (one dictionary of arrays)."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float
from esail_jax.scenes.declarations import rule_of
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.tables import TABLES
from esail_jax.scenes.value_types import Shape

SCHEDULE = ("integrator.t_end", "integrator.step", "output.interval", "event.time", "event.release")
"""Keys that decide which instants a run computes, but not which program is compiled."""

Numbers = dict[str, Array | np.ndarray]
"""Numbers of a scene by key, such as `tethers.length`."""


@dataclasses.dataclass(frozen=True)
class Structure:
    """Structure of a scene: the values of its choices, and the keys of the numbers that it has."""

    choices: tuple[tuple[str, Any], ...]
    numbers: frozenset[str]

    def __getitem__(self, key: str) -> Any:
        return dict(self.choices)[key]

    def has(self, table: str) -> bool:
        """Tells whether the scene has this number, or any number of this table."""
        return any(key == table or key.startswith(table + ".") for key in self.numbers)


def split(scene: Scene) -> tuple[Structure, Numbers]:
    """The structure of a scene and its numbers. Numbers per tether or rod become arrays with one entry
    each."""
    choices, numbers = [], {}
    for table in TABLES:
        content = getattr(scene, table)
        for field in dataclasses.fields(content) if content is not None else ():
            key, value, rule = f"{table}.{field.name}", getattr(content, field.name), rule_of(field)
            if rule.structure:
                choices += [(key, value)] if key not in SCHEDULE else []
            elif value is not None:
                array = library_of(value)
                value = array.asarray(value, float)
                tail = {Shape.MEMBER: (), Shape.VECTORS: (3,)}.get(rule.shape)
                shape = value.shape if tail is None else (scene.members.count, *tail)
                numbers[key] = array.broadcast_to(value, shape)
    if scene.integrator.step is not None:
        step = scene.integrator.step
        numbers["integrator.step"] = library_of(step).asarray(step, float)
    if scene.event is not None:
        numbers["event.release_time"] = release_times(scene)
    return Structure(tuple(choices), frozenset(numbers)), numbers


def library_of(value: Any) -> Any:
    """Returns `jax.numpy` for a value that is or holds JAX arrays, otherwise NumPy, which compiles
    nothing."""
    return jnp if any(isinstance(x, jax.Array) for x in jax.tree.leaves(value)) else np


def release_times(scene: Scene) -> Float[np.ndarray, " tether"]:
    """Instant at which each tether is released [s], infinite if it never is."""
    times = np.full(scene.tethers.count, np.inf)
    times[np.array(scene.event.release) - 1] = scene.event.time
    return times
