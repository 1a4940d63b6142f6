"""Checks of the place of a sail: on its orbit about the Sun, or at rest."""

from typing import Any

import numpy as np

from esail_jax.constants import ASTRONOMICAL_UNIT, SOLAR_MU, SOLAR_RADIUS
from esail_jax.scenes import rules
from esail_jax.scenes.parts import Parts
from esail_jax.scenes.rules import SceneError


def check_off_axis(key: str, position: Any) -> None:
    """Refuses a heliocentric position on the axis of the ecliptic, where the orbital frame is not defined.
    Raises SceneError."""
    position = None if position is None else rules.known(position)
    if position is not None and position[0] == position[1] == 0.0:
        raise SceneError(key, "not lie on the ecliptic's axis", rules.describe(position))


def check_orbit(scene: Parts) -> None:
    """Checks the keys of a sail that belong to its orbit about the Sun. Raises SceneError."""
    orbit, wind = scene.orbit, scene.solar_wind
    if orbit is None:
        if wind is not None and wind.reference_distance_au is not None:
            raise SceneError("solar_wind.reference_distance_au", "be left out without [orbit]", "is given")
        return
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
