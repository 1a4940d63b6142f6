"""[PGV] Sec. 2, DAE integration: Newton's corrections and tangents, Eq. 12-15, and the method's numbers."""

import functools

import jax.numpy as jnp
import numpy as np

from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.method_choice import with_method
from esail_jax.steppers.fixed_step_state import StepState
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.system import Power

from . import pgv_a_forms as forms
from . import pgv_a_sail as sail
from .ledger import Errors, fails, holds, relative_error

M, N, P = sail.M, sail.N, sail.P
EACH = (0, 1)
RADII = (0.1, 0.25, 0.8)
"""Spectral radii; none of them makes a parameter vanish."""


def geometric_stiffness(k: int) -> np.ndarray:
    """d(C_q^T lam)/dq by Eq. 48; the joints are linear."""
    total = np.zeros((M, M))
    total[:12, :12] = forms.rigidity_curvature(sail.states()[k].lam / sail.SCALES)
    return total


def damping_tangent(k: int) -> np.ndarray:
    """C_t, last member of Eq. 14."""
    return -sail.derivatives(k).v.damping


def stiffness_tangent(k: int) -> np.ndarray:
    """K_t, last member of Eq. 15."""
    by_q = sail.derivatives(k).q
    return -by_q.elastic - by_q.coulomb - by_q.damping + geometric_stiffness(k)


def iteration_matrix(k: int) -> np.ndarray:
    """S_t of Eq. 13: in q, the multipliers of the joints and those of the hub."""
    v_factor, mu_factor = forms.step_correction(sail.STEP, sail.RHO)
    c_q = sail.constraint_jacobian(sail.states()[k].q)
    block = sail.mass_matrix() * v_factor + damping_tangent(k) * mu_factor + stiffness_tangent(k)
    return np.block([[block, c_q.T], [c_q, np.zeros((len(c_q),) * 2)]])


@functools.cache
def package_matrix(k: int) -> tuple[np.ndarray, np.ndarray]:
    """The package's matrix, and what of it the independent rows and columns of Eq. 13 must be: the
    package multiplies the equations of motion by s = 1/v', and the multipliers with them."""
    found, s = sail.solved(k), float(sail.STEPPER._q_share)
    rows, columns = np.ones(M + 6), np.ones(M + 6)
    rows[:M], columns[M:] = s, 1.0 / s
    keep = np.r_[0:M, M + 3 * P : M + 3 * P + 6]
    printed = iteration_matrix(k)[np.ix_(keep, keep)]
    return found.matrix, found.held.T @ (rows[:, None] * printed * columns) @ found.held


@holds("PGV", "12", "corrections of a Newton step", note="With the residual r_lambda = C(q).")
def newton_correction():
    """Solved as printed, in all unknowns; the package's matrix in its own unknowns."""
    errors = []
    for k in EACH:
        state, found, s = sail.states()[k], sail.solved(k), float(sail.STEPPER._q_share)
        r_q = sail.derivatives(k).value.residual
        points = state.q[:12].reshape(4, 3)
        r_rigid = forms.rigidity(points, forms.local_base(*sail.HUB[:2]))
        r_lambda = np.concatenate([sail.joint_jacobian() @ state.q, r_rigid])
        printed = np.linalg.solve(iteration_matrix(k), -np.concatenate([r_q, r_lambda]))
        kept_rigid = np.asarray(sail.sail().hub.constraints(jnp.asarray(points)))
        rhs = found.held[:M].T @ (-s * r_q)
        rhs[-6:] = -kept_rigid
        judge = found.held @ np.linalg.solve(found.matrix, rhs)
        dq, dlam = judge[:M], judge[M:] / s
        errors += [relative_error(printed[:M], dq), relative_error(printed[M + 3 * P :], dlam)]
    return max(errors)


@holds("PGV", "13", "iteration matrix")
def newton_matrix():
    """The matrix uses C_t and K_t of the last members of Eq. 14 and 15; r = G(x) d, which satisfies Eq. 55,
    eliminates the joints."""
    errors = [relative_error(*package_matrix(k)[::-1]) for k in EACH]
    errors += [np.abs(sail.joint_jacobian() @ sail.solved(k).held[:M]).max() for k in EACH]
    return max(errors)


@holds("PGV", "14", "tangent of the damping", note="Both members. Eq. 15 has the share of Q_d in q.")
def damping_is_all_that_depends_on_velocity():
    errors = []
    for k in EACH:
        by_v = sail.derivatives(k).v
        every = -(by_v.elastic + by_v.coulomb + by_v.damping)
        errors += [relative_error(x, by_v.residual) for x in (every, damping_tangent(k))]
    return max(errors)


@fails(
    "PGV",
    "15a",
    "tangent stiffness, middle member",
    printed=r"K_t = -d(M q'' - Q_a + C_q^T \lambda)/dq",
    right=r"K_t = +d(M q'' - Q_a + C_q^T \lambda)/dq, as its own right-hand side is",
    consequence="Newton converges linearly: on the baseline at h = 0.1 s corrections shrink ten-fold, and "
    "1e-12 m takes 6 iterations instead of 2; at 0.5 s 40 do not suffice (3 do), at 1 s it diverges.",
)
def sign_of_the_stiffness():
    printed, right = [], []
    for k in EACH:
        by_q = sail.derivatives(k).q
        whole = -by_q.elastic - by_q.coulomb - by_q.damping + geometric_stiffness(k)
        printed.append(relative_error(-whole, by_q.residual))
        right.append(relative_error(whole, by_q.residual))
    return Errors(min(printed), max(right))


@holds("PGV", "15b", "tangent stiffness, right-hand side")
def stiffness_is_complete():
    """M q'' has no share: the mass matrix is constant."""
    errors = [relative_error(stiffness_tangent(k), sail.derivatives(k).q.residual) for k in EACH]
    return max(errors)


# ---- the method's numbers, text after Eq. 15 ------------------------------------------------------


def printed_parameters(rho: float) -> dict[str, float]:
    """alpha_m, alpha_f, mu (gamma of the package) and nu (its beta, with nu = (1/4)(mu + 1/2)^2)."""
    alpha_m, alpha_f = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
    mu = 1 / 2 + alpha_f - alpha_m
    return {"alpha_m": alpha_m, "alpha_f": alpha_f, "gamma": mu, "beta": 1 / 4 * (mu + 1 / 2) ** 2}


def stepper(step: float, rho: float) -> GeneralizedAlpha:
    return GeneralizedAlpha(jnp.asarray(step), jnp.asarray(rho))


def enter_parameter(symbol: str, field: str) -> None:
    """One row per parameter."""

    @holds("PGV", f"after 15, {symbol}", f"{symbol} of a spectral radius")
    def parameter():
        kept = [getattr(stepper(0.1, rho).parameters, field) for rho in RADII]
        return relative_error([printed_parameters(rho)[field] for rho in RADII], kept)


for row in (("alpha_m", "alpha_m"), ("alpha_f", "alpha_f"), ("mu", "gamma"), ("nu", "beta")):
    enter_parameter(*row)


def of_one_node(values) -> Coordinates:
    """Coordinates that are zero but for the node after the root of the first tether."""
    tether = jnp.zeros((1, 3, 2, sail.sail().tethers.element_length.size))
    return Coordinates(tether.at[0, :, 1, 0].set(jnp.asarray(values, float)), jnp.zeros((4, 3)))


def at_the_node(coordinates: Coordinates) -> np.ndarray:
    """The values that `coordinates` has at the node."""
    return np.asarray(coordinates.tether)[0, :, 1, 0]


def amplification(step: float, rho: float, frequency: float) -> np.ndarray:
    """One step of the package's stepper for x'' = -frequency^2 x, as a matrix on (x, v, a); for an
    infinite frequency on (v, a, x''), x being zero.

    The three components of one node are three starts at once. A step is predict, then end_of_step with
    the x'' that satisfies the equation.
    """
    method = stepper(step, rho)

    stiff, starts = np.isinf(frequency), np.eye(3)
    none, zero = of_one_node(np.zeros(3)), jnp.zeros(())
    if stiff:
        q, v, a, vdot = np.zeros(3), *starts
    else:
        (q, v, a), vdot = starts, -(frequency**2) * starts[0]
    power = Power(zero, zero)
    motion = [of_one_node(x) for x in (q, v, vdot, a)]
    state = StepState(*motion, Multipliers(None, None), none, none, power, power)
    q0, v0, a0 = method.predict(state)
    share = float(method._q_share)
    known = at_the_node(q0)
    vdot = -known / share if stiff else -(frequency**2) * known / (1 + frequency**2 * share)
    q, v = method.end_of_step(sail.sail(), zero, q0, v0, of_one_node(vdot))
    q, v, a0 = (at_the_node(x) for x in (q, v, a0))
    a = a0 + float(method._vdot_share) * vdot
    return np.array([v, a, vdot] if stiff else [q, v, a])


@holds("PGV", "after 15, rho", "these parameters have the spectral radius rho at infinite frequency")
def radius_at_infinity():
    """All three eigenvalues are -rho: the invariants of the amplification matrix are those of (x + rho)^3.
    Eigenvalues themselves would be lost to rounding, three coincide."""
    errors = []
    for rho in RADII:
        a = amplification(1.0, rho, np.inf)
        trace = np.trace(a)
        invariants = [trace, 0.5 * (trace**2 - np.trace(a @ a)), np.linalg.det(a)]
        errors.append(relative_error(invariants, [-3 * rho, 3 * rho**2, -(rho**3)]))
    return max(errors)


@holds("PGV", "after 15, order", "these parameters are accurate to second order", tolerance=0.02)
def order_of_accuracy():
    """The error of the oscillator's eigenvalue in one step falls with the third power of the step."""

    def error(step):
        eigenvalues = np.linalg.eigvals(amplification(step, sail.RHO, 1.0))
        return np.abs(eigenvalues - np.exp(1j * step)).min()

    return relative_error(np.log2(error(0.02) / error(0.01)), 3.0)


@holds("PGV", "after 15, v' and mu'", "share of acceleration and velocity in a correction of q")
def corrections_of_acceleration_and_velocity():
    """Change of the acceleration and of the velocity over that of q, by the package's stepper."""
    errors = []
    for step, rho in ((0.1, 0.25), (0.9, 0.7)):
        zero, one = of_one_node(np.zeros(3)), of_one_node(np.ones(3))
        dq, dv = stepper(step, rho).end_of_step(sail.sail(), jnp.zeros(()), zero, zero, one)
        dq, dv = at_the_node(dq)[0], at_the_node(dv)[0]
        errors.append(relative_error(forms.step_correction(step, rho), [1 / dq, dv / dq]))
    return max(errors)


@holds("PGV", "after 15, settings", "step 0.1 s and spectral radius 0.25 for all simulations")
def settings():
    paper = load_scene("baseline", {"integrator.method": "generalized-alpha"})
    integrator = with_method(paper).integrator
    return relative_error([0.1, 0.25], [integrator.step, integrator.spectral_radius])
