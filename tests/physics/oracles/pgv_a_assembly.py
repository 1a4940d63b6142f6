"""[PGV] Sec. 2: the equations of motion, Eq. 1-3, and their assembly from parts, Eq. 4-11."""

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.coordinates import Coordinates
from esail_jax.joints.roots import FrameRoots, clamp_normals
from esail_jax.system import System

from . import pgv_a_forms as forms
from . import pgv_a_sail as sail
from .ledger import Errors, fails, holds, relative_error

M, N, P = sail.M, sail.N, sail.P
EACH = (0, 1)
"""The states."""


def worst(errors) -> float:
    return max(errors)


@holds(
    "PGV",
    "1",
    "second derivative of constraints that move",
    note="Read for C(q, t). The text writes C(q', q, t), for which terms would be missing.",
)
def rheonomic_constraints():
    """Clamps on a frame that turns: the package's only constraints that depend on time."""
    azimuth = jnp.asarray([0.3, 1.9, 4.0])
    frame = FrameRoots(jnp.eye(3), jnp.asarray(0.7), jnp.zeros((3, P)), clamp_normals(azimuth))
    tethers = sail.sail().tethers
    turning = System(tethers, frame, None, (), (), ())
    random = np.random.default_rng(3)
    q, v, time = *random.normal(size=(2, 2 * 3 * N * P)), jnp.asarray(0.4)

    def whole(x):
        return Coordinates(x.reshape(2, 3, N, P), None)

    @jax.jit
    def both(q, v):
        def c(q, t):
            return turning.constraints(t, whole(q)).clamp.reshape(-1)

        c_t = jax.jacfwd(c, 1)
        c_q = jax.jacfwd(c, 0)
        c_tt = jax.jacfwd(c_t, 1)(q, time)
        along = jax.jacfwd(lambda q: c_q(q, time) @ v)(q) @ v
        mixed = jax.jacfwd(lambda t: c_q(q, t))(time) @ v
        judge = turning.constraint_acceleration(time, whole(q), whole(v), whole(jnp.zeros_like(v)))
        return -c_tt - along - 2 * mixed, -judge.clamp.reshape(-1)

    return relative_error(*both(jnp.asarray(q), jnp.asarray(v)))


def constraint_force(v: np.ndarray) -> np.ndarray:
    """Eq. 2 for Eq. 45 and 53, whose Jacobians are linear and constant: (C_q v)_q v = C_q(v) v."""
    return -sail.constraint_jacobian(v) @ v


@holds("PGV", "2", "second derivative of constraints that rest")
def scleronomic_constraints():
    errors = []
    for k in EACH:
        joints, rigid = np.split(constraint_force(sail.states()[k].v), [3 * P])
        errors += [relative_error(rigid, -sail.solved(k).bend), np.abs(joints).max()]
    return worst(errors)


@holds("PGV", "3", "equations of motion and constraints in one matrix")
def accelerations_and_multipliers():
    """Solved as printed, in all coordinates, against the package's consistent acceleration."""
    errors = []
    for k in EACH:
        state, parts = sail.states()[k], sail.derivatives(k).value
        c_q = sail.constraint_jacobian(state.q)
        applied = parts.elastic + parts.coulomb + parts.damping
        right = np.concatenate([applied, constraint_force(state.v)])
        matrix = np.block([[sail.mass_matrix(), c_q.T], [c_q, np.zeros((len(c_q),) * 2)]])
        vdot, _, lam = np.split(np.linalg.solve(matrix, right), [M, M + 3 * P])
        judge = sail.solved(k).acceleration
        errors += [relative_error(vdot, judge[:M]), relative_error(lam, judge[M:])]
    return worst(errors)


@fails(
    "PGV",
    "3, index",
    "which constraint residual belongs to the iteration matrix",
    printed="Eq. 3, whose second row is C_q q'' = Q_lambda, is called 'the index-3 DAE', and its "
    "fulfilment is said to satisfy the position constraints",
    right="second row of the index-3 system: C(q) = 0, so r_lambda = C(q). Eq. 3 is of index 1",
    consequence="With the second row of Eq. 3 as residual, the lower left block of Eq. 13 is too small by "
    "v', 273 1/s^2 at h = 0.1 s: on the baseline each iteration multiplies the error of the constraints by "
    "270, and Newton diverges. With a matrix to match, the constraints drift.",
)
def constraint_residual():
    """Eq. 13 has C_q below: that is the derivative of C(q), not of the second row of Eq. 3."""
    printed, right = [], []
    for k in EACH:
        _, v, vdot, _ = sail.states()[k]
        points = [x[:12].reshape(4, 3) for x in (sail.states()[k].q, v, vdot)]
        block = forms.rigidity_jacobian(points[0])
        v_factor, mu_factor = forms.step_correction(sail.STEP, sail.RHO)
        of_eq_3 = v_factor * block + 2 * mu_factor * forms.rigidity_jacobian(points[1])
        of_eq_3 = of_eq_3 + forms.rigidity_jacobian(points[2])
        judge = sail.solved(k).matrix[-6:, -18:-6]
        printed.append(relative_error(of_eq_3, block))
        right.append(relative_error(block, sail.SCALES[:, None] * judge))
    return Errors(min(printed), max(right))


def random_nodal() -> tuple[np.ndarray, Coordinates]:
    """Numbers for q, flat and as the package keeps them."""
    q = np.random.default_rng(4).normal(size=M)
    return q, sail.unflat(jnp.asarray(q))


@holds("PGV", "4", "order and number of the generalized coordinates")
def coordinate_vector():
    """d, then tether by tether, node by node, position and slope: built as printed."""
    q, kept = random_nodal()
    parts = [kept.hub[k] for k in range(4)]
    parts += [kept.tether[:, :, j, i].reshape(-1) for i in range(P) for j in range(N)]
    return relative_error(np.concatenate(parts), q)


@holds(
    "PGV",
    "Sec. 2, counts",
    "m = 6 n p + 12 coordinates, c = 6 + 3 p constraints, s = 6 + 3 (2 n - 1) p degrees of freedom",
)
def degrees_of_freedom():
    m, c, s = 6 * N * P + 12, 6 + 3 * P, 6 + 3 * (2 * N - 1) * P
    kept = sail.sail().tethers.uniform(jnp.zeros(3)).size + sail.sail().hub.base_points.size
    independent = len(sail.solved(0).matrix) - 2 * 6
    rank = np.linalg.matrix_rank(sail.constraint_jacobian(sail.states()[0].q))
    return relative_error([m, c, s, m - c], [kept, rank, independent, independent])


@holds("PGV", "5", "coordinates of a node")
def node_coordinates():
    q, kept = random_nodal()
    pairs = [(i, j) for i in range(1, P + 1) for j in range(1, N + 1)]
    picked = [forms.node_boolean(i, j, N, P) @ q for i, j in pairs]
    return relative_error(picked, [kept.tether[:, :, j - 1, i - 1].reshape(-1) for i, j in pairs])


@holds("PGV", "6", "Boolean matrix of a node")
def node_matrix():
    """6 x m; the matrices of all nodes and points together are the identity."""
    blocks = [forms.node_boolean(i, j, N, P) for i in range(1, P + 1) for j in range(1, N + 1)]
    points = [forms.point_boolean(k, N, P) for k in (1, 2, 3, 4)]
    wrong = [b.shape != (6, M) for b in blocks]
    return max(relative_error(np.vstack(points + blocks), np.eye(M)), *wrong)


@holds("PGV", "7", "Boolean matrix of a base point")
def point_matrix():
    q, kept = random_nodal()
    return relative_error([forms.point_boolean(k, N, P) @ q for k in (1, 2, 3, 4)], kept.hub)


@holds("PGV", "8", "coordinates of an element")
def element_coordinates():
    """The package keeps slopes times l within an element."""
    q, kept = random_nodal()
    tethers = sail.sail().tethers
    vectors = np.asarray(tethers.of_tethers(tethers.element_vectors(kept.tether)))
    pairs = [(i, j) for i in range(1, P + 1) for j in range(1, N)]
    printed = [forms.element_boolean(i, j, N, P) @ q for i, j in pairs]
    scale = np.array([[1.0, length, 1.0, length] for length in sail.LENGTHS])[:, :, None]
    judge = [(vectors[:, :, j - 1, i - 1] / scale[i - 1]).reshape(-1) for i, j in pairs]
    return relative_error(printed, judge)


@holds("PGV", "9", "assembly of generalized forces")
def assembled_forces():
    random = np.random.default_rng(5)
    elementwise, hub = random.normal(size=(4, 3, N - 1, P)), random.normal(size=12)
    total = forms.hub_boolean(N, P).T @ hub
    for i in range(1, P + 1):
        scale = np.array([1.0, sail.LENGTHS[i - 1]] * 2)[:, None]
        for j in range(1, N):
            force = (elementwise[:, :, j - 1, i - 1] * scale).reshape(-1)
            total = total + forms.element_boolean(i, j, N, P).T @ force
    tether = sail.sail().tethers.assemble(jnp.asarray(elementwise.reshape(4, 3, -1)))
    return relative_error(total, sail.flat(Coordinates(tether, jnp.asarray(hub.reshape(4, 3)))))


@holds("PGV", "10", "Boolean matrix of the rigid body")
def hub_matrix():
    q, kept = random_nodal()
    return relative_error(forms.hub_boolean(N, P) @ q, kept.hub.reshape(-1))


@holds(
    "PGV",
    "11",
    "assembly of the mass matrix",
    note="The remote units come on top, as the text before Eq. 1 says.",
)
def assembled_mass():
    """The judge is the derivative of the package's equations of motion by the acceleration."""
    return worst(relative_error(sail.mass_matrix(), sail.derivatives(k).vdot.residual) for k in EACH)
