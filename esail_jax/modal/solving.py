"""The equilibrium and the spectrum of a system: by waves if the tethers are equal, otherwise as a whole."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Complex, Float
from esail_jax.coordinates import Coordinates
from esail_jax.equilibria import motions
from esail_jax.equilibria.equilibrium import Equilibrium
from esail_jax.equilibria.sparse import Sparse, SparseMatrices
from esail_jax.equilibria.spectrum import dense_spectrum, sparse_spectrum
from esail_jax.equilibria.steady_state import steady_state
from esail_jax.modal.selection import Vibration, vibrations
from esail_jax.modal.shapes import Places, places_of
from esail_jax.modal.table import Group
from esail_jax.system import System

Host = np.ndarray

DENSE_STATES = 1000
"""Largest number of states for which all modes of unequal tethers are computed at once; above it only the
lowest ones are."""

LOWEST = 100
"""Number of modes of a larger sail with unequal tethers."""


class Motions(NamedTuple):
    """Vibrations that were found together, with their shapes."""

    vibrations: list[Vibration]
    shapes: Group


class Solved(NamedTuple):
    """An equilibrium and the vibrations about it.

    hub: whether there is one; at_rest: number of zero eigenvalues left out; complete: whether these are all
    modes of the discrete sail, rather than the lowest ones."""

    system: System
    at: Equilibrium
    groups: list[Motions]
    places: Places
    coning_angle: Float[Host, " tether"]
    acceleration: float
    spin: float
    hub: bool
    at_rest: int
    complete: bool


def solve(
    system: System, start: Coordinates, axes: Float[Host, "3 3"], spin: float, count: int | None
) -> Solved:
    """The equilibrium that spins at `spin` [rad/s] about the first of `axes`, and its vibrations.

    start: coordinates from which it is looked for. count: least number of vibrations, None for all."""
    at, matrices, y = steady_state(system, start, jnp.asarray(axes[:, 0] * spin))
    tethers, hub = system.tethers.count, system.hub is not None
    basis = motions.rigid_hub_basis(system, y, axes)
    own = (basis.shape[1] - 6 * hub) // tethers
    steady = from_centre(basis, y, system, axes)[: own * tethers].reshape(tethers, own).T
    places = places_of(system, steady)
    tip = np.einsum("i,it->t", np.array([1.0, 0.0, 0.0]), places.axes[0])
    groups: list[Motions] = []
    at_rest, complete = 0, True
    if bool(at.converged):
        reduced = [(basis.T @ a @ basis).tocsc() for a in matrices[:3]]
        conditions = motions.conditions(system, matrices)
        # Zero eigenvalues: two of the spin angle; without hub and ring two of each pinned tether's angle.
        each = 0 if system.clamped and not hub else 2
        coupled = hub or system.ring is not None
        every = each if coupled else each * tethers
        if motions.tethers_are_equal(reduced, tethers, hub):
            joined = system.ring is not None
            groups, at_rest = by_waves(reduced, conditions @ basis, tethers, own, hub, joined, spin, each)
        elif 2 * basis.shape[1] <= DENSE_STATES:
            groups, at_rest = all_at_once(reduced, conditions @ basis, tethers, own, hub, spin, every)
        else:
            groups, at_rest = lowest(
                matrices, basis, conditions, tethers, own, hub, spin, every, count or LOWEST
            )
            complete = False
    acceleration = float(np.asarray(at.frame.acceleration) @ axes[:, 0])
    return Solved(system, at, groups, places, np.arcsin(tip), acceleration, spin, hub, at_rest, complete)


def from_centre(basis: Sparse, y: Host, system: System, axes: Host) -> Host:
    """The coordinates of y in the axes of the tethers, from the hub's centre, less its position."""
    if system.hub is None:
        return basis.T @ y
    from esail_jax.equilibria.couplings import indices
    from esail_jax.equilibria.steady_state import translations

    hub = y[indices(system).hub].reshape(4, 3)
    return basis.T @ (y - translations(system) @ (0.5 * (hub[0] + hub[1])))


def by_waves(
    reduced: list[Sparse],
    conditions: Sparse,
    count: int,
    own: int,
    hub: bool,
    ring: bool,
    spin: float,
    neutral: int,
) -> tuple[list[Motions], int]:
    """The vibrations of equal tethers, and the number of zero eigenvalues.

    count: number of tethers; own: number of coordinates of each, with its segment of the ring; neutral:
    number of zero eigenvalues of a wave, with a hub or a ring of n = 0 only."""
    groups: list[Motions] = []
    at_rest, alone = 0, None
    for n in range(count // 2 + 1):
        standing = n == 0 or 2 * n == count
        with_hub = hub and (n in (0, 1) or count <= 2)
        coupled = with_hub or ring
        if coupled or alone is None:
            # A wave with n = 0 or n = p / 2 is real, and so are the matrices if the hub rests.
            wave = motions.waves(count, own, hub, n)
            wave = wave.real if standing else wave
            blocks = [(wave.conj().T @ a @ wave).toarray() for a in reduced]
            free = motions.allowed((conditions @ wave).toarray())
            blocks = [free.conj().T @ a @ free for a in blocks]
            if not coupled:
                blocks = [a.real for a in blocks]
            spectrum = dense_spectrum(*blocks, spin=spin)
            motion = wave @ (free @ spectrum.motion)
            local = motion[:own, None]
            six = motion[own * count :] if with_hub else np.zeros((6, local.shape[2]))
            solved = (spectrum, blocks[0], local, six)
            alone = None if coupled else solved
        else:
            solved = alone  # without a ring, tethers on a resting hub do not act on each other
        spectrum, mass, local, six = solved
        found, zero = vibrations(
            spectrum.eigenvalue,
            spectrum.motion,
            mass,
            spin,
            not standing,
            neutral if n == 0 or not (hub or ring) else 0,
        )
        # A zero of a travelling wave is one of the opposite number, too.
        at_rest += zero * (1 if standing else 2)
        groups.append(Motions(found, Group(n, local, six)))
    return groups, at_rest


def all_at_once(
    reduced: list[Sparse],
    conditions: Sparse,
    count: int,
    own: int,
    hub: bool,
    spin: float,
    neutral: int,
) -> tuple[list[Motions], int]:
    """The vibrations of unequal tethers, and the number of zero eigenvalues."""
    free = motions.allowed(conditions.toarray())
    blocks = [free.T @ (a @ free) for a in reduced]
    spectrum = dense_spectrum(*blocks, spin=spin)
    found, at_rest = vibrations(spectrum.eigenvalue, spectrum.motion, blocks[0], spin, False, neutral)
    return [Motions(found, of_all_tethers(free @ spectrum.motion, count, own, hub))], at_rest


def lowest(
    matrices: SparseMatrices,
    basis: Sparse,
    conditions: Sparse,
    count: int,
    own: int,
    hub: bool,
    spin: float,
    neutral: int,
    number: int,
) -> tuple[list[Motions], int]:
    """The lowest vibrations of unequal tethers, and the number of zero eigenvalues among them."""
    spectrum, radius = sparse_spectrum(*matrices[:3], conditions, spin, number)
    keep = np.abs(spectrum.eigenvalue) <= radius
    values, motion = spectrum.eigenvalue[keep], spectrum.motion[:, keep]
    found, at_rest = vibrations(values, motion, matrices.mass, spin, False, neutral)
    coordinates = basis.T @ motion
    if hub:
        rigid = basis[:, -6:].toarray()
        coordinates[-6:] = np.linalg.lstsq(rigid, motion, rcond=None)[0]
    return [Motions(found, of_all_tethers(coordinates, count, own, hub))], at_rest


def of_all_tethers(coordinates: Complex[Host, "n mode"], count: int, own: int, hub: bool) -> Group:
    """motions, in the coordinates of `rigid_hub_basis`, as a group."""
    local = coordinates[: own * count].reshape(count, own, -1).transpose(1, 0, 2)
    return Group(None, local, coordinates[own * count :] if hub else np.zeros((6, local.shape[2])))
