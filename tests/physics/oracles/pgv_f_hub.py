"""[PGV] Sec. 2.3: the rigid hub in natural coordinates, Eq. 39-52, and the orbital frame of Sec. 2.1."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax import iteration_matrix
from esail_jax.constants import ASTRONOMICAL_UNIT
from esail_jax.coordinates import Multipliers
from esail_jax.environment.orbit import orbital_frame

from . import pgv_a_forms as forms
from . import pgv_a_sail as sail
from .ledger import Errors, fails, holds, relative_error

M, N, P = sail.M, sail.N, sail.P
HEIGHT, RADIUS, DENSITY = sail.HUB
BASE = forms.local_base(HEIGHT, RADIUS)
FROM_A = np.array([0.5 * HEIGHT, 0.0, 0.0])
"""Vector from base point A, the origin of App. B's local frame, to the centre, the origin of the B
frame."""

EACH = (0, 1)
POINTS = np.random.default_rng(8).normal(size=(5, 3))
"""Points of the body, from A."""


def base_points(k: int) -> np.ndarray:
    """The base points of state k. The body is deformed, which matters only to the formulas of
    motion."""
    return sail.states()[k].q[:12].reshape(4, 3)


class Motion:
    """A rigid motion: attitude, angular velocity in I, position and velocity of the centre."""

    random = np.random.default_rng(9)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn = turn * np.linalg.det(turn)
    omega, centre, speed = random.normal(size=(3, 3))

    @classmethod
    def position(cls, body: np.ndarray) -> np.ndarray:
        """The position of a point given from the centre in body axes."""
        return cls.centre + cls.turn @ body

    @classmethod
    def velocity(cls, body: np.ndarray) -> np.ndarray:
        return cls.speed + np.cross(cls.omega, cls.turn @ body)


@functools.partial(jax.jit, compiler_options=sail.QUICKLY)
def _observed(points, lam, locations):
    hub = sail.sail().hub
    found = {
        "position": points.T @ hub.weights(locations),
        "rotation": hub.rotation(points),
        "edges": hub.edges(points),
        "centre": hub.centre(points),
        "constraints": hub.constraints(points),
        "orbital": orbital_frame(jnp.asarray(sail.ORIGIN) + hub.centre(points)),
        "mass": hub.mass_matrix,
        "base": hub.base_points,
    }
    q = sail.unflat(jnp.zeros(M))._replace(hub=points)
    return found | {"border": iteration_matrix.hub_border(sail.sail(), q, Multipliers(lam, None))}


@functools.cache
def observed(k: int) -> dict[str, np.ndarray]:
    """The package's results for the hub at state k."""
    inputs = (base_points(k), sail.states()[k].lam, (POINTS - FROM_A).T)
    return {name: np.asarray(x) for name, x in _observed(*(jnp.asarray(x) for x in inputs)).items()}


@holds(
    "PGV", "39", "position of a point of the body", note="x is measured from base point A, as in App. B."
)
def body_position():
    errors = []
    for k in EACH:
        printed = [forms.hub_shape_matrix(x, sail.ABC) @ base_points(k).ravel() for x in POINTS]
        errors.append(relative_error(printed, observed(k)["position"].T))
    return max(errors)


@holds("PGV", "40", "natural coordinates")
def natural_coordinates():
    """r_1 to r_4 are the points where the package has A, B, C, D."""
    d = base_points(0).ravel()
    printed = [forms.hub_shape_matrix(x + FROM_A, sail.ABC) @ d for x in observed(0)["base"]]
    return max(relative_error(np.concatenate(printed), d), relative_error(BASE, observed(0)["base"]))


@holds("PGV", "41", "rotation matrix")
def rotation_matrix():
    """The form holds for a deformed body, and for a rigid one, where the judge is its attitude."""
    errors = [relative_error(forms.edges(base_points(k)) @ sail.ABC, observed(k)["rotation"]) for k in EACH]
    rigid = np.array([Motion.position(x) for x in BASE])
    return max(*errors, relative_error(forms.edges(rigid) @ sail.ABC, Motion.turn))


@holds("PGV", "42", "edges from A")
def edges_from_a():
    return max(relative_error(forms.edges(base_points(k)).T, observed(k)["edges"]) for k in EACH)


@holds(
    "PGV",
    "43",
    "position of the centre",
    note="The text refers to Eq. 10 for the Boolean matrices of points; they are those of Eq. 7.",
)
def centre():
    errors = []
    for k in EACH:
        r_1, r_2 = base_points(k)[:2]
        first, second = (forms.point_boolean(point, N, P) for point in (1, 2))
        by_matrix = 0.5 * (first + second) @ sail.states()[k].q
        errors += [relative_error(x, observed(k)["centre"]) for x in (0.5 * (r_1 + r_2), by_matrix)]
    return max(errors)


@holds("PGV", "44", "radial axis of the orbital frame")
def radial_axis():
    """And, from Sec. 2.1, i_O along k_H x k_O and j_O completing the frame."""
    errors = []
    for k in EACH:
        position = sail.ORIGIN + 0.5 * (base_points(k)[0] + base_points(k)[1])
        k_o = position / np.linalg.norm(position)
        i_o = np.cross([0, 0, 1], k_o)
        i_o = i_o / np.linalg.norm(i_o)
        frame = np.column_stack([i_o, np.cross(k_o, i_o), k_o])
        errors += [relative_error(frame, observed(k)["orbital"]), np.abs(np.linalg.det(frame) - 1)]
    return max(errors)


@fails(
    "PGV",
    "Sec. 2.1, order of R",
    "order of magnitude of the heliocentric position at 1 AU",
    printed="10^12 m",
    right="10^11 m (1 AU = 1.496e11 m)",
    consequence="The argument for the inertial frame stands: doubles near 1 AU are 3e-5 m apart, which the "
    "printed order makes 1.2e-4 m.",
)
def order_of_the_heliocentric_distance():
    """Powers of ten."""
    order = 10.0 ** np.floor(np.log10(ASTRONOMICAL_UNIT))
    return Errors(relative_error(1e12, order), relative_error(1e11, order))


@holds("PGV", "45", "constraints of rigidity")
def rigidity_constraints():
    """The package divides each row by a length, which makes them distances."""
    errors = []
    for k in EACH:
        printed = forms.rigidity(base_points(k), BASE)
        errors.append(relative_error(printed, observed(k)["constraints"] * sail.SCALES))
    return max(errors)


def jacobian_as_printed(points: np.ndarray) -> np.ndarray:
    """Eq. 46 to the letter: rows in the first half, columns in the second."""
    ab, ac, ad = (edge[:, None] for edge in forms.edges(points).T)
    o = np.zeros((1, 3))
    return np.block(
        [
            [-2 * ab.T, 2 * ab.T, o, o],
            [-2 * ac.T, o, 2 * ac.T, o],
            [-2 * ad.T, o, o, 2 * ad.T],
            [-ab - ac, ac, ab, o],
            [-ab - ad, ad, o, ab],
            [-ac - ad, o, ad, ac],
        ]
    )


@fails(
    "PGV",
    "46",
    "Jacobian of rigidity",
    printed="rows 4 to 6 of columns: -r_AB - r_AC, r_AC, r_AB, 0_{1x3} and so on",
    right="rows 4 to 6 transposed: -(r_AB + r_AC)^T, r_AC^T, r_AB^T, 0_{1x3} and so on",
    consequence="The blocks do not fit: 3 x 1 beside 1 x 3. There is no matrix until they are transposed.",
)
def rigidity_jacobian():
    judges = [observed(k)["border"][12:, :12] * sail.SCALES[:, None] for k in EACH]
    right = [relative_error(forms.rigidity_jacobian(base_points(k)), judges[k]) for k in EACH]
    try:
        printed = relative_error(jacobian_as_printed(base_points(0)), judges[0])
    except ValueError:
        printed = np.inf
    return Errors(printed, max(right))


@holds(
    "PGV",
    "47",
    "force of the rigidity, component by component",
    note="For C_r,d^T lam; in q it has m rows.",
)
def rigidity_force():
    """The judge is the part that the package adds to its equations of motion."""
    errors = []
    for k in EACH:
        state, parts, by_vdot = (
            sail.states()[k],
            sail.derivatives(k).value,
            sail.derivatives(k).vdot.residual,
        )
        c, lam = forms.rigidity_jacobian(base_points(k)), state.lam / sail.SCALES
        printed = [sum(c[j, i] * lam[j] for j in range(6)) for i in range(12)]
        judge = parts.residual - by_vdot @ state.vdot + parts.elastic + parts.coulomb + parts.damping
        errors += [relative_error(printed, judge[:12]), np.abs(judge[12:]).max()]
    return max(errors)


@holds("PGV", "48", "geometric stiffness of the rigidity")
def rigidity_stiffness():
    """The judge is the package's Hessian of lam . C, which it adds to the hub's mass."""
    errors = []
    for k in EACH:
        mass = np.kron(observed(k)["mass"], np.eye(3))
        judge = observed(k)["border"][:12, :12] - mass
        errors.append(relative_error(forms.rigidity_curvature(sail.states()[k].lam / sail.SCALES), judge))
    return max(errors)


@fails(
    "PGV",
    "49",
    "geometric stiffness of the rigidity in all coordinates",
    printed=r"d(C_{r,q}^T \lambda_r)/dq = d(C_{r,d}^T \lambda_r)/dd  B^r",
    right=r"d(C_{r,q}^T \lambda_r)/dq = (B^r)^T d(C_{r,d}^T \lambda_r)/dd  B^r",
    consequence="The printed product is 12 x m and cannot be added to the m x m matrix of Eq. 13.",
)
def rigidity_stiffness_in_q():
    printed, right = [], []
    for k in EACH:
        by_q, boolean = sail.derivatives(k).q, forms.hub_boolean(N, P)
        judge = by_q.residual + by_q.elastic + by_q.coulomb + by_q.damping
        block = forms.rigidity_curvature(sail.states()[k].lam / sail.SCALES)
        printed.append(relative_error(block @ boolean, judge))
        right.append(relative_error(boolean.T @ block @ boolean, judge))
    return Errors(min(printed), max(right))


def rigid_rates() -> np.ndarray:
    """d' of a rigid motion."""
    return np.concatenate([Motion.velocity(x) for x in BASE])


@holds("PGV", "50", "velocity of a point of the body")
def body_velocity():
    """The judge is v + omega x r of a rigid motion."""
    printed = [forms.hub_shape_matrix(x, sail.ABC) @ rigid_rates() for x in POINTS]
    return relative_error(printed, [Motion.velocity(x - FROM_A) for x in POINTS])


@holds("PGV", "51", "kinetic energy of the body")
def body_energy():
    """The judge is m v^2/2 + omega . J omega/2 with the moments of inertia of a solid cylinder."""
    mass = DENSITY * np.pi * RADIUS**2 * HEIGHT
    axial, across = mass * RADIUS**2 / 2, mass * (3 * RADIUS**2 + HEIGHT**2) / 12
    omega = Motion.turn.T @ Motion.omega
    judge = 0.5 * mass * Motion.speed @ Motion.speed + 0.5 * omega**2 @ [axial, across, across]
    rates = rigid_rates()
    return relative_error(0.5 * rates @ forms.hub_mass(*sail.HUB) @ rates, judge)


@holds("PGV", "52", "mass matrix of the body")
def body_mass():
    return relative_error(forms.hub_mass(*sail.HUB), np.kron(observed(0)["mass"], np.eye(3)))
