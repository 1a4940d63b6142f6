"""[PGV] Eq. 77-78: forces and moments of the roots on the hub.

The judges are Newton's and Euler's laws for the hub with the package's accelerations, a dense solution of
the printed index-3 equations for the multipliers, and the package's observables.
"""

import numpy as np

from oracles.ledger import Errors, fails, holds, relative_error
from oracles.pgv_h_resultants import angle_errors
from oracles.sail_matrices import BASE_POINTS, HUB_MASS, TETHERS, hub_matrices, tether_mass
from oracles.sail_states import (
    B_P,
    HEIGHT,
    RADIUS,
    SIZE,
    P,
    State,
    azimuth,
    base,
    flat,
    node,
    skew,
    worst,
    worst_of_both,
)


def multipliers(state: State) -> np.ndarray:
    """lambda_i of Eq. 53 from M q'' + C_q^T lambda = Q, C_q q'' = Q_lambda (Eq. 3): (tether, xyz)."""
    hub_mass, rigid, bend = hub_matrices(state)
    mass = tether_mass().copy()
    mass[:12, :12] += hub_mass
    rows = []
    for i in TETHERS:
        anchor = np.array([0.0, RADIUS * np.cos(azimuth(i)), RADIUS * np.sin(azimuth(i)), 1.0])
        g = np.linalg.solve(np.vstack([BASE_POINTS.T, np.ones(4)]), anchor)
        rows.append(sum(g[k - 1] * base(k) for k in range(1, 5)) - B_P @ node(i, 1))
    gradient = np.vstack([*rows, np.hstack([rigid, np.zeros((6, SIZE - 12))])])
    count = len(gradient)
    matrix = np.block([[mass, gradient.T], [gradient, np.zeros((count, count))]])
    # The package's elastic, viscous and thrust forces stand on the left-hand side.
    right = np.concatenate([-flat(state.seen["static"]), np.zeros(3 * P), bend])
    return np.linalg.solve(matrix, right)[SIZE:][: 3 * P].reshape(P, 3)


def hub_force_and_torque(state: State) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment of the tethers on the hub in I, from its inertia and the accelerations of
    its base points; the moment is about its centre."""
    points = state.seen["hub_acceleration"]
    force = HUB_MASS * 0.5 * (points[0] + points[1])
    edges = (BASE_POINTS[1:] - BASE_POINTS[0]).T
    second = state.turn.T @ (points[1:] - points[0]).T @ np.linalg.inv(edges)  # [alpha]x + [omega]x^2
    spin = second - skew(state.omega) @ skew(state.omega)
    alpha = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
    across = RADIUS**2 / 4 + HEIGHT**2 / 12
    inertia = HUB_MASS * np.diag([RADIUS**2 / 2, across, across])
    return force, state.turn @ (inertia @ alpha + np.cross(state.omega, inertia @ state.omega))


@fails(
    "PGV",
    "77",
    "total force applied to the central vehicle",
    printed=r"F_\lambda = \sum_i \lambda_i",
    right=r"-\sum_i \lambda_i: with C = G d - S e and M q'' + C_q^T \lambda = Q, "
    r"\lambda_i is the force of the hub on tether i",
    consequence="The sign: Fig. 9 (d3) shows a force towards the Sun on a sail that is pushed away from "
    "it, "
    "as Sec. 4.3.2 itself remarks.",
)
def force_on_the_hub():
    def errors(state):
        total, (force, _) = multipliers(state).sum(0), hub_force_and_torque(state)
        return Errors(relative_error(total, force), relative_error(-total, force))

    return worst_of_both(errors)


@holds("PGV", "77 orbital", "resultant of the multipliers in the orbital frame, C_I^O F_lambda")
def reaction_in_orbital_frame():
    """The multiplier of each tether agrees, too; the package takes it from the equations of the root
    nodes."""

    def error(state):
        found = multipliers(state)
        return max(
            relative_error(state.orbital.T @ found.sum(0), state.seen["reaction_O"]),
            relative_error(found @ state.turn, state.seen["reaction_B"]),
        )

    return worst(error)


@fails(
    "PGV",
    "77 angle",
    "angle of the multipliers' resultant from Z_O",
    printed=r"\Gamma_\lambda = \tan^{-1}(F_3 / (F_1^2 + F_2^2)^{1/2})",
    right=r"\Gamma_\lambda = atan2((F_1^2 + F_2^2)^{1/2}, F_3)",
    consequence="90 deg minus the angle; F_3 is negative, so the printed angle is negative. The baseline's "
    "angle is between 94 and 179 deg; the printed one between -4 and -89 deg.",
)
def reaction_angle():
    return worst_of_both(lambda state: angle_errors(state.seen["reaction_O"], state.seen["reaction_angle"]))


@fails(
    "PGV",
    "78",
    "torque of the root reactions on the hub about its centre",
    printed=r"M_\lambda = \sum_i (\hat B^p \hat B_{i1} - (B_1^r + B_2^r)/2) q \times \lambda_i",
    right=r"the same with -\lambda_i",
    consequence="The sign, as in Eq. 77: the hub's Euler equations hold with -M_lambda.",
)
def torque_on_the_hub():
    def errors(state):
        anchors = np.array([(B_P @ node(i, 1) - 0.5 * (base(1) + base(2))) @ state.q for i in TETHERS])
        total, (_, torque) = np.cross(anchors, multipliers(state)).sum(0), hub_force_and_torque(state)
        seen = state.orbital @ state.seen["reaction_moment_O"]
        right = [
            relative_error(-total, torque),
            relative_error(total, seen),
            relative_error(state.centre, state.seen["hub_position_I"]),
        ]
        return Errors(relative_error(total, torque), max(right))

    return worst_of_both(errors)
