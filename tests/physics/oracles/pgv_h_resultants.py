"""[PGV] Eq. 72-76: resultant and moment of the thrust.

The judges are integrals of the thrust over Gauss points (no nodal forces), and the package's observables.
"""

import numpy as np

from oracles.ledger import Errors, fails, holds, relative_error
from oracles.sail_matrices import ELEMENT, ELEMENTS, TETHERS, WEIGHTS, XI, shapes
from oracles.sail_states import B_P, State, node, worst, worst_of_both


def element_thrust(state: State, i: int, j: int) -> np.ndarray:
    """Q_c of Eq. 34: integral of S^T f_c over element j of tether i, 12 numbers."""
    length, force = ELEMENT[i - 1], state.seen["load"][:, :, j - 1, i - 1]
    return np.einsum("q,aq,xq->ax", length * WEIGHTS, shapes(XI, length), force).reshape(-1)


def thrust_integral(state: State, i: int) -> np.ndarray:
    """Integral of f_c over tether i."""
    return ELEMENT[i - 1] * np.einsum("q,xqj->x", WEIGHTS, state.seen["load"][..., i - 1])


def moment_integral(state: State, i: int) -> np.ndarray:
    """Integral of (r - r_root) x f_c over tether i."""
    total = np.zeros(3)
    for j in ELEMENTS:
        ends = np.concatenate([node(i, j) @ state.q, node(i, j + 1) @ state.q]).reshape(4, 3)
        arms = shapes(XI, ELEMENT[i - 1]).T @ ends - B_P @ node(i, 1) @ state.q
        force = state.seen["load"][:, :, j - 1, i - 1].T
        total += ELEMENT[i - 1] * WEIGHTS @ np.cross(arms, force)
    return total


def per_tether(state: State, function) -> np.ndarray:
    """Vectors in I of all tethers: (tether, xyz)."""
    return np.array([function(state, i) for i in TETHERS])


@holds("PGV", "72", "thrust of the sail is the sum over its tethers")
def thrust_of_the_sail():
    def error(state):
        total = per_tether(state, thrust_integral).sum(0)
        return relative_error(total, state.turn @ state.seen["thrust_B"].sum(0))

    return worst(error)


def against_integral(printed, right, integral, observable: str) -> Errors:
    """Both forms of a tether's resultant against the integral over its length, and the right one against
    the package's observable too."""

    def errors(state):
        truth, form = per_tether(state, integral), per_tether(state, right)
        seen = state.seen[observable] @ state.turn.T
        return Errors(
            relative_error(per_tether(state, printed), truth),
            max(relative_error(form, truth), relative_error(form, seen)),
        )

    return worst_of_both(errors)


@fails(
    "PGV",
    "73",
    "thrust of a tether from nodal forces",
    printed=r"F_{ci} = [\hat B^p | 0] Q_{ci1} + \sum_{j=1}^{n-1} [0 | \hat B^p] Q_{cij}",
    right=r"F_{ci} = \sum_{j=1}^{n-1} ([\hat B^p | 0] + [0 | \hat B^p]) Q_{cij}",
    consequence="The forces at the first nodes of all elements but the first are dropped: with five "
    "elements the baseline's thrust comes out 40 % too small. Right for one element only.",
)
def thrust_of_a_tether():
    first, second = np.hstack([B_P, np.zeros((3, 6))]), np.hstack([np.zeros((3, 6)), B_P])

    def printed(state, i):
        rest = sum(second @ element_thrust(state, i, j) for j in ELEMENTS)
        return first @ element_thrust(state, i, 1) + rest

    def right(state, i):
        return sum((first + second) @ element_thrust(state, i, j) for j in ELEMENTS)

    return against_integral(printed, right, thrust_integral, "thrust_B")


@holds(
    "PGV",
    "74",
    "thrust in the orbital frame, F_c^O = C_I^O F_c",
    note="With C_I^O as defined in Sec. 2.1; the matrix printed in Eq. 66 is its transpose.",
)
def thrust_in_orbital_frame():
    def error(state):
        total = per_tether(state, thrust_integral).sum(0)
        return relative_error(state.orbital.T @ total, state.seen["thrust_O"])

    return worst(error)


def angle_from_sun_direction(force: np.ndarray) -> float:
    """Angle between a vector in O and Z_O."""
    return np.arccos(force[2] / np.linalg.norm(force))


def angle_errors(force: np.ndarray, seen: float) -> Errors:
    """The errors of atan(axial / transverse), as printed, and of atan2(transverse, axial)."""
    axial, transverse = force[2], np.hypot(force[0], force[1])
    truth, right = angle_from_sun_direction(force), np.arctan2(transverse, axial)
    return Errors(
        relative_error(np.arctan(axial / transverse), truth),
        max(relative_error(right, truth), relative_error(right, seen)),
    )


@fails(
    "PGV",
    "74 angle",
    "thrust angle, formed by F_c and Z_O",
    printed=r"\Gamma_c = \tan^{-1}(F_{ax} / F_{tr})",
    right=r"\Gamma_c = atan2(F_{tr}, F_{ax})",
    consequence="The printed angle is the complement: 85 deg instead of 5 deg for the baseline.",
)
def thrust_angle():
    return worst_of_both(lambda state: angle_errors(state.seen["thrust_O"], state.seen["thrust_angle"]))


@fails(
    "PGV",
    "75",
    "moment of a tether's thrust about its anchor",
    printed=r"M_{ci} = \sum_{j=1}^{n-1} \hat B^p (\hat B_{i(j+1)} - \hat B_{i1}) q "
    r"\times [0 | \hat B^p] Q_{cij}",
    right=r"M_{ci} = \sum_{j=1}^{n-1} \sum_{k=j}^{j+1} (\hat B^p (\hat B_{ik} - \hat B_{i1}) q "
    r"\times \hat B^p Q_{cij}^k + \hat B^s \hat B_{ik} q \times \hat B^s Q_{cij}^k), Q^k the part of "
    r"node k",
    consequence="First nodes and slope forces are dropped: with five elements the baseline's moment comes "
    "out 40 % too small.",
)
def moment_of_a_tether():
    second = np.hstack([np.zeros((3, 6)), B_P])

    def printed(state, i):
        return sum(
            np.cross(B_P @ (node(i, j + 1) - node(i, 1)) @ state.q, second @ element_thrust(state, i, j))
            for j in ELEMENTS
        )

    def right(state, i):
        total, root = np.zeros(3), B_P @ node(i, 1) @ state.q
        for j in ELEMENTS:
            for k, part in enumerate(element_thrust(state, i, j).reshape(2, 2, 3)):
                place, slope = (node(i, j + k) @ state.q).reshape(2, 3)
                total += np.cross(place - root, part[0]) + np.cross(slope, part[1])
        return total

    return against_integral(printed, right, moment_integral, "thrust_moment_B")


@holds(
    "PGV",
    "76",
    "sum of the moments of the tethers' thrust",
    note="Each moment is about its own anchor: the sum is not the moment of the thrust about one point.",
)
def moment_of_the_sail():
    def error(state):
        total = per_tether(state, moment_integral).sum(0)
        return relative_error(state.orbital.T @ total, state.seen["thrust_moment_O"])

    return worst(error)
