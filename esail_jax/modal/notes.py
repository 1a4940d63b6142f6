"""Sentences that say what the modes of a scene refer to, and what is left out of them."""

import numpy as np

from esail_jax.modal.multipliers import FASTEST, Floquet
from esail_jax.modal.solving import Solved
from esail_jax.scenes.scene import Scene

ALONG_WIND_DEG = 1e-6
"""Largest sailing angle [deg] of a sail that counts as facing the wind."""

GROWING = 1e-8
"""Least |mu| - 1 of a motion that is said to grow: multipliers are accurate to 1e-9 or better (those of the
slow motions to 1e-12)."""


def notes_of(scene: Scene, solved: Solved) -> tuple[str, ...]:
    """The sentences, one for each note."""
    return (state_of(scene, solved), *left_out(solved), *selection_of(solved))


def state_of(scene: Scene, solved: Solved) -> str:
    """The sentence about the equilibrium."""
    spin, angle = solved.spin, float(np.asarray(scene.initial.sailing_angle_deg))
    period = f"spin {spin:g} rad/s ({abs(spin) / (2.0 * np.pi):.4e} Hz)"
    if scene.solar_wind is None and scene.tip_thrust is None:
        return f"Equilibrium: the free spinning sail, {period}."
    coning = np.degrees(solved.coning_angle)
    cone = (
        f"{coning.min():.4f} deg"
        if np.ptp(coning) < 1e-4
        else f"{coning.min():.4f} to {coning.max():.4f} deg"
    )
    moving = (
        f"accelerating uniformly at {solved.acceleration:.4e} m/s^2 along the spin axis"
        if solved.hub
        else "on a frame that is fixed in space"
    )
    shape = f"the steady cone of {cone}, {moving}, {period}."
    if scene.solar_wind is None or min(abs(angle), 180.0 - abs(angle)) <= ALONG_WIND_DEG:
        return f"Equilibrium: {shape}"
    return (
        f"At the sailing angle of {angle:g} deg there is no equilibrium: the load changes during a turn. "
        f"The modes are those under the mean load over a turn, that of the wind's part along the spin "
        f"axis, u cos(alpha): {shape}"
    )


def left_out(solved: Solved) -> list[str]:
    """The sentences about motions that are no vibrations."""
    if solved.hub:
        return [
            "Left out: the motions of the centre of mass (as seen in B, frequency 0 along the spin axis "
            "and the spin frequency across it) and the angle about the spin axis (frequency 0). Kept: the "
            "precession of the spin axis; an axis that is tilted and at rest in space turns in B once a "
            "turn, at the spin frequency."
        ]
    if solved.at_rest:
        return [
            f"Left out: the angle of {solved.at_rest // 2} tethers about the spin axis (frequency 0), as "
            "their roots are on it."
        ]
    return []


def selection_of(solved: Solved) -> list[str]:
    """The sentence about modes that were not computed."""
    if solved.complete:
        return []
    return ["The tethers are unequal and many: only the modes of the lowest frequencies are computed."]


def floquet_notes(floquet: Floquet) -> tuple[str, ...]:
    """The sentences about the periodic orbit and its stability."""
    angle = np.degrees(floquet.sailing_angle)
    strongest = float(np.nanmax(floquet.growth)) - 1.0
    stable = "no motion grows" if strongest <= GROWING else "a motion grows"
    facing = min(angle, 180.0 - angle) <= ALONG_WIND_DEG
    place = "facing the wind" if facing else f"at the sailing angle of {angle:.6g} deg"
    return (
        f"Floquet multipliers: {place} the sail moves on a periodic orbit with a turn of "
        f"{floquet.period:.8g} s relative to the wind. In a turn the spin axis precesses by "
        f"{np.degrees(floquet.precession):.3e} deg about the wind, {drift(floquet)} "
        f"Of its size, {floquet.left:.0e} does not repeat itself otherwise.",
        f"In every turn a small motion about this orbit is multiplied by mu: {stable}, the largest "
        f"|mu| - 1 is {strongest:.1e}. Its exponent is s = ln(mu) / T. Not given are the multipliers of "
        "turning on and of spinning faster, which are 1, and those of motions faster than "
        f"{FASTEST:g} rad per radian of spin.",
    )


def drift(floquet: Floquet) -> str:
    """The part of a sentence about what drifts from turn to turn."""
    tilt, spin = np.degrees(floquet.tilt_drift), floquet.spin_drift
    return f"the sailing angle changes by {tilt:.1e} deg and the spin by {spin:.1e} of itself."
