"""[PGV] Eq. 26 and Appendix A.1, bending part (Eq. 95-107): curvature, its derivatives, force, Jacobian.

    kappa = Phi_1^(1/2) Phi_2^(-3/2),   Phi_1 = |r_x x r_xx|^2,   Phi_2 = |r_x|^2

Derivatives of scalars by e are rows, as in Eq. 88, 99, 103, 120 and 127. Under that convention
d kappa/de (d kappa/de)^T is a number. `point.a`, `.b`, `.c` are S_x^T S_x, S_xx^T S_xx, S_x^T S_xx.
"""

import numpy as np

from oracles.ledger import Errors, fails, holds, relative_error
from oracles.pgv_c0_element import (
    defined,
    element_error,
    integral,
    judged,
    point_error,
    straight_cables,
)


def slope_matrix(p):
    """Eq. 98: the skew matrix of r_x."""
    r1, r2, r3 = (p.s_x @ p.e)[:, 0]
    return np.array([[0, -r3, r2], [r3, 0, -r1], [-r2, r1, 0]])


def phi1(p):
    """Eq. 101, last line."""
    product = (p.e.T @ p.a @ p.e) * (p.e.T @ p.b @ p.e)
    return product - (p.e.T @ p.c.T @ p.e) * (p.e.T @ p.c @ p.e)


def phi2(p):
    """|r_x|^2."""
    return p.e.T @ p.a @ p.e


def kappa(p):
    """Eq. 97, last form."""
    return phi1(p) ** 0.5 * phi2(p) ** -1.5


def phi1_e(p):
    """Eq. 102 with its last bracket put right."""
    both = p.e.T @ p.c.T + p.e.T @ p.c
    first = 2 * p.e.T @ p.a * (p.e.T @ p.b @ p.e) + 2 * (p.e.T @ p.a @ p.e) * (p.e.T @ p.b)
    return first - 2 * both * (p.e.T @ p.c @ p.e)


def phi2_e(p):
    """Eq. 103."""
    return 2 * p.e.T @ p.a


def kappa_e(p):
    """Eq. 99."""
    first = 0.5 * phi1(p) ** -0.5 * phi2(p) ** -1.5 * phi1_e(p)
    return first - 1.5 * phi1(p) ** 0.5 * phi2(p) ** -2.5 * phi2_e(p)


def phi1_ee(p):
    """Eq. 107."""
    a, b, c, e = p.a, p.b, p.c, p.e
    found = 2 * a * (e.T @ b @ e) + 4 * a @ e @ e.T @ b + 2 * b * (e.T @ a @ e) + 4 * b @ e @ e.T @ a
    found = found - 2 * (c + c.T) * (e.T @ c.T @ e)
    return found - 2 * (c @ e + c.T @ e) @ (e.T @ c.T + e.T @ c)


def phi2_ee(p):
    """Eq. 106."""
    return 2 * p.a


def kappa_ee(p):
    """Eq. 105 with columns times rows and Phi_1 in the numerator of its last two terms."""
    f, g, f_e, g_e = phi1(p), phi2(p), phi1_e(p), phi2_e(p)
    found = -(f_e.T @ f_e) / (4 * f**1.5 * g**1.5) - 3 * (g_e.T @ f_e) / (4 * f**0.5 * g**2.5)
    found = found + phi1_ee(p) / (2 * f**0.5 * g**1.5) - 3 * (f_e.T @ g_e) / (4 * f**0.5 * g**2.5)
    return found + 15 * f**0.5 * (g_e.T @ g_e) / (4 * g**3.5) - 1.5 * f**0.5 * phi2_ee(p) / g**2.5


def bending_jacobian(cable):
    """Eq. 104 with the transposition on the first factor."""

    def integrand(p):
        return kappa_e(p).T @ kappa_e(p) + kappa(p) * kappa_ee(p)

    return -cable.bending * integral(cable, integrand)


@holds("PGV", "26", "Jacobian of the elastic force: axial plus bending, judged by the tangent of a run")
def elastic_jacobian():
    def jacobian(cable):
        def axial(p):
            return -2 * p.a @ p.e @ p.e.T @ p.a - (p.e.T @ p.a @ p.e - 1) * p.a

        return cable.axial / 2 * integral(cable, axial) + bending_jacobian(cable)

    return element_error(jacobian, "Q_e_e")


@holds("PGV", "95", "Bending force: minus EI times the integral of kappa (d kappa/de)^T")
def bending_force():
    return element_error(
        lambda cable: -cable.bending * integral(cable, lambda p: kappa(p) * kappa_e(p).T), "Q_eb"
    )


@holds("PGV", "96", "Second derivative of the position: r_xx = S_xx e")
def second_derivative():
    return point_error(lambda p: p.s_xx @ p.e, "r_xx")


@holds("PGV", "97", "Curvature by Phi_1 and Phi_2")
def curvature_by_invariants():
    def first(p):
        r_x, r_xx, skew = p.s_x @ p.e, p.s_xx @ p.e, slope_matrix(p)
        return (r_xx.T @ skew.T @ skew @ r_xx) ** 0.5 * (r_x.T @ r_x) ** -1.5

    return max(point_error(first, "kappa"), point_error(kappa, "kappa"))


@holds("PGV", "98", "Skew matrix of the slope: R v = r_x x v")
def skew_matrix():
    return point_error(lambda p: slope_matrix(p) @ p.s_xx @ p.e, "cross")


@holds("PGV", "99", "Derivative of the curvature by e, a row")
def curvature_derivative():
    return point_error(kappa_e, "kappa_e")


@fails(
    "PGV",
    "99 (straight)",
    "Derivative of the curvature on a straight cable, and with it Eq. 95, 104 and 105",
    printed=r"$\Phi_1^{-1/2}\,\partial\Phi_1/\partial e$ is 0/0 where $\Phi_1 = 0$",
    right=r"$\kappa\,\partial\kappa/\partial e = \frac12\partial(\Phi_1\Phi_2^{-3})/\partial e$ has no "
    "such point: on the straight cable the force is zero and its Jacobian "
    r"$-\frac12E_tI_t\int\Phi_2^{-3}\partial^2\Phi_1/\partial e^2\,dx$",
    consequence="Eq. 79 starts every tether exactly straight. On the stretched baseline tether Phi_1 "
    "comes out as -1e-21, a rounding error, and the bending force as NaN (complex in "
    "MATLAB).",
)
def curvature_derivative_when_straight():
    truth = judged(straight_cables())["Q_eb_e"]

    def right(cable):
        return -0.5 * cable.bending * integral(cable, lambda p: phi1_ee(p) / phi2(p) ** 3)

    def error(form):
        with np.errstate(all="ignore"):
            return defined(relative_error([form(cable) for cable in straight_cables()], truth))

    return Errors(error(bending_jacobian), error(right))


@holds("PGV", "100", "R^T R = |r_x|^2 I - r_x r_x^T, three forms: the matrix of Phi_1 in r_xx")
def squared_skew_matrix():
    def entries(p):
        r1, r2, r3 = (p.s_x @ p.e)[:, 0]
        return np.array(
            [
                [r2**2 + r3**2, -r1 * r2, -r1 * r3],
                [-r1 * r2, r1**2 + r3**2, -r2 * r3],
                [-r1 * r3, -r2 * r3, r1**2 + r2**2],
            ]
        )

    def by_slope(p):
        r_x = p.s_x @ p.e
        return r_x.T @ r_x * np.eye(3) - r_x @ r_x.T

    def by_shapes(p):
        return p.e.T @ p.s_x.T @ p.s_x @ p.e * np.eye(3) - p.s_x @ p.e @ p.e.T @ p.s_x.T

    def by_product(p):
        return slope_matrix(p).T @ slope_matrix(p)

    return max(point_error(form, "phi1_matrix") for form in (by_product, entries, by_slope, by_shapes))


@holds("PGV", "101", "Phi_1, both lines")
def first_function():
    def by_slopes(p):
        r_x, r_xx = p.s_x @ p.e, p.s_xx @ p.e
        return (r_x.T @ r_x) * (r_xx.T @ r_xx) - (r_xx.T @ r_x) * (r_x.T @ r_xx)

    return max(point_error(by_slopes, "phi1"), point_error(phi1, "phi1"))


@fails(
    "PGV",
    "102",
    "Derivative of Phi_1 by e",
    printed="last term $-2(e^T S_{xx}^T S_x e + e^T S_x^T S_{xx} e)(e^T S_{xx}^T S_{xx} e)$: a number "
    "under two rows. Read as a row, without the last e of both terms of the first bracket, it is "
    "wrong too.",
    right=r"$-2(e^T S_{xx}^T S_x + e^T S_x^T S_{xx})(e^T S_x^T S_{xx} e)$",
    consequence="As printed, a number is added to all twelve entries. Read as a row, the bending force "
    "of a cantilever bent by 45 deg is wrong by a factor of 2 to 3.",
)
def first_function_derivative():
    def products(p):
        return 2 * p.e.T @ p.a * (p.e.T @ p.b @ p.e) + 2 * (p.e.T @ p.a @ p.e) * p.e.T @ p.b

    def printed(p):
        return products(p) - 2 * (p.e.T @ p.c.T @ p.e + p.e.T @ p.c @ p.e) * (p.e.T @ p.b @ p.e)

    def read_as_row(p):
        return products(p) - 2 * (p.e.T @ p.c.T + p.e.T @ p.c) * (p.e.T @ p.b @ p.e)

    best = min(point_error(form, "phi1_e") for form in (printed, read_as_row))
    return Errors(best, point_error(phi1_e, "phi1_e"))


@holds("PGV", "103", "Derivative of Phi_2 by e, a row")
def second_function_derivative():
    return point_error(phi2_e, "phi2_e")


@fails(
    "PGV",
    "104",
    "Jacobian of the bending force",
    printed=r"first integrand $\frac{\partial\kappa}{\partial e}\left(\frac{\partial\kappa}{\partial "
    r"e}\right)^T$: a number, as derivatives by e are rows (Eq. 88, 95, 103). It holds if they "
    "are columns here alone.",
    right=r"$\left(\frac{\partial\kappa}{\partial e}\right)^T\frac{\partial\kappa}{\partial e}$, as in "
    "Eq. 120 and 127",
    consequence="A number is added to all 144 entries; NumPy and MATLAB R2016b or later do it without a "
    "word. Newton on a cantilever of four elements bent by 45 deg in eight load steps takes "
    "5 iterations per step; as printed it diverges in the first. In columns, Eq. 105 has to "
    "be read in columns too.",
)
def bending_force_jacobian():
    def printed(cable):
        def integrand(p):
            return kappa_e(p) @ kappa_e(p).T + kappa(p) * kappa_ee(p)

        return -cable.bending * integral(cable, integrand)

    return Errors(element_error(printed, "Q_eb_e"), element_error(bending_jacobian, "Q_eb_e"))


@fails(
    "PGV",
    "105",
    "Second derivative of the curvature",
    printed=r"last two terms $+\frac{15}{4}\frac{\ldots}{\Phi_1^{1/2}\Phi_2^{7/2}}$ and "
    r"$-\frac{3}{2}\frac{\ldots}{\Phi_1^{1/2}\Phi_2^{5/2}}$, with $\Phi_1$ in the denominator; "
    "the products of rows with transposed rows were read as columns times rows.",
    right=r"$+\frac{15}{4}\Phi_1^{1/2}\Phi_2^{-7/2}\ldots$ and "
    r"$-\frac{3}{2}\Phi_1^{1/2}\Phi_2^{-5/2}\ldots$; in rows, $\left(\frac{\partial\Phi_i}{\partial "
    r"e}\right)^T\frac{\partial\Phi_j}{\partial e}$",
    consequence="On the same cantilever Newton diverges in the first load step. On the baseline nothing "
    "is seen: bending is 4e-14 of the stiffness of its first bending mode.",
)
def curvature_second_derivative():
    def printed(p, outer):
        f, g, f_e, g_e = phi1(p), phi2(p), phi1_e(p), phi2_e(p)
        found = -outer(f_e, f_e) / (4 * f**1.5 * g**1.5) - 3 * outer(g_e, f_e) / (4 * f**0.5 * g**2.5)
        found = found + phi1_ee(p) / (2 * f**0.5 * g**1.5) - 3 * outer(f_e, g_e) / (4 * f**0.5 * g**2.5)
        return found + 15 * outer(g_e, g_e) / (4 * f**0.5 * g**3.5) - 1.5 * phi2_ee(p) / (f**0.5 * g**2.5)

    literal = point_error(lambda p: printed(p, lambda x, y: x @ y.T), "kappa_ee")
    columns = point_error(lambda p: printed(p, lambda x, y: x.T @ y), "kappa_ee")
    return Errors(min(literal, columns), point_error(kappa_ee, "kappa_ee"))


@holds("PGV", "106", "Second derivative of Phi_2")
def second_function_hessian():
    return point_error(phi2_ee, "phi2_ee")


@holds("PGV", "107", "Second derivative of Phi_1")
def first_function_hessian():
    return point_error(phi1_ee, "phi1_ee")
