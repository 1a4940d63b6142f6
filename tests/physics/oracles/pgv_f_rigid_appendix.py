"""[PGV] App. B: from the base points of the hub to its shape matrix G, Eq. 128-134."""

import jax.numpy as jnp
import numpy as np

from . import pgv_a_forms as forms
from . import pgv_a_sail as sail
from .ledger import Errors, fails, holds, relative_error
from .pgv_f_hub import BASE, EACH, FROM_A, POINTS, Motion, base_points, observed

WIND = np.array([0.6, -1.1, 0.8])
"""u, any direction."""


def rigid_points() -> np.ndarray:
    """Base points of a body in shape."""
    return np.array([Motion.position(x) for x in BASE])


def local_axes(points: np.ndarray, u: np.ndarray | None) -> np.ndarray:
    """Columns i_B, j_B, k_B of Eq. 129; u is i_B where none is given."""
    ab, ac, _ = forms.edges(points).T
    i_b = ab / np.linalg.norm(ab)
    k_b = np.cross(i_b if u is None else u, ac)
    k_b = k_b / np.linalg.norm(k_b)
    return np.column_stack([i_b, np.cross(k_b, i_b), k_b])


def columns(points: np.ndarray) -> np.ndarray:
    """i_B, j_B, k_B of Eq. 130, one sum after the other."""
    ab, ac, ad = forms.edges(points).T
    return np.column_stack([a * ab + b * ac + c * ad for a, b, c in sail.ABC.T])


@holds("PGV", "128", "position by attitude", note="x is measured from r_1 = A. z_B in the text is k_B.")
def position_by_attitude():
    """The form, with the rotation matrix of Eq. 41, agrees with the package's weights and with a rigid
    motion."""
    errors = []
    for k in EACH:
        rotation = forms.edges(base_points(k)) @ sail.ABC
        printed = [base_points(k)[0] + rotation @ x for x in POINTS]
        errors.append(relative_error(printed, observed(k)["position"].T))
    rigid = [rigid_points()[0] + Motion.turn @ x for x in POINTS]
    judge = [Motion.position(x + BASE[0]) for x in POINTS]
    return max(*errors, relative_error(rigid, judge))


@fails(
    "PGV",
    "129",
    "axes of the body from its base points",
    printed=r"k_B = u \times r_AC / |u \times r_AC|; u is not defined here, in Sec. 2.2.3 it is the wind",
    right=r"k_B = i_B \times r_AC / |i_B \times r_AC|",
    consequence="With u the wind, i_B and k_B are not orthogonal: at a sailing angle of 10 deg k_B is off "
    "by 14 deg at the start of the baseline. Facing the Sun u is along i_B, and nothing shows.",
)
def axes_from_base_points():
    points = rigid_points()
    errors = (relative_error(local_axes(points, u), Motion.turn) for u in (WIND, None))
    return Errors(*errors)


@holds("PGV", "130", "axes of the body as combinations of its edges")
def axes_as_combinations():
    errors = [relative_error(columns(base_points(k)), observed(k)["rotation"]) for k in EACH]
    return max(*errors, relative_error(columns(rigid_points()), Motion.turn))


@fails(
    "PGV",
    "after 130",
    "which substitution gives Eq. 39",
    printed="Eq. 130 into Eq. 129",
    right="Eq. 130 into Eq. 128",
    consequence="None for a program. Eq. 129 has no position in it: the derivation cannot be followed.",
)
def substitution():
    """Eq. 130 in Eq. 128: r = r_1 + x i_B + y j_B + z k_B."""
    right = []
    for k in EACH:
        i_b, j_b, k_b = columns(base_points(k)).T
        substituted = [base_points(k)[0] + x * i_b + y * j_b + z * k_b for x, y, z in POINTS]
        eq_39 = [forms.hub_shape_matrix(x, sail.ABC) @ base_points(k).ravel() for x in POINTS]
        right.append(relative_error(substituted, eq_39))
    return Errors(np.inf, max(right))


def weights() -> np.ndarray:
    """g_1 to g_4 of the points, by the package."""
    from_centre = jnp.asarray((POINTS - FROM_A).T)
    return np.asarray(sail.sail().hub.weights(from_centre)).T


@holds("PGV", "131", "shape matrix of the body")
def body_shape_matrix():
    """3 x 12; every block a multiple of the unit matrix."""
    printed = [forms.hub_shape_matrix(x, sail.ABC) for x in POINTS]
    return relative_error(printed, [np.kron(g, np.eye(3)) for g in weights()])


@holds("PGV", "132", "weights of the base points")
def base_point_weights():
    """Those with which the base points have their centroid, of total 1, at x; and the package's."""
    printed = np.array([forms.hub_shape_matrix(x, sail.ABC)[0, ::3] for x in POINTS])
    extended = np.vstack([(BASE - BASE[0]).T, np.ones(4)])
    judge = np.linalg.solve(extended, np.column_stack([POINTS, np.ones(len(POINTS))]).T).T
    return max(relative_error(printed, judge), relative_error(printed, weights()))


@holds("PGV", "133", "the constants alpha, beta, gamma")
def constants_of_the_body():
    """Solved in I at some attitude they are what they are in the body frame."""
    points = rigid_points()
    solved = np.linalg.solve(forms.edges(points), local_axes(points, None))
    kept = np.asarray(sail.sail().hub._affine_inverse())[1:, :3]
    return max(relative_error(solved, kept), relative_error(sail.ABC, kept))


@holds("PGV", "134", "matrix of the edges", note="Not one of the Boolean matrices B of Sec. 2.")
def edge_matrix():
    """Columns, not rows; its determinant, six times the volume of A B C D, is h R^2."""
    height, radius, _ = sail.HUB
    errors = [relative_error(forms.edges(base_points(k)), observed(k)["edges"].T) for k in EACH]
    return max(*errors, relative_error(np.linalg.det(forms.edges(rigid_points())), height * radius**2))
