"""An entry of a list of observables, and the energies that every list has."""

import dataclasses
from collections.abc import Callable
from typing import Any

from esail_jax.array_types import Array, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.numerics.small_matrices import matmul
from esail_jax.system import System


@dataclasses.dataclass(frozen=True)
class Observable:
    """One entry: what stands in the run file's attributes, and the function of an instant.

    axes: names beside time; needs: what a system must have for the entry to exist.
    """

    name: str
    unit: str
    symbol: str
    axes: tuple[str, ...]
    equation: str
    function: Callable[[Any], Array]
    needs: str = ""


def kinetic_energy(system: System, v: Coordinates) -> Scalar:
    """T [J] of tethers, remote units and hub ([PGV] Eq. 21, 51)."""
    energy = 0.5 * (v.tether * system.tethers.inertia(v.tether)).sum()
    if system.hub is not None:
        energy = energy + 0.5 * (v.hub * matmul(system.hub.mass_matrix, v.hub)).sum()
    return energy


def elastic_energy(system: System, q: Coordinates) -> Scalar:
    """U [J] ([PGV] Eq. 23)."""
    fields = system.tethers.interpolate(q.tether)
    return sum(system.integrate(term.density(fields)) for term in system.energies)


def shape_of(axes: tuple[str, ...], members: int) -> tuple[int, ...]:
    """Sizes of an observable's axes after time; members: tethers or rods."""
    sizes = {"tether": members, "rod": members, "joint": members + 1}
    return tuple(sizes.get(axis, 3) for axis in axes)
