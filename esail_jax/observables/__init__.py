"""Observables that a run reports: those of a sail (`sail.py`) and of a rod chain (`chain.py`)."""

from collections.abc import Iterable, Sequence

from esail_jax.array_types import Array
from esail_jax.errors import nearest
from esail_jax.observables import chain, sail
from esail_jax.observables.entry import (
    Observable,
    elastic_energy,
    in_words,
    kinetic_energy,
    shape_of,
    thermal_energy,
)
from esail_jax.observables.instant import Instant, make_instant
from esail_jax.system import System

__all__ = [
    "Instant",
    "Observable",
    "chain",
    "described",
    "elastic_energy",
    "hint_at",
    "is_chain",
    "kinetic_energy",
    "known_names",
    "listed",
    "make_instant",
    "observe",
    "sail",
    "shape_of",
    "thermal_energy",
]


def is_chain(system: System) -> bool:
    """Tells whether the system is a chain of rods."""
    return system.tethers.kind == "rod"


def listed(system: System) -> list[Observable]:
    """The observables of a system, in the order of the list."""
    return chain.listed(system) if is_chain(system) else sail.listed(system)


def known_names(of_chain: bool) -> tuple[str, ...]:
    """Names of all observables that a sail, or a chain, may have."""
    of_sail = (*sail.OBSERVABLES, *sail.ON_REQUEST)
    entries = (*chain.OBSERVABLES, chain.ENERGY_ERROR) if of_chain else of_sail
    return tuple(entry.name for entry in entries)


def hint_at(name: str, present: Iterable[str], of_chain: bool) -> str:
    """A hint, in brackets, for a name that is no observable of a run: what an observable of this
    name needs, otherwise the nearest name of those that are present; empty if there is none."""
    if name in known_names(of_chain):
        need = described(name, of_chain).needs
        return f" (only with {in_words(need)})" if need else " (saved on request, with `save`)"
    if name == "spin_rate" and not of_chain:  # the key of a scene, [initial] spin_rate
        return " (it is `angular_velocity_B[:, 0]`)"
    return nearest(name, present)


def described(name: str, of_chain: bool | None = None) -> Observable:
    """The entry of an observable, from its name. of_chain: whether it is that of a chain, or of a sail;
    None for either. Raises KeyError, with the nearest name."""
    of_sail, of_rods = (*sail.OBSERVABLES, *sail.ON_REQUEST), (*chain.OBSERVABLES, chain.ENERGY_ERROR)
    entries = (*of_sail, *of_rods) if of_chain is None else (of_rods if of_chain else of_sail)
    for entry in entries:
        if entry.name == name:
            return entry
    raise KeyError(f"{name!r} is no observable{nearest(name, (entry.name for entry in entries))}")


def observe(instant: Instant, requested: Sequence[str] = ()) -> dict[str, Array]:
    """All observables of an instant, by name. requested: names among which may be those that are
    computed on request only."""
    i = instant
    if is_chain(i.system):
        return chain.observe(
            chain.Instant(i.system.at(i.time), None, i.time, i.q, i.v, i.work, i.start_energy)
        )
    asked = [entry for entry in sail.ON_REQUEST if entry.name in requested]
    return {entry.name: entry.function(i) for entry in (*sail.listed(i.system), *asked)}
