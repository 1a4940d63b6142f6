"""Computes the signals of an Exudyn run, with the names of esail_jax, from Exudyn's states alone.

This module does not call `esail_jax.observables`, so that an error there shows as a difference.
"""

import numpy as np
from inputs import WEIGHTS, XI, Sail, hermite
from sail import History, Thrust

STRAIN_XI = np.linspace(0.0, 1.0, 11)
"""Points of an element at which the largest strain is evaluated."""


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors along the last axis, normalised."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def orbital_frames(position: np.ndarray) -> np.ndarray:
    """The axes i_O, j_O, k_O at positions (time, xyz) [m] from the Sun: (time, xyz, axis).

    k_O points away from the Sun, i_O along the ecliptic."""
    k = unit(position)
    i = unit(np.cross([0.0, 0.0, 1.0], k))
    return np.stack([i, np.cross(k, i), k], axis=-1)


def coning_and_lagging(body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coning and lagging angles [rad] of vectors (time, tether, xyz) in B.

    Coning is the angle from the plane of Y_B, Z_B towards X_B; lagging is the angle in that plane from the
    tether's own azimuth."""
    p = body.shape[1]
    coning = np.arctan2(body[..., 0], np.hypot(body[..., 1], body[..., 2]))
    angle = np.arctan2(body[..., 2], body[..., 1]) - 2.0 * np.pi * np.arange(p) / p
    return coning, (angle + np.pi) % (2.0 * np.pi) - np.pi


def signals(sail: Sail, history: History) -> dict[str, np.ndarray]:
    """All compared signals, time first."""
    r = history.position
    to_body = history.hub_rotation  # vectors are rows: row @ C_B^I gives components in B
    roots, tips = r[:, :, 0, 0], r[:, :, -1, 0]
    coning, lagging = coning_and_lagging((tips - roots) @ to_body)
    root_coning, root_lagging = coning_and_lagging(r[:, :, 0, 1] @ to_body)
    orbital = orbital_frames(sail.origin + history.hub_position)
    spin_axis = np.einsum("txo,tx->to", orbital, to_body[:, :, 0])
    thrust = Thrust(sail)
    nodal = np.stack([thrust(q.ravel()).reshape(q.shape) for q in r])
    stretch = np.linalg.norm(sail.slopes(r), axis=-1)
    length = sail.element_length[:, None]
    return {
        "tip_position_I": tips,
        "hub_position_I": history.hub_position,
        "coning_angle": coning,
        "lagging_angle": lagging,
        "root_coning_angle": root_coning,
        "root_lagging_angle": root_lagging,
        "tether_length": (stretch @ WEIGHTS * length).sum(-1),
        "max_axial_strain": (np.linalg.norm(sail.slopes(r, STRAIN_XI), axis=-1) - 1.0).max((-1, -2)),
        "angular_velocity_B": history.hub_spin_B,
        "sailing_angle": np.arctan2(np.hypot(spin_axis[:, 0], spin_axis[:, 1]), spin_axis[:, 2]),
        "thrust_O": np.einsum("txo,tx->to", orbital, nodal[:, :, :, 0].sum((1, 2))),
        "reaction_B": history.reaction @ to_body,
        "kinetic_energy": kinetic_energy(sail, history),
        "elastic_energy": elastic_energy(sail, r),
    }


def kinetic_energy(sail: Sail, history: History) -> np.ndarray:
    """The kinetic energy T [J] of tethers, remote units and hub."""
    v = hermite(XI) @ sail.element_vectors(history.velocity)
    squared = (v * v).sum(-1) @ WEIGHTS
    tips = (history.velocity[:, :, -1, 0] ** 2).sum(-1)
    hub = sail.hub_mass * (history.hub_velocity**2).sum(-1) + history.hub_spin_B**2 @ sail.inertia
    tethers = squared.sum(-1) @ (sail.line_density * sail.element_length)
    return 0.5 * (tethers + tips @ sail.tip_mass + hub)


def elastic_energy(sail: Sail, r: np.ndarray) -> np.ndarray:
    """The elastic energy U [J], with strain |r_x| - 1 and Exudyn's curvature |r_x x r_xx| /
    |r_x|^2."""
    r_x = sail.slopes(r)
    r_xx = hermite(XI, 2) @ sail.element_vectors(r) / sail.element_length[:, None, None, None] ** 2
    stretch = np.linalg.norm(r_x, axis=-1)
    curvature = np.linalg.norm(np.cross(r_x, r_xx), axis=-1) / stretch**2
    density = sail.axial_stiffness[:, None, None] * (stretch - 1.0) ** 2
    density = density + sail.bending_stiffness[:, None, None] * curvature**2
    return 0.5 * ((density @ WEIGHTS).sum(-1) @ sail.element_length)
