"""[PGV] Sec. 3.1-3.2: coning and lagging angles, angular velocity.

The judges are the package's observables of random states, and the rotation and angular velocity with which
those states were made.
"""

import numpy as np

from oracles.ledger import Errors, fails, holds, relative_error
from oracles.sail_states import (
    B_P,
    B_S,
    HEIGHT,
    RADIUS,
    P,
    State,
    azimuth,
    base,
    body_to_local,
    node,
    skew,
    worst,
    worst_of_both,
)

TETHERS = range(1, P + 1)


def local(state: State, vectors: np.ndarray) -> np.ndarray:
    """Eq. 58 for one vector per tether."""
    return np.array([body_to_local(azimuth(i)) @ state.turn.T @ vectors[i - 1] for i in TETHERS])


def root_slopes(state: State) -> np.ndarray:
    """tau_i^I as printed in Eq. 60."""
    return np.array([B_S @ node(i, 1) @ state.q for i in TETHERS])


# ---- 3.1 coning and lagging -------------------------------------------------------------------


@holds("PGV", "56", "tip relative to the anchor point, by Boolean matrices")
def tip_relative_to_anchor():
    def error(state):
        anchors = state.centre + RADIUS * np.array(
            [state.turn @ [0.0, np.cos(azimuth(i)), np.sin(azimuth(i))] for i in TETHERS]
        )
        return relative_error(state.anchor_to_tip, state.seen["tip_position_I"] - anchors)

    return worst(error)


@holds("PGV", "57", "axes of tether i: X_B, outward, azimuthal, at zeta_i = 2 pi (i-1)/p from Y_B")
def axes_of_a_tether():
    """The anchor lies on the second axis, X_B is the first, and the frame is right-handed."""

    def error(state):
        found = []
        for i in TETHERS:
            matrix = body_to_local(azimuth(i))
            anchor = matrix @ state.turn.T @ (B_P @ node(i, 1) @ state.q - state.centre)
            found.append(relative_error(anchor, RADIUS * np.eye(3)[1]))
            found.append(relative_error(matrix @ [1.0, 0.0, 0.0], np.eye(3)[0]))
            found.append(abs(np.linalg.det(matrix) - 1.0))
        return max(found)

    return worst(error)


@holds("PGV", "58", "components in the axes of the tether")
def components_in_tether_axes():
    """The form uses the C_B^I that the package reports."""

    def error(state):
        return max(
            relative_error(local(state, state.anchor_to_tip), state.seen["local"]),
            relative_error(state.turn, state.seen["rotation_IB"]),
        )

    return worst(error)


@fails(
    "PGV",
    "59 coning",
    "coning angle",
    printed=r"\gamma_i = \tan^{-1}(\rho_{i1} / (\rho_{i2}^2 + \rho_{i3}^2))",
    right=r"\gamma_i = \tan^{-1}(\rho_{i1} / (\rho_{i2}^2 + \rho_{i3}^2)^{1/2}), as in Eq. 61",
    consequence="The argument has the dimension 1/m: a 10 km tether that cones by 1 deg is said to cone "
    "by 1e-4 deg.",
)
def coning_angle():
    def errors(state):
        one, two, three = local(state, state.anchor_to_tip).T
        printed = np.arctan(one / (two**2 + three**2))
        right = np.arctan(one / np.sqrt(two**2 + three**2))
        truth = state.seen["coning_angle"]
        return Errors(relative_error(printed, truth), relative_error(right, truth))

    return worst_of_both(errors)


def sense(state):
    """The sense of the spin of the whole sail, in which lagging angles are counted here; the paper's sails
    spin about X_B."""
    return np.where(state.seen["spin_rate"][1] < 0.0, -1.0, 1.0)


@holds("PGV", "59 lagging", "lagging angle", note="Below 90 deg; beyond, atan2 is needed.")
def lagging_angle():
    def error(state):
        _, two, three = local(state, state.anchor_to_tip).T
        return relative_error(sense(state) * np.arctan(three / two), state.seen["lagging_angle"])

    return worst(error)


@holds("PGV", "60", "slope at the root, by Boolean matrices")
def slope_at_the_root():
    """The derivative of the first element's interpolation at its start."""
    return worst(lambda state: relative_error(root_slopes(state), state.seen["root_slopes"]))


@holds("PGV", "61", "root coning and root lagging angle")
def root_angles():
    def error(state):
        one, two, three = local(state, root_slopes(state)).T
        coning = np.arctan(one / (two**2 + three**2) ** 0.5)
        truth = np.array([state.seen["root_coning_angle"], state.seen["root_lagging_angle"]])
        return relative_error([coning, sense(state) * np.arctan(three / two)], truth)

    return worst(error)


# ---- 3.2 angular velocity ---------------------------------------------------------------------

PRINTED_EDGES = np.diag([HEIGHT, RADIUS, RADIUS])
"""x_B, x_C, x_D as columns, printed before Eq. 63."""

EDGES = np.array([[HEIGHT, HEIGHT / 2, HEIGHT / 2], [0.0, RADIUS, 0.0], [0.0, 0.0, RADIUS]])
"""The same from A for the base points of Sec. 4.1: C = (0, R, 0) and D = (0, 0, R) from the centre."""


def edge_rates(state: State) -> np.ndarray:
    """r_AB', r_AC', r_AD' as columns."""
    return np.column_stack([(base(k) - base(1)) @ state.v for k in (2, 3, 4)])


@holds("PGV", "62", "velocity of a hub point, x measured from A")
def velocity_of_a_hub_point():
    """The anchors, whose velocities the package gives to the root nodes."""

    def error(state):
        found, truth = [], []
        for i in TETHERS:
            x = [HEIGHT / 2, RADIUS * np.cos(azimuth(i)), RADIUS * np.sin(azimuth(i))]
            found.append(base(1) @ state.v + state.turn @ skew(state.omega) @ x)
            truth.append(B_P @ node(i, 1) @ state.v)
        return relative_error(found, truth)

    return worst(error)


@fails(
    "PGV",
    "63",
    "velocities of the base points",
    printed=r"x_C = [0, R_r, 0]^T and x_D = [0, 0, R_r]^T as vectors from A",
    right=r"with d(0) of Sec. 4.1 (A = (-h_r/2, 0, 0), C = (0, R_r, 0), D = (0, 0, R_r)): "
    r"x_C = [h_r/2, R_r, 0]^T, x_D = [h_r/2, 0, R_r]^T",
    consequence="Sec. 3.2 and Sec. 4.1 describe different base points. For a spin about X_B alone both "
    "give the same velocities.",
)
def velocities_of_base_points():
    def errors(state):
        truth, turning = edge_rates(state), state.turn @ skew(state.omega)
        return Errors(
            relative_error(turning @ PRINTED_EDGES, truth), relative_error(turning @ EDGES, truth)
        )

    return worst_of_both(errors)


@fails(
    "PGV",
    "64",
    "angular velocity of the hub",
    printed=r"\tilde\omega = C_I^B [r_AB' r_AC' r_AD'] [x_B x_C x_D]^{-1} with the x of Eq. 63",
    right=r"the same with x_C = [h_r/2, R_r, 0]^T, x_D = [h_r/2, 0, R_r]^T",
    consequence="The printed matrix is not antisymmetric. On the baseline hub (h_r = 2 R_r) its entry "
    "(3, 2) is omega_1 - omega_2 and its entry (2, 3) is -(omega_1 - omega_3).",
)
def angular_velocity_of_the_hub():
    def errors(state):
        truth = skew(state.seen["angular_velocity_B"])
        rates = state.turn.T @ edge_rates(state)
        return Errors(
            relative_error(rates @ np.linalg.inv(PRINTED_EDGES), truth),
            max(
                relative_error(rates @ np.linalg.inv(EDGES), truth),
                relative_error(state.omega, state.seen["angular_velocity_B"]),
            ),
        )

    return worst_of_both(errors)
