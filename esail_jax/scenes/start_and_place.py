"""The tables that say where a sail or a chain starts, and in which field of acceleration: start, gravity
and orbit."""

from typing import Any, Literal

import numpy as np

from esail_jax.constants import ASTRONOMICAL_UNIT, SOLAR_MU, SOLAR_RADIUS
from esail_jax.scenes import rules
from esail_jax.scenes.declarations import declare, table, vector
from esail_jax.scenes.rules import (
    Number,
    SceneError,
    Shape,
    Vector,
    Vectors,
    any_number,
    between,
    choice,
    date,
    nonzero_vector,
    positive,
)

ElongationName = Literal["steady", "paper"]


@table
class Initial:
    """State of a sail at t = 0 ([PGV] Sec. 4.1)."""

    spin_rate: Number = declare(any_number, unit="rad/s", doc="Angular rate about X_B.")
    sailing_angle_deg: Number = declare(
        between("(-180, 180]"),
        unit="deg",
        doc="Sailing angle alpha from the direction away from the Sun to the spin axis X_B.",
        default=0.0,
    )
    heliocentric_position_au: Vector | None = vector(
        unit="au",
        doc="Heliocentric position R_0 of the inertial frame's origin, left out with [orbit]; without both "
        "(0.7071067811865476, 0.7071067811865476, 0).",
        default=None,
    )
    elongation: ElongationName = declare(
        choice(ElongationName),
        unit="-",
        doc="Stretch of the spinning tethers: the discrete equilibrium, or [PGV] Eq. 79-80 as printed.",
        default="steady",
    )
    coning_angle_deg: Number = declare(
        between("(-90, 90)"),
        unit="deg",
        doc="Angle of the tethers from the spin plane towards X_B.",
        default=0.0,
    )
    epoch: str | None = declare(
        date,
        unit="-",
        doc="Date of t = 0, such as 2027-03-01T12:00:00, in UTC unless it ends with TDB.",
        default=None,
    )


ORIGIN_AU = (0.7071067811865476, 0.7071067811865476, 0.0)
"""Heliocentric position [au] of the origin of a sail that has neither a position nor an orbit."""


RECTIFIED_EVERY = 86400.0
"""Time [s] between two rectifications of the orbit of a sail (`simulation/rectification.py`): a day, in
which an acceleration of 3e-4 m/s^2 moves a light sail by 1e6 m. The error of rounding is then 1e-7 of the
range of coning (`docs/theory.md`). A rectification takes some milliseconds, a day of the baseline 3 s."""


@table
class ChainInitial:
    """State of a chain at t = 0. A vector holds for all rods, a list has one vector per rod."""

    rod_vector: Vectors = declare(
        nonzero_vector, shape=Shape.VECTORS, unit="m", doc="Vector from a rod's first joint to its second."
    )
    rod_rate: Vectors = declare(
        any_number,
        shape=Shape.VECTORS,
        unit="m/s",
        doc="Time derivative of the rod vector.",
        default=(0.0, 0.0, 0.0),
    )
    position: Vector | None = vector(
        unit="m", doc="Position of the first joint of a free chain; the origin if left out.", default=None
    )
    velocity: Vector | None = vector(
        unit="m/s", doc="Velocity of the first joint of a free chain; zero if left out.", default=None
    )
    heliocentric_position_au: Vector | None = vector(
        unit="au", doc="Heliocentric position of the origin, required with solar wind.", default=None
    )
    epoch: str | None = declare(
        date,
        unit="-",
        doc="Date of t = 0, such as 2027-03-01T12:00:00, in UTC unless it ends with TDB.",
        default=None,
    )


@table
class Gravity:
    """Uniform gravity in the inertial frame."""

    acceleration: Vector = vector(unit="m/s^2", doc="Acceleration of gravity in inertial axes.")


@table
class Orbit:
    """Circular orbit about a centre of attraction; the chain moves in axes that turn with the orbit."""

    mean_motion: Number = declare(positive, unit="rad/s", doc="Angular rate of the orbit.")


@table
class HeliocentricOrbit:
    """Kepler orbit about the Sun of the origin of the inertial frame, whose axes do not turn. The hub
    starts on it."""

    position_au: Vector = declare(
        nonzero_vector, shape=Shape.VECTOR, unit="au", doc="Heliocentric position of the hub at t = 0."
    )
    velocity: Vector = declare(
        nonzero_vector, shape=Shape.VECTOR, unit="m/s", doc="Heliocentric velocity of the hub at t = 0."
    )


def check_start(scene: Any) -> None:
    """Checks the start of a sail. Raises SceneError."""
    check_off_axis("initial.heliocentric_position_au", scene.initial.heliocentric_position_au)


def check_chain_start(scene: Any) -> None:
    """Checks the start of a chain. Raises SceneError."""
    start = scene.initial
    for name in ("position", "velocity"):
        if getattr(start, name) is not None and scene.chain.anchor != "free":
            must = 'be left out unless `chain.anchor` is "free"'
            raise SceneError(f"initial.{name}", must, "is given")
    if scene.solar_wind is None and start.heliocentric_position_au is not None:
        raise SceneError("initial.heliocentric_position_au", "be left out without [solar_wind]", "is given")
    check_off_axis("initial.heliocentric_position_au", start.heliocentric_position_au)


def check_off_axis(key: str, position: Any) -> None:
    """Refuses a heliocentric position on the axis of the ecliptic, where the orbital frame is not defined.
    Raises SceneError."""
    position = None if position is None else rules.known(position)
    if position is not None and position[0] == position[1] == 0.0:
        raise SceneError(key, "not lie on the ecliptic's axis", rules.describe(position))


def check_orbit(scene: Any) -> None:
    """Checks the orbit of a sail about the Sun. Raises SceneError."""
    orbit = scene.orbit
    if scene.hub is None:
        raise SceneError("orbit", "be left out without [hub]", "is given")
    if scene.initial.heliocentric_position_au is not None:
        raise SceneError("initial.heliocentric_position_au", "be left out with [orbit]", "is given")
    check_off_axis("orbit.position_au", orbit.position_au)
    position, velocity = (rules.known(x) for x in (orbit.position_au, orbit.velocity))
    if position is None or velocity is None:
        return
    nearest = pericentre(ASTRONOMICAL_UNIT * position, velocity)
    if nearest < SOLAR_RADIUS:
        must = f"give an orbit whose pericentre is outside the Sun ({SOLAR_RADIUS:g} m)"
        raise SceneError("orbit.velocity", must, f"the pericentre is at {nearest:.6g} m")


def pericentre(position: np.ndarray, velocity: np.ndarray) -> float:
    """Pericentre distance [m] of the Kepler orbit about the Sun through a position [m] with a velocity
    [m/s]: (h^2/mu)/(1 + e), with the angular momentum h and the eccentricity e."""
    h = np.linalg.norm(np.cross(position, velocity))
    r, speed_squared = np.linalg.norm(position), velocity @ velocity
    e_vector = (speed_squared / SOLAR_MU - 1.0 / r) * position - position @ velocity / SOLAR_MU * velocity
    return float(h**2 / SOLAR_MU / (1.0 + np.linalg.norm(e_vector)))
