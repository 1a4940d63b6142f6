"""Dense matrices of the small sail of `sail_states.py`, in the coordinates of [PGV] Eq. 4.

They share no code with the package.
"""

import functools

import numpy as np

from oracles.sail_states import (
    B_P,
    HEIGHT,
    HUB_DENSITY,
    LENGTH,
    LINE_DENSITY,
    NODES,
    RADIUS,
    SIZE,
    TIP_MASS,
    P,
    State,
    node,
)

TETHERS, ELEMENTS = range(1, P + 1), range(1, NODES)
ELEMENT = LENGTH / (NODES - 1)
HUB_MASS = HUB_DENSITY * np.pi * RADIUS**2 * HEIGHT
BASE_POINTS = np.array([[-HEIGHT / 2, 0, 0], [HEIGHT / 2, 0, 0], [0, RADIUS, 0], [0, 0, RADIUS]])
"""A, B, C, D of Sec. 4.1 in the body frame."""

XI, WEIGHTS = (lambda x, w: ((1 + x) / 2, w / 2))(*np.polynomial.legendre.leggauss(5))
"""Gauss points on (0, 1): the package's choice, and exact for products of two cubics."""


def shapes(xi: np.ndarray, length: float) -> np.ndarray:
    """s_1 ... s_4 of Eq. 18: (4, point)."""
    return np.array(
        [
            1 - 3 * xi**2 + 2 * xi**3,
            length * (xi - 2 * xi**2 + xi**3),
            3 * xi**2 - 2 * xi**3,
            length * (xi**3 - xi**2),
        ]
    )


def hub_matrices(state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass matrix of the four base points, the gradient of Eq. 45, and minus its second derivative
    along the velocity."""
    points, rates = state.q[:12].reshape(4, 3), state.v[:12].reshape(4, 3)
    # r = sum g_k r_k, sum g = 1; the second moments of a cylinder about its centre are known.
    inverse = np.linalg.inv(np.vstack([BASE_POINTS.T, np.ones(4)]))
    moments = np.diag([HEIGHT**2 / 12, RADIUS**2 / 4, RADIUS**2 / 4, 1.0])
    mass = np.kron(HUB_MASS * inverse @ moments @ inverse.T, np.eye(3))
    gradient, bend = [], []
    for a, b in ((1, 1), (2, 2), (3, 3), (2, 1), (3, 1), (3, 2)):
        row = np.zeros((4, 3))
        edges = points[[a, b]] - points[0]
        row[a] += edges[1]
        row[b] += edges[0]
        row[0] -= edges.sum(0)
        gradient.append(row.reshape(-1))
        bend.append(-2.0 * (rates[a] - rates[0]) @ (rates[b] - rates[0]))
    return mass, np.array(gradient), np.array(bend)


@functools.cache
def tether_mass() -> np.ndarray:
    """Eq. 22 assembled by Eq. 11, with the remote units: in q."""
    total = np.zeros((SIZE, SIZE))
    for i in TETHERS:
        s = shapes(XI, ELEMENT[i - 1])
        element = np.kron(LINE_DENSITY * ELEMENT[i - 1] * (s * WEIGHTS) @ s.T, np.eye(3))
        for j in ELEMENTS:
            pick = np.vstack([node(i, j), node(i, j + 1)])
            total += pick.T @ element @ pick
        tip = B_P @ node(i, NODES)
        total += TIP_MASS[i - 1] * tip.T @ tip
    return total
