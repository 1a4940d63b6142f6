"""Structure and numbers of a scene.

`split` separates the values that decide which program is compiled (`Structure`, hashable) from the numbers
that are the program's arguments (one dictionary of arrays)."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float
from esail_jax.loads.law_structure import LawStructure, divided
from esail_jax.scenes.control_period import control_period
from esail_jax.scenes.declarations import rule_of
from esail_jax.scenes.own_terms import OWN_TERMS
from esail_jax.scenes.parts import model_of, parts_of, table_names
from esail_jax.scenes.rules import Shape
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.voltage import OWN_LAW, PERIOD, period_of

SCHEDULE = (
    "integrator.t_end", "integrator.step", "output.interval", "event.time", "event.release",
    "initial.epoch",
)  # fmt: skip
"""Keys that decide which instants a run computes, or their dates, but not which program is compiled."""

CLOCK = f"{OWN_TERMS}.period"
"""Key of the control period of winch laws, where the voltage law has none."""

Numbers = dict[str, Array]
"""Numbers of a scene by key, such as `tethers.length`."""


@dataclasses.dataclass(frozen=True)
class Structure:
    """Structure of a scene: the values of its choices, and the keys of the numbers that it has."""

    choices: tuple[tuple[str, Any], ...]
    numbers: frozenset[str]

    def __getitem__(self, key: str) -> Any:
        return dict(self.choices)[key]

    @property
    def model(self) -> str:
        """What is computed: a sail, or a chain of rods."""
        return model_of([key.partition(".")[0] for key in self.numbers])

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the tables and keys of which the scene has numbers, sorted."""
        return tuple(sorted({*self.numbers, *(key.partition(".")[0] for key in self.numbers)}))

    @property
    def is_switched(self) -> bool:
        """Tells whether the stepper may start anew during a run: at the instants of a part, or at those of
        a sampled law."""
        parts = [part for part in parts_of(self.model).values() if self.has(part.name)]
        switches = any(self.has(f"{part.name}.{name}") for part in parts for name in part.switches)
        return self.is_sampled or switches or any(part.every is not None for part in parts)

    @property
    def is_sampled(self) -> bool:
        """Tells whether the scene has a user's law with a control period."""
        return any(key in (PERIOD, CLOCK) and value is not None for key, value in self.choices)

    @property
    def own_terms(self) -> tuple[LawStructure, ...]:
        """The structures of the terms that a user wrote."""
        return dict(self.choices).get(OWN_TERMS, ())

    def has(self, table: str) -> bool:
        """Tells whether the scene has this number, or any number of this table."""
        return any(key == table or key.startswith(table + ".") for key in self.numbers)


def split(scene: Scene) -> tuple[Structure, Numbers]:
    """The structure of a scene and its numbers. Numbers per tether or rod become arrays with one entry
    each."""
    choices: list[tuple[str, Any]] = []
    numbers: dict[str, Any] = {}
    for table in table_names():
        content = getattr(scene, table)
        for field in dataclasses.fields(content) if content is not None else ():
            key, value, rule = f"{table}.{field.name}", getattr(content, field.name), rule_of(field)
            if rule.structure:
                if key not in SCHEDULE:
                    choices.append((key, value))
            elif value is not None:
                tail = {Shape.MEMBER: (), Shape.VECTORS: (3,)}.get(rule.shape)
                numbers[key] = array_of(value, None if tail is None else (scene.members.count, *tail))
    if scene.integrator.step is not None:
        numbers["integrator.step"] = array_of(scene.integrator.step)
    if scene.voltage_law is not None:
        law, law_numbers = divided(scene.voltage_law)
        choices += [(OWN_LAW, law), (PERIOD, period_of(scene.voltage_law))]
        numbers |= {f"{OWN_LAW}.{i}": x for i, x in enumerate(law_numbers)}
    if isinstance(scene.terms, tuple) and scene.terms:
        parts = [divided(term) for term in scene.terms]
        choices += [(OWN_TERMS, tuple(structure for structure, _ in parts))]
        sampled = control_period(scene)
        choices += [] if sampled is None or sampled[0] == PERIOD else [(CLOCK, sampled[1])]
        for i, (_, term_numbers) in enumerate(parts):
            numbers |= {f"{OWN_TERMS}.{i}.{j}": x for j, x in enumerate(term_numbers)}
    if scene.event is not None:
        numbers["event.time"] = release_times(scene)
    # One call for all arrays of NumPy takes a third of the time of one call each.
    numbers |= jax.device_put({key: x for key, x in numbers.items() if isinstance(x, np.ndarray)})
    return Structure(tuple(choices), frozenset(numbers)), numbers


def array_of(value: Any, shape: tuple[int, ...] | None = None) -> Float[Array | np.ndarray, "*shape"]:
    """A value as an array of numbers, broadcast to a shape: an array of JAX if any number is one,
    otherwise an array of NumPy.

    NumPy compiles nothing, whereas JAX compiles a program for every shape."""
    if any(isinstance(x, jax.Array) for x in jax.tree.leaves(value)):
        value = jnp.asarray(value, float)
        return value if shape is None else jnp.broadcast_to(value, shape)
    value = np.asarray(value, float)
    return np.array(value if shape is None else np.broadcast_to(value, shape))


def release_times(scene: Scene) -> Float[np.ndarray, " tether"]:
    """Instant at which each tether is released [s], infinite if it never is."""
    times = np.full(scene.tethers.count, np.inf)
    times[np.array(scene.event.release) - 1] = scene.event.time
    return times
