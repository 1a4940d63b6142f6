"""[PGV] Sec. 3.3-3.4: attitude of the hub and of the sail in the orbital frame.

The judges are the package's observables of random states, and the rotation with which those states were
made.
"""

import numpy as np

from oracles.ledger import Errors, fails, holds, relative_error
from oracles.sail_states import B_P, NODES, P, State, about, node, worst, worst_of_both

TETHERS = range(1, P + 1)

# ---- 3.3 orientation of the hub ---------------------------------------------------------------


@holds("PGV", "65", "Euler angles psi, theta, phi of the hub: sequence Z-Y-X")
def euler_angles_of_the_hub():
    def error(state):
        psi, theta, phi = state.seen["euler_hub"]
        sequence = about(2, psi) @ about(1, theta) @ about(0, phi)
        return relative_error(sequence, state.orbital.T @ state.turn)

    return worst(error)


@fails(
    "PGV",
    "66",
    "rotation between the frames I and O",
    printed=r"C_I^O = [X_O Y_O Z_O]",
    right=r"C_O^I = [X_O Y_O Z_O], C_I^O its transpose (Sec. 2.1: r^I = C_O^I r^O)",
    consequence="Eq. 74 with the printed matrix puts the baseline's thrust 40 deg from the Sun's "
    "direction instead of 5 deg.",
)
def inertial_to_orbital():
    """C_I^O takes components of the tips in I to components in O."""

    def errors(state):
        tips = state.anchor_to_tip.T
        axes = state.orbital
        truth = np.array([axes[:, k] @ tips for k in range(3)])
        return Errors(relative_error(axes @ tips, truth), relative_error(axes.T @ tips, truth))

    return worst_of_both(errors)


@holds(
    "PGV",
    "66 hub",
    "C_O^B = C_I^B C_I^O",
    note="Two slips cancel: with the matrix of Eq. 66, which is C_O^I, the product is C_I^B C_O^I, as it "
    "must be. C_I^B is the transpose of Eq. 41.",
)
def orbital_to_body():
    def error(state):
        psi, theta, phi = state.seen["euler_hub"]
        truth = (about(2, psi) @ about(1, theta) @ about(0, phi)).T
        return relative_error(state.turn.T @ state.orbital, truth)

    return worst(error)


# ---- 3.4 orientation of the sail --------------------------------------------------------------


def tips(state: State) -> np.ndarray:
    """r_ui of Eq. 69: (tether, xyz)."""
    return np.array([B_P @ node(i, NODES) @ state.q for i in TETHERS])


def right_axes(state: State) -> np.ndarray:
    """Columns i_E, j_E, k_E: Eq. 70 with the unit normal on the side of X_B."""
    offsets = tips(state) - tips(state).mean(0)
    normal = np.linalg.svd(offsets)[2][-1]
    normal *= np.sign(normal @ state.turn[:, 0])
    k = np.cross(normal, offsets[0])
    k /= np.linalg.norm(k)
    return np.column_stack([normal, np.cross(k, normal), k])


@fails(
    "PGV",
    "67",
    "normal of the mean plane of the tips",
    printed=r"\tilde n is the least-squares solution of (r_ui - r_u)^T \tilde n = 0",
    right=r"the unit vector with the least sum of squares: the right singular vector of the smallest "
    r"singular value, with the sign that makes i_E . i_B > 0",
    consequence="The least-squares solution of a homogeneous system is zero, and Eq. 70 divides by its "
    "length; the sign of the normal is left open.",
)
def normal_of_the_mean_plane():
    def errors(state):
        offsets = tips(state) - tips(state).mean(0)
        printed = np.linalg.lstsq(offsets, np.zeros(P), rcond=None)[0]
        truth = state.seen["sail_axes"][:, 0]
        return Errors(relative_error(printed, truth), relative_error(right_axes(state)[:, 0], truth))

    return worst_of_both(errors)


@holds("PGV", "68", "centre of gravity of equal remote units")
def centre_of_the_tips():
    """The point with the least sum of squared distances from them."""

    def error(state):
        truth = np.linalg.lstsq(np.tile(np.eye(3), (P, 1)), tips(state).reshape(-1), rcond=None)[0]
        return relative_error(sum(tips(state)) / P, truth)

    return worst(error)


@holds("PGV", "69", "positions of the remote units, by Boolean matrices")
def positions_of_the_tips():
    return worst(lambda state: relative_error(tips(state), state.seen["tip_position_I"]))


@fails(
    "PGV",
    "70",
    "axes of the frame E",
    printed=r"k_E = i_E \times (r_{u1}^T - r_u) / |...|",
    right=r"k_E = i_E \times (r_{u1} - r_u) / |...|",
    consequence="A row minus a column: three by three numbers where software expands them silently, and "
    "no cross product. Read as columns, the axes are right.",
)
def axes_of_the_sail():
    def errors(state):
        first, mean = tips(state)[:1], tips(state).mean(0)[:, None]
        normal = state.seen["sail_axes"][:, 0]
        printed = np.cross(normal, first - mean)
        return Errors(
            relative_error(printed / np.linalg.norm(printed), state.seen["sail_axes"][:, 2]),
            relative_error(right_axes(state), state.seen["sail_axes"]),
        )

    return worst_of_both(errors)


@fails(
    "PGV",
    "71",
    "Euler angles of the sail",
    printed=r"rotations Z^O \Psi, Y^P \Theta, Z^{P'} \Phi",
    right=r"Z^O \Psi, Y^P \Theta, X^{P'} \Phi, the sequence of Eq. 65",
    consequence="With Z-Y-Z the attitude of the hub and of the sail cannot be compared angle by angle "
    "(Fig. 10 c), and -90 deg < Theta < 0, the start of every run, is outside that sequence's range.",
)
def euler_angles_of_the_sail():
    def errors(state):
        psi, theta, phi = state.seen["euler_sail"]
        truth, start = state.orbital.T @ right_axes(state), about(2, psi) @ about(1, theta)
        return Errors(
            relative_error(start @ about(2, phi), truth), relative_error(start @ about(0, phi), truth)
        )

    return worst_of_both(errors)


@fails(
    "PGV",
    "71 matrix",
    "rotation from O to E",
    printed=r"C_O^E = C_I^E C_O^I with C_I^E = [i_E j_E k_E]",
    right=r"C_O^E = (C_E^I)^T C_O^I with C_E^I = [i_E j_E k_E]",
    consequence="[i_E j_E k_E] takes components in E to I: the product is not a rotation between O and E "
    "under either reading of Eq. 66, and its angles mean nothing.",
)
def orbital_to_sail():
    def errors(state):
        psi, theta, phi = state.seen["euler_sail"]
        truth = (about(2, psi) @ about(1, theta) @ about(0, phi)).T
        axes = right_axes(state)
        readings = [axes @ state.orbital, axes @ state.orbital.T]
        return Errors(
            min(relative_error(x, truth) for x in readings),
            relative_error(axes.T @ state.orbital, truth),
        )

    return worst_of_both(errors)


@holds(
    "PGV",
    "71 sailing",
    "sailing angle alpha = acos(i_B . k_O)",
    note="It is the hub's; the words before it and Fig. 1(b) speak of X_E, the sail's.",
)
def sailing_angle():
    def error(state):
        return relative_error(
            np.arccos(state.turn[:, 0] @ state.orbital[:, 2]), state.seen["sailing_angle"]
        )

    return worst(error)


@fails(
    "PGV",
    "71 precession",
    "precession angle, from X_O to the projection of X_E on X_O Y_O",
    printed=r"\delta = \cos^{-1}(i_{E1}^O)",
    right=r"\delta = atan2(i_{E2}^O, i_{E1}^O)",
    consequence="At the start of the baseline (alpha = 10 deg) X_E lies in the plane X_O Z_O: delta = 0, "
    "but the printed formula gives 80 deg. It has no sign either.",
)
def precession_angle():
    def errors(state):
        one, two, _ = state.orbital.T @ right_axes(state)[:, 0]
        truth = state.seen["precession_angle"]
        return Errors(relative_error(np.arccos(one), truth), relative_error(np.arctan2(two, one), truth))

    return worst_of_both(errors)
