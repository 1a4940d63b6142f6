"""`Observable`, one entry of a list of observables, and the energies that every list contains."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, cast

from esail_jax.array_types import Array, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.elements.thermal import ThermalEnergy
from esail_jax.numerics.small_matrices import matmul
from esail_jax.numerics.vectors import total_of
from esail_jax.observables.meanings import MEANINGS
from esail_jax.point_fields import PointFields
from esail_jax.system import System
from esail_jax.terms import Energy, find_term

WORK = "work"
"""What the observables of work of a chain need: loads or damping."""


def in_words(need: str) -> str:
    """What an observable needs, in words: a table, or a key."""
    if need == WORK:
        return "loads or damping"
    return f"`{need}`" if "." in need else f"[{need}]"


@dataclasses.dataclass(frozen=True)
class Observable:
    """One observable: its description, which run files store as attributes, and its function of an instant.

    name, unit, symbol: as in run files and figures axes: names of the axes after time equation: source of
    the formula function: the observable of an `Instant` needs: the table or the key that a scene must have
    for the observable to exist, or WORK; empty if it always exists
    """

    name: str
    unit: str
    symbol: str
    axes: tuple[str, ...]
    equation: str
    function: Callable[[Any], Array]
    needs: str = ""

    @property
    def meaning(self) -> str:
        """What it means, with the sense in which it is positive, and whether a released tether counts."""
        return MEANINGS[self.name]


def kinetic_energy(system: System, v: Coordinates, q: Coordinates | None = None) -> Scalar:
    """The kinetic energy T [J] of tethers, remote units, hub and ring ([PGV] Eq. 21, 51). q: positions,
    which matter while tethers are paid out (`System.at`)."""
    momenta = system.member_inertia(v)
    energy = 0.5 * (v.tether * momenta.tether).sum()
    if momenta.ring is not None:
        energy = energy + 0.5 * (v.ring * momenta.ring).sum()
    if system.hub is not None:
        energy = energy + 0.5 * (v.hub * matmul(system.hub.mass_matrix, v.hub)).sum()
    if system.reels is not None and q is not None:
        energy = energy + system.reels.energy_of_motion(q.tether, v.tether)
    return energy


def elastic_energy(system: System, time: Scalar, q: Coordinates) -> Scalar:
    """The elastic energy U [J] at an instant [s] ([PGV] Eq. 23)."""
    fields = system.tethers.interpolate(q.tether)
    if system.payout is not None:
        return system.at(time, q).reels.elastic_energy(q.tether)
    energies = cast(tuple[Energy, ...], system.energies)  # other terms replace them within a step only
    energy = total_of(system.integrate(term.at(time).density(fields)) for term in energies)
    return energy if system.ring is None else energy + system.ring.elastic_energy(q)


def thermal_energy(system: System, time: Scalar, q: Coordinates) -> Scalar | None:
    """The thermal energy [J] of the tethers at an instant (`elements/thermal.py`); None if they
    have no temperature."""
    term = find_term(system.energies, ThermalEnergy)
    if term is None:
        return None
    fields = system.tethers.interpolate(q.tether)
    if system.payout is None:
        return system.integrate(term.thermal_energy(time, fields))
    share = system.tethers.repeat_per_element(system.lengths(time, q).length / system.payout.total)
    material = PointFields(None, fields.r_x / share)
    return system.integrate(share * term.thermal_energy(time, material))


def shape_of(axes: tuple[str, ...], sizes: Mapping[str, int]) -> tuple[int, ...]:
    """The sizes of an observable's axes after time. sizes: by name (`Scene.sizes`); all other axes
    have three entries, but an orbit has six elements, and the spin rates are those of two bodies, the hub
    and the sail."""
    return tuple({"element": 6, "body": 2, **sizes}.get(axis, 3) for axis in axes)
