"""The equilibrium and the spectrum of a system: by waves if the tethers are equal, otherwise as a whole."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Complex, Float, Inexact
from esail_jax.coordinates import Coordinates
from esail_jax.equilibria import motions
from esail_jax.equilibria.equilibrium import Equilibrium
from esail_jax.equilibria.sparse import Sparse, SparseMatrices
from esail_jax.equilibria.spectrum import Spectrum, dense_spectrum, sparse_spectrum
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


class Sail(NamedTuple):
    """What the vibrations of a sail depend on beside its matrices.

    The coordinates of `rigid_hub_basis` are those of one tether after the other, `of_tether` of each, with
    its auxiliary tether, and then the hub's six. tethers: number of tethers; hub, ring: whether there are
    such parts; spin: Omega [rad/s]; zeros: number of zero eigenvalues of the angle about the spin axis:
    that of the sail as a whole if hub or ring joins the tethers, otherwise that of every tether."""

    tethers: int
    of_tether: int
    hub: bool
    ring: bool
    spin: float
    zeros: int

    @property
    def joined(self) -> bool:
        """Tells whether the tethers act on each other."""
        return self.hub or self.ring

    @property
    def all_zeros(self) -> int:
        """The number of zero eigenvalues of the whole sail."""
        return self.zeros if self.joined else self.zeros * self.tethers

    def group(self, motion: Complex[Host, "n mode"]) -> Group:
        """Motions of all tethers as a group."""
        size = self.of_tether * self.tethers
        local = motion[:size].reshape(self.tethers, self.of_tether, -1).transpose(1, 0, 2)
        return Group(None, local, motion[size:] if self.hub else np.zeros((6, local.shape[2])))


def sail_of(system: System, basis: Sparse, spin: float) -> Sail:
    """The sail of a system whose `rigid_hub_basis` is given."""
    tethers, hub, ring = system.tethers.count, system.hub is not None, system.ring is not None
    size = basis.shape[1] - 6 if hub else basis.shape[1]
    # An angle that no force opposes has two zero eigenvalues. Clamped roots hold it in a turning frame.
    held = system.clamped and not hub
    return Sail(tethers, size // tethers, hub, ring, spin, 0 if held else 2)


def solve(
    system: System, start: Coordinates, axes: Float[Host, "3 3"], spin: float, count: int | None
) -> Solved:
    """The equilibrium that spins at `spin` [rad/s] about the first of `axes`, and its vibrations.

    start: coordinates from which it is looked for. count: least number of vibrations, None for all."""
    equilibrium, matrices, y = steady_state(system, start, jnp.asarray(axes[:, 0] * spin))
    basis = motions.rigid_hub_basis(system, y, axes)
    sail = sail_of(system, basis, spin)
    steady = from_centre(basis, y, system, axes)[: sail.of_tether * sail.tethers]
    places = places_of(system, steady.reshape(sail.tethers, sail.of_tether).T)
    tip = np.einsum("i,it->t", np.array([1.0, 0.0, 0.0]), places.axes[0])
    groups: list[Motions] = []
    at_rest, complete = 0, True
    if bool(equilibrium.converged):
        reduced = [(basis.T @ a @ basis).tocsc() for a in matrices[:3]]
        conditions = motions.conditions(system, matrices)
        if motions.tethers_are_equal(reduced, sail.tethers, sail.hub):
            groups, at_rest = by_waves(reduced, conditions @ basis, sail)
        elif 2 * basis.shape[1] <= DENSE_STATES:
            groups, at_rest = all_at_once(reduced, conditions @ basis, sail)
        else:
            groups, at_rest = lowest(matrices, basis, conditions, sail, count or LOWEST)
            complete = False
    acceleration = float(np.asarray(equilibrium.frame.acceleration) @ axes[:, 0])
    return Solved(
        system=system,
        at=equilibrium,
        groups=groups,
        places=places,
        coning_angle=np.arcsin(tip),
        acceleration=acceleration,
        spin=spin,
        hub=sail.hub,
        at_rest=at_rest,
        complete=complete,
    )


def from_centre(basis: Sparse, y: Host, system: System, axes: Host) -> Host:
    """The coordinates of y in the axes of the tethers, from the hub's centre, less its position."""
    if system.hub is None:
        return basis.T @ y
    from esail_jax.equilibria.couplings import indices
    from esail_jax.equilibria.steady_state import translations

    hub = y[indices(system).hub].reshape(4, 3)
    return basis.T @ (y - translations(system) @ (0.5 * (hub[0] + hub[1])))


class Wave(NamedTuple):
    """The motions of one wave number. mass: the mass matrix in the spectrum's coordinates; local, hub: the
    motions of tether 1 and of the hub."""

    spectrum: Spectrum
    mass: Inexact[Host, "m m"]
    local: Complex[Host, "coordinate tether mode"]
    hub: Complex[Host, "6 mode"]


def by_waves(reduced: list[Sparse], conditions: Sparse, sail: Sail) -> tuple[list[Motions], int]:
    """The vibrations of equal tethers, and the number of zero eigenvalues."""
    groups: list[Motions] = []
    at_rest = 0
    uncoupled: Wave | None = None
    for n in range(sail.tethers // 2 + 1):
        standing = n == 0 or 2 * n == sail.tethers
        with_hub = sail.hub and (n in (0, 1) or sail.tethers <= 2)
        coupled = with_hub or sail.ring
        if coupled:
            wave = wave_of(n, reduced, conditions, sail, with_hub)
        else:
            # Without a ring, tethers on a resting hub do not act on each other: one wave stands for all.
            if uncoupled is None:
                uncoupled = wave_of(n, reduced, conditions, sail, with_hub)
            wave = uncoupled
        # The sail turns about its axis in the wave of n = 0; tethers that are not joined do in every wave.
        zeros = sail.zeros if n == 0 or not sail.joined else 0
        spectrum = wave.spectrum
        kept, zero = vibrations(
            spectrum.eigenvalue, spectrum.motion, wave.mass, sail.spin, not standing, zeros
        )
        # A zero of a travelling wave is one of the opposite number, too.
        at_rest += zero if standing else 2 * zero
        groups.append(Motions(kept, Group(n, wave.local, wave.hub)))
    return groups, at_rest


def wave_of(n: int, reduced: list[Sparse], conditions: Sparse, sail: Sail, with_hub: bool) -> Wave:
    """The motions of the wave of number n. with_hub: whether the hub moves in it."""
    wave = motions.waves(sail.tethers, sail.of_tether, sail.hub, n)
    # A wave with n = 0 or n = p / 2 is real, and so are the matrices if the hub rests.
    wave = wave.real if n == 0 or 2 * n == sail.tethers else wave
    blocks = [(wave.conj().T @ a @ wave).toarray() for a in reduced]
    free = motions.allowed((conditions @ wave).toarray())
    blocks = [free.conj().T @ a @ free for a in blocks]
    if not (with_hub or sail.ring):
        blocks = [a.real for a in blocks]
    spectrum = dense_spectrum(*blocks, spin=sail.spin)
    motion = wave @ (free @ spectrum.motion)
    local = motion[: sail.of_tether, None]
    hub = motion[sail.of_tether * sail.tethers :] if with_hub else np.zeros((6, local.shape[2]))
    return Wave(spectrum, blocks[0], local, hub)


def all_at_once(reduced: list[Sparse], conditions: Sparse, sail: Sail) -> tuple[list[Motions], int]:
    """The vibrations of unequal tethers, and the number of zero eigenvalues."""
    free = motions.allowed(conditions.toarray())
    blocks = [free.T @ (a @ free) for a in reduced]
    spectrum = dense_spectrum(*blocks, spin=sail.spin)
    kept, at_rest = vibrations(
        spectrum.eigenvalue, spectrum.motion, blocks[0], sail.spin, False, sail.all_zeros
    )
    return [Motions(kept, sail.group(free @ spectrum.motion))], at_rest


def lowest(
    matrices: SparseMatrices, basis: Sparse, conditions: Sparse, sail: Sail, count: int
) -> tuple[list[Motions], int]:
    """The lowest vibrations of unequal tethers, `count` or more, and the number of zero eigenvalues among
    them."""
    spectrum, radius = sparse_spectrum(*matrices[:3], conditions, sail.spin, count)
    inside = np.abs(spectrum.eigenvalue) <= radius
    values, motion = spectrum.eigenvalue[inside], spectrum.motion[:, inside]
    kept, at_rest = vibrations(values, motion, matrices.mass, sail.spin, False, sail.all_zeros)
    coordinates = basis.T @ motion
    if sail.hub:
        rigid = basis[:, -6:].toarray()
        coordinates[-6:] = np.linalg.lstsq(rigid, motion, rcond=None)[0]
    return [Motions(kept, sail.group(coordinates))], at_rest
