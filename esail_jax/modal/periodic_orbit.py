"""The relative periodic orbit of a sail at a sailing angle, by Newton's method on the map of a turn.

The unknowns are the state z, the duration T, the precession Delta, and two drifts, a and b:

    F(z, T, Delta) - z = a e_tilt + b e_spin,        H(z) = H_0,        (phase of z) = (that of the start)

e_tilt turns the sail's spin axis away from the wind, e_spin makes it spin faster. The angular momentum H
keeps its start value, because a sail with any sailing angle and any spin has a motion of this kind. If a
and b are zero, the motion repeats itself for ever. If not, sailing angle and spin drift by so much in a
turn, and the motion found is the one that repeats itself apart from this drift.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Float
from esail_jax.compilation.kept import program_of
from esail_jax.compilation.options import START_OPTIONS
from esail_jax.modal.turn_map import Local, local, settled, turn_map
from esail_jax.system import System

Host = np.ndarray

TOGETHER = 32
"""Number of directions whose derivatives are computed by one call."""

MAX_ITERATIONS = 20
"""Largest number of Newton steps."""

LONGEST_STEP = 2e-3
"""Largest displacement in a Newton step, relative to the largest coordinate. After a longer one the time
steps, whose length is given, may not converge."""

CONVERGED = 1e-9
"""A Newton step is small if it is at most this part of the largest coordinate."""

FACING = 1e-6
"""Sine of the sailing angle below which the sail faces the wind: it has no precession."""


class Setting(NamedTuple):
    """A sail and the map whose fixed point is looked for.

    system: with its loads; spin: |Omega| [rad/s]; wind: unit vector; steps: number of time steps of the
    map; places: by how many places tethers are renumbered (0: the map is that of a whole turn); parts:
    number of maps in a turn."""

    system: System
    spin: float
    wind: Float[Host, "3"]
    steps: int
    places: int
    parts: int


class Image(NamedTuple):
    """The image of a state as NumPy arrays: `Turn`, with the derivatives as columns."""

    state: Float[Host, " m"]
    rate: Float[Host, " m"]
    changes: Float[Host, "m direction"]


class Orbit(NamedTuple):
    """A motion that repeats itself after every map, but for its precession and its drifts.

    state: z; duration: T [s]; precession: Delta [rad]; tilt: drift a of the sailing angle [rad]; spin:
    drift b of the spin, relative; left: largest part of F - z that is neither, relative to the largest
    coordinate; tangents: basis of the changes of the state, one a column; map: derivative of F in this
    basis; neutral: the state's changes by a turn about the spin axis and by a faster spin; sailing_angle:
    between wind and angular momentum [rad]; converged."""

    state: Float[Host, " m"]
    duration: float
    precession: float
    tilt: float
    spin: float
    left: float
    tangents: Float[Host, "m n"]
    map: Float[Host, "n n"]
    neutral: Float[Host, "m 2"]
    sailing_angle: float
    converged: bool


def periodic_orbit(setting: Setting, start: Float[Host, " m"]) -> Orbit:
    """The relative periodic orbit nearest to a state, which need not lie on the constraints.

    Nothing is raised: `converged` is false if no orbit was found."""
    system, size = setting.system, len(start) // 2
    z = run(settled, system, setting.spin, jnp.asarray(start))
    first, duration, precession = z, 2.0 * np.pi / (setting.spin * setting.parts), 0.0
    held: Local = run(local, system, setting.spin, jnp.asarray(z))
    wanted = held.momentum
    for _ in range(MAX_ITERATIONS):
        tangents = np.linalg.qr(held.conditions.T, mode="complete")[0][:, len(held.conditions) :]
        image, rate, changes = mapped(setting, z, duration, precession, tangents)
        matrix = tangents.T @ changes
        axis = np.asarray(held.momentum / np.linalg.norm(held.momentum))
        across = np.cross(setting.wind, axis)
        facing = bool(np.linalg.norm(across) < FACING)
        across = held_axis(axis) if facing else across / np.linalg.norm(across)
        turning = np.cross(axis, across) if facing else setting.wind
        turn, spin = axis @ held.turns, axis @ held.spins
        free = np.stack([rate / setting.spin, -turning @ held.turns, -across @ held.turns, -spin])
        phase = np.concatenate([turn[:size], np.zeros(size)]) / np.linalg.norm(turn[:size])
        length = np.abs(z).max()
        slopes = held.slopes * (length / np.linalg.norm(wanted))
        identity = np.eye(len(matrix))
        rows = np.vstack([slopes, phase]) @ tangents
        bordered = np.block([[matrix - identity, tangents.T @ free.T], [rows, np.zeros((4, 4))]])
        gap = tangents.T @ (image - z)
        change = (wanted - held.momentum) * (length / np.linalg.norm(wanted))
        right = np.concatenate([-gap, change, [phase @ (first - z)]])
        if not (np.isfinite(bordered).all() and np.isfinite(right).all()):
            return unknown(setting, z, tangents)
        step = np.linalg.solve(bordered, right)
        tilt, faster = step[-2:]
        drift = free[2:].T @ step[-2:]
        left = np.abs(gap + tangents.T @ drift).max() / length
        moved = np.abs(step[:-4]).max() / length
        converged = bool(moved <= CONVERGED)
        sailing = float(np.arctan2(np.linalg.norm(np.cross(setting.wind, axis)), setting.wind @ axis))
        if converged:
            break
        share = min(1.0, LONGEST_STEP / moved)
        z = run(settled, system, setting.spin, jnp.asarray(z + share * (tangents @ step[:-4])))
        duration += share * step[-4] / setting.spin
        precession += 0.0 if facing else share * step[-3]
        held = run(local, system, setting.spin, jnp.asarray(z))
    neutral = np.stack([turn, spin], axis=1)
    drifts = float(tilt), float(faster), float(left)
    return Orbit(z, duration, precession, *drifts, tangents, matrix, neutral, sailing, converged)


def held_axis(axis: Float[Host, "3"]) -> Float[Host, "3"]:
    """A unit vector across an axis."""
    other = np.eye(3)[np.abs(axis).argmin()]
    across = np.cross(other, axis)
    return across / np.linalg.norm(across)


def unknown(setting: Setting, z: Host, tangents: Host) -> Orbit:
    """The result if the motion could not be integrated."""
    nan, size = np.nan, tangents.shape[1]
    return Orbit(
        z, nan, nan, nan, nan, nan, tangents, np.full((size, size), nan), np.zeros((len(z), 2)), nan, False
    )


def mapped(setting: Setting, z: Host, duration: float, precession: float, tangents: Host) -> Image:
    """The image of a state with the derivatives along all tangents, which are computed TOGETHER at
    a time, by one program."""
    directions = tangents.T
    missing = -len(directions) % TOGETHER
    directions = np.pad(directions, ((0, missing), (0, 0)))
    numbers = (setting.spin, setting.wind, z, duration, precession)
    arguments = (setting.system, *(jnp.asarray(x, jnp.float64) for x in numbers))
    static = (setting.steps, setting.places)
    program = program_of(turn_map, static, (*arguments, jnp.asarray(directions[:TOGETHER])))
    found = [
        program(*arguments, jnp.asarray(directions[k : k + TOGETHER]))
        for k in range(0, len(directions), TOGETHER)
    ]
    changes = np.concatenate([np.asarray(part.changes) for part in found])
    changes = changes[: len(changes) - missing]
    return Image(np.asarray(found[0].state), np.asarray(found[0].rate), changes.T)


def run(function, system, spin, z):
    """The result of one of the small programs of `turn_map.py`, as NumPy arrays."""
    arguments = (system, jnp.asarray(spin, jnp.float64), z)
    program = program_of(function, (), arguments, START_OPTIONS)
    return jax.tree.map(np.asarray, program(*arguments))
