"""[PGV] Eq. 38 and Appendix A.2, Eq. 120-127: Jacobians of the bending damping force.

Conventions and judge as for Eq. 113-119.
"""

from oracles.ledger import Errors, fails, holds
from oracles.pgv_c0_element import element_error, integral, point_error
from oracles.pgv_c2_bending import kappa_ee, phi1, phi1_e, phi1_ee, phi2, phi2_e, phi2_ee
from oracles.pgv_e1_damping import axial_damping_by_rates, axial_damping_jacobian
from oracles.pgv_e2_curvature_rate import kappa_t, kappa_t_v, phi1_t, phi1_t_v, phi2_t, phi2_t_v


def phi1_t_e(p):
    """Eq. 122."""
    a, b, c, e, v = p.a, p.b, p.c, p.e, p.v
    found = 2 * (e.T @ b @ e) * (v.T @ a) + 4 * (e.T @ a @ v) * (e.T @ b) + 4 * (e.T @ b @ v) * (e.T @ a)
    found = found + 2 * (e.T @ a @ e) * (v.T @ b) - 2 * (e.T @ c @ e) * (v.T @ c + v.T @ c.T)
    return found - 2 * (e.T @ c.T @ v + e.T @ c @ v) * (e.T @ c + e.T @ c.T)


def phi2_t_e(p):
    """Eq. 123 with the dot put back."""
    return 2 * p.v.T @ p.a


def kappa_t_e(p):
    """Eq. 121."""
    f, g, f_e, g_e = phi1(p), phi2(p), phi1_e(p), phi2_e(p)
    found = 0.5 * phi1_t(p) * (-0.5 * f**-1.5 * g**-1.5 * f_e - 1.5 * f**-0.5 * g**-2.5 * g_e)
    found = found + 0.5 * f**-0.5 * g**-1.5 * phi1_t_e(p)
    found = found - 1.5 * phi2_t(p) * (0.5 * f**-0.5 * g**-2.5 * f_e - 2.5 * f**0.5 * g**-3.5 * g_e)
    return found - 1.5 * f**0.5 * g**-2.5 * phi2_t_e(p)


def phi1_t_v_e(p):
    """Eq. 125."""
    a, b, c, e = p.a, p.b, p.c, p.e
    found = 4 * a @ e @ e.T @ b + 2 * (e.T @ b @ e) * a + 4 * b @ e @ e.T @ a + 2 * (e.T @ a @ e) * b
    found = found - 2 * (c + c.T) * (e.T @ c @ e)
    return found - 2 * (c @ e + c.T @ e) @ (e.T @ c + e.T @ c.T)


def kappa_t_v_e(p):
    """Eq. 124, its second line transposed."""
    f, g, f_e, g_e = phi1(p), phi2(p), phi1_e(p), phi2_e(p)
    found = 0.5 * phi1_t_v(p).T @ (-0.5 * f**-1.5 * g**-1.5 * f_e - 1.5 * f**-0.5 * g**-2.5 * g_e)
    row = -0.75 * f**-0.5 * g**-2.5 * f_e + 3.75 * f**0.5 * g**-3.5 * g_e
    found = found + phi2_t_v(p).T @ row - 1.5 * f**0.5 * g**-2.5 * phi2_ee(p)
    return found + 0.5 * f**-0.5 * g**-1.5 * phi1_t_v_e(p)


def bending_damping_jacobian(cable):
    """Eq. 120."""

    def integrand(p):
        return kappa_t_v(p).T @ kappa_t_e(p) + kappa_t(p) * kappa_t_v_e(p)

    return -cable.bending_time * cable.bending * integral(cable, integrand)


@holds("PGV", "38", "Jacobian of the damping force: axial plus bending, judged by the tangent of a run")
def damping_jacobian():
    both = lambda cable: axial_damping_jacobian(cable) + bending_damping_jacobian(cable)  # noqa: E731
    return element_error(both, "Q_d_e")


@holds("PGV", "120", "Jacobian of the bending damping force by e")
def bending_damping_force_jacobian():
    return element_error(bending_damping_jacobian, "Q_db_e")


@holds("PGV", "121", "Derivative of the curvature's rate by e, a row")
def curvature_rate_by_coordinates():
    return point_error(kappa_t_e, "kappa_t_e")


@holds("PGV", "122", "Derivative of the rate of Phi_1 by e")
def first_function_rate_by_coordinates():
    return point_error(phi1_t_e, "phi1_t_e")


@fails(
    "PGV",
    "123",
    "Derivative of the rate of Phi_2 by e",
    printed=r"$2e^TS_x^TS_x$, the derivative by $\dot e$ (Eq. 118)",
    right=r"$2\dot e^TS_x^TS_x$",
    consequence="Newton takes longer: on a cantilever bent by 45 deg and straightening within 0.5 s "
    "(gamma_b = 1 s, step 0.01 s) the residual after three iterations is 8e-6 instead of "
    "4e-7 of order one.",
)
def second_function_rate_by_coordinates():
    printed = point_error(lambda p: 2 * p.e.T @ p.a, "phi2_t_e")
    return Errors(printed, point_error(phi2_t_e, "phi2_t_e"))


@fails(
    "PGV",
    "124",
    "Derivative by e of the derivative of the curvature's rate by the velocities",
    printed=r"second line (row of $\frac{\partial\Phi_1}{\partial e}$, "
    r"$\frac{\partial\Phi_2}{\partial e}$) times $\left(\frac{\partial}{\partial\dot "
    r"e}\frac{\partial\Phi_2}{\partial t}\right)^T$: a number. Read as a column times a row, it "
    "is the transpose of what it should be.",
    right=r"$\left(\frac{\partial}{\partial\dot e}\frac{\partial\Phi_2}{\partial t}\right)^T$ times that "
    "row, as in the first line",
    consequence="As a number, added to all entries, Newton diverges on the cantilever of Eq. 123. "
    "Transposed, the residual after three iterations is 4e-5 instead of 4e-7.",
)
def curvature_rate_second_derivative():
    def printed(p, product):
        f, g, f_e, g_e = phi1(p), phi2(p), phi1_e(p), phi2_e(p)
        found = 0.5 * phi1_t_v(p).T @ (-0.5 * f**-1.5 * g**-1.5 * f_e - 1.5 * f**-0.5 * g**-2.5 * g_e)
        row = -0.75 * f**-0.5 * g**-2.5 * f_e + 3.75 * f**0.5 * g**-3.5 * g_e
        found = found + product(row, phi2_t_v(p)) - 1.5 * f**0.5 * g**-2.5 * phi2_ee(p)
        return found + 0.5 * f**-0.5 * g**-1.5 * phi1_t_v_e(p)

    literal = point_error(lambda p: printed(p, lambda x, y: x @ y.T), "kappa_t_v_e")
    columns = point_error(lambda p: printed(p, lambda x, y: x.T @ y), "kappa_t_v_e")
    return Errors(min(literal, columns), point_error(kappa_t_v_e, "kappa_t_v_e"))


@holds("PGV", "125", "Derivative by e of Eq. 119: the Hessian of Phi_1, as Eq. 107")
def first_function_rate_second_derivative():
    return max(point_error(phi1_t_v_e, "phi1_t_v_e"), point_error(phi1_ee, "phi1_t_v_e"))


@holds("PGV", "126", "Derivative by e of Eq. 118: the Hessian of Phi_2, as Eq. 106")
def second_function_rate_second_derivative():
    return point_error(lambda p: 2 * p.s_x.T @ p.s_x, "phi2_t_v_e")


@holds(
    "PGV",
    "127",
    "Jacobian of the bending damping force by the velocities",
    note="Eq. 117 and 124 are the first and second derivatives of the curvature by e (Eq. 99, 105): the "
    "rate of any function of e has that of the function as its derivative by the velocities.",
)
def bending_damping_force_by_velocities():
    def jacobian(cable):
        integrated = integral(cable, lambda p: kappa_t_v(p).T @ kappa_t_v(p))
        return -cable.bending_time * cable.bending * integrated

    def of_a_run(cable):
        return axial_damping_by_rates(cable) + jacobian(cable)

    same = point_error(kappa_ee, "kappa_t_v_e")
    return max(element_error(jacobian, "Q_db_v"), element_error(of_a_run, "Q_d_v"), same)
