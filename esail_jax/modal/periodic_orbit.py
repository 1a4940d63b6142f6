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

from esail_jax.array_types import Float, Vector
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
    system, spin, wind = setting.system, setting.spin, setting.wind
    z = run(settled, system, spin, jnp.asarray(start))
    duration, precession = 2.0 * np.pi / (spin * setting.parts), 0.0
    held: Local = run(local, system, spin, jnp.asarray(z))
    wanted = Wanted(z, held.momentum)
    for _ in range(MAX_ITERATIONS):
        tangents = np.linalg.qr(held.conditions.T, mode="complete")[0][:, len(held.conditions) :]
        image = mapped(setting, z, duration, precession, tangents)
        along = directions(wind, held)
        equations = bordered_system(Linearised(z, held, along, tangents, image), wanted, spin)
        if not (np.isfinite(equations.matrix).all() and np.isfinite(equations.right).all()):
            return unknown(setting, z, tangents)
        step = newton_step(equations)
        converged = bool(step.length <= CONVERGED)
        if converged:
            break
        share = min(1.0, LONGEST_STEP / step.length)
        z = run(settled, system, spin, jnp.asarray(z + share * (tangents @ step.state)))
        duration += share * step.angle / spin
        precession += 0.0 if along.facing else share * step.precession
        held = run(local, system, spin, jnp.asarray(z))
    return Orbit(
        state=z,
        duration=duration,
        precession=precession,
        tilt=float(step.tilt),
        spin=float(step.spin),
        left=float(step.left),
        tangents=tangents,
        map=equations.map,
        neutral=np.stack([along.turn, along.spin], axis=1),
        sailing_angle=float(np.arctan2(np.linalg.norm(np.cross(wind, along.axis)), wind @ along.axis)),
        converged=converged,
    )


class Wanted(NamedTuple):
    """What an orbit shares with the state at the start of the iteration: its phase, and its angular
    momentum H_0 [kg m^2/s]."""

    state: Float[Host, " m"]
    momentum: Vector


class Directions(NamedTuple):
    """Motions of a whole sail, at one of its states.

    axis: that of the angular momentum; facing: whether the sail faces the wind; turning: axis of the
    precession, which is the wind's, or one across if the sail faces the wind; across: axis about which the
    spin axis turns away from the wind; turn, spin: changes of the state by a turn about `axis` and by a
    faster spin about it."""

    axis: Float[Host, "3"]
    facing: bool
    turning: Float[Host, "3"]
    across: Float[Host, "3"]
    turn: Float[Host, " m"]
    spin: Float[Host, " m"]


def directions(wind: Float[Host, "3"], held: Local) -> Directions:
    """The motions of a whole sail. wind: unit vector."""
    axis = np.asarray(held.momentum / np.linalg.norm(held.momentum))
    across = np.cross(wind, axis)
    facing = bool(np.linalg.norm(across) < FACING)
    across = held_axis(axis) if facing else across / np.linalg.norm(across)
    turning = np.cross(axis, across) if facing else wind
    return Directions(axis, facing, turning, across, axis @ held.turns, axis @ held.spins)


class Linearised(NamedTuple):
    """A state of the iteration, with what its Newton step depends on. tangents: basis of the changes of the
    state that the conditions of `held` allow, one a column."""

    state: Float[Host, " m"]
    held: Local
    along: Directions
    tangents: Float[Host, "m n"]
    image: Image


class Equations(NamedTuple):
    """The linear equations `matrix` @ step = `right` of a Newton step, and what it is judged by.

    A step has the change of the state, in the basis of the tangents, and four numbers: |Omega| dT, d Delta,
    a and b. tangents: as in `Linearised`; map: derivative of F in their basis; gap: F(z) - z in it;
    numbers: derivatives of F(z) - z - a e_tilt - b e_spin by the four numbers, one a row; size: largest
    coordinate [m]."""

    matrix: Float[Host, "k k"]
    right: Float[Host, " k"]
    tangents: Float[Host, "m n"]
    map: Float[Host, "n n"]
    gap: Float[Host, " n"]
    numbers: Float[Host, "4 m"]
    size: float


def bordered_system(at: Linearised, wanted: Wanted, spin: float) -> Equations:
    """The equations of a Newton step. First rows: F(z) - z in the basis of the tangents; then three for the
    angular momentum and one for the phase. All are in metres. spin: |Omega| [rad/s]."""
    z, held, along, tangents, image = at
    by_state = tangents.T @ image.changes
    numbers = np.stack(
        [image.rate / spin, -along.turning @ held.turns, -along.across @ held.turns, -along.spin]
    )
    half = len(z) // 2
    phase = np.concatenate([along.turn[:half], np.zeros(half)]) / np.linalg.norm(along.turn[:half])
    size = np.abs(z).max()
    slopes = held.slopes * (size / np.linalg.norm(wanted.momentum))
    rows = np.vstack([slopes, phase]) @ tangents
    identity = np.eye(len(by_state))
    matrix = np.block([[by_state - identity, tangents.T @ numbers.T], [rows, np.zeros((4, 4))]])
    gap = tangents.T @ (image.state - z)
    change = (wanted.momentum - held.momentum) * (size / np.linalg.norm(wanted.momentum))
    right = np.concatenate([-gap, change, [phase @ (wanted.state - z)]])
    return Equations(matrix, right, tangents, by_state, gap, numbers, size)


class Step(NamedTuple):
    """A Newton step.

    state: change of the state in the basis of the tangents; angle: |Omega| dT [rad]; precession: d Delta
    [rad]; tilt, spin: the drifts a and b; length: largest displacement, relative to the largest coordinate;
    left: as in `Orbit`."""

    state: Float[Host, " n"]
    angle: float
    precession: float
    tilt: float
    spin: float
    length: float
    left: float


def newton_step(equations: Equations) -> Step:
    """The solution of the equations of a Newton step."""
    solution = np.linalg.solve(equations.matrix, equations.right)
    state, drifts = solution[:-4], solution[-2:]
    drift = equations.numbers[2:].T @ drifts
    left = np.abs(equations.gap + equations.tangents.T @ drift).max() / equations.size
    length = np.abs(state).max() / equations.size
    angle, precession, tilt, spin = solution[-4:]
    return Step(state, angle, precession, tilt, spin, length, left)


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
    rows = tangents.T
    missing = -len(rows) % TOGETHER
    rows = np.pad(rows, ((0, missing), (0, 0)))
    numbers = (setting.spin, setting.wind, z, duration, precession)
    arguments = (setting.system, *(jnp.asarray(x, jnp.float64) for x in numbers))
    static = (setting.steps, setting.places)
    program = program_of(turn_map, static, (*arguments, jnp.asarray(rows[:TOGETHER])))
    images = [
        program(*arguments, jnp.asarray(rows[k : k + TOGETHER])) for k in range(0, len(rows), TOGETHER)
    ]
    changes = np.concatenate([np.asarray(image.changes) for image in images])
    changes = changes[: len(changes) - missing]
    return Image(np.asarray(images[0].state), np.asarray(images[0].rate), changes.T)


def run(function, system, spin, z):
    """The result of one of the small programs of `turn_map.py`, as NumPy arrays."""
    arguments = (system, jnp.asarray(spin, jnp.float64), z)
    program = program_of(function, (), arguments, START_OPTIONS)
    return jax.tree.map(np.asarray, program(*arguments))
