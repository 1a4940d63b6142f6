"""[PGV] Eq. 23-25 and Appendix A.1, axial part (Eq. 86-94): strain energy, force, Jacobian, invariants.

    W = EA eps^2 / 2,   eps = (r_x . r_x - 1) / 2

The invariants are 12 x 12 x 12 x 12 arrays, summed over as the indices of the print say.
"""

import functools

import numpy as np

from oracles.ledger import holds, relative_error
from oracles.pgv_c0_element import (
    Cable,
    cables,
    derivative,
    element_error,
    integral,
    judge,
    judged,
    point_error,
)


def strain(p):
    """Eq. 24, of r_x = S_x e."""
    r_x = p.s_x @ p.e
    return 0.5 * (r_x.T @ r_x - 1.0)


def curvature(p):
    """Eq. 24: |r_x x r_xx| / |r_x|^3, in a form that takes complex numbers."""
    r_x, r_xx = (p.s_x @ p.e)[:, 0], (p.s_xx @ p.e)[:, 0]
    normal = np.cross(r_x, r_xx)
    return np.sqrt(normal @ normal).reshape(1, 1) / np.sqrt(r_x @ r_x) ** 3


def axial_energy(cable):
    """Eq. 23, first half."""
    return 0.5 * integral(cable, lambda p: cable.axial * strain(p) ** 2)


def bending_energy(cable):
    """Eq. 23, second half."""
    return 0.5 * integral(cable, lambda p: cable.bending * curvature(p) ** 2)


@functools.cache
def invariants() -> list[tuple[np.ndarray, np.ndarray]]:
    """K_1 and K_2 of every state, Eq. 91-92."""
    return [
        (
            cable.axial / 2 * integral(cable, lambda p: np.einsum("ij,kn->ijkn", p.a, p.a)),
            cable.axial / 2 * integral(cable, lambda p: p.a),
        )
        for cable in cables()
    ]


def invariants_of(cable: Cable) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """K_1, K_2 and the coordinates as a plain vector."""
    index = next(i for i, other in enumerate(cables()) if other is cable)
    return *invariants()[index], cable.e[:, 0]


@holds("PGV", "23", "Elastic energy of an element, axial and bending")
def elastic_energy():
    return max(element_error(axial_energy, "U_x"), element_error(bending_energy, "U_b"))


@holds(
    "PGV",
    "24",
    "Longitudinal strain and curvature",
    note="The strain is Green-Lagrange's: eta + eta^2/2 for the engineering strain eta = |r_x| - 1. The "
    "curvature is the true one, per deformed length.",
)
def strain_and_curvature():
    eta = judge()["engineering"]
    from_engineering = relative_error(eta + eta**2 / 2, judge()["strain"])
    return max(point_error(strain, "strain"), point_error(curvature, "kappa"), from_engineering)


@holds("PGV", "25", "Elastic force: minus the derivative of the energy, transposed")
def elastic_force():
    def force(cable):
        def energy(e):
            moved = cable._replace(e=e)
            return axial_energy(moved) + bending_energy(moved)

        return -derivative(energy, cable.e).T

    return element_error(force, "Q_e")


@holds("PGV", "86", "Axial force: minus EA times the integral of eps (d eps/de)^T")
def axial_force_from_strain():
    def middle(cable):
        def squared(e):
            return integral(cable._replace(e=e), lambda p: strain(p) ** 2)

        return -cable.axial / 2 * derivative(squared, cable.e).T

    def last(cable):
        return -cable.axial * integral(cable, lambda p: strain(p) * (p.e.T @ p.a).T)

    return max(element_error(middle, "Q_ex"), element_error(last, "Q_ex"))


@holds("PGV", "87", "Slope: r_x = S_x e")
def slope():
    return point_error(lambda p: p.s_x @ p.e, "r_x")


@holds("PGV", "88", "Derivative of the strain by e, a row")
def strain_derivative():
    return point_error(lambda p: p.e.T @ p.s_x.T @ p.s_x, "strain_e")


@holds("PGV", "89", "Axial force, both lines")
def axial_force():
    def first(cable):
        return -cable.axial / 2 * integral(cable, lambda p: (p.e.T @ p.a @ p.e - 1) * (p.e.T @ p.a).T)

    def second(cable):
        cubic = -cable.axial / 2 * integral(cable, lambda p: p.a @ p.e @ p.e.T @ p.a @ p.e)
        return cubic + cable.axial / 2 * integral(cable, lambda p: p.a @ p.e)

    return max(element_error(first, "Q_ex"), element_error(second, "Q_ex"))


@holds("PGV", "90", "Axial force from the invariants")
def axial_force_from_invariants():
    def force(cable):
        k1, k2, e = invariants_of(cable)
        return (-np.einsum("ijkn,j,k,n->i", k1, e, e, e) + k2 @ e)[:, None]

    return element_error(force, "Q_ex")


@functools.cache
def judged_parts() -> tuple[np.ndarray, np.ndarray]:
    """The Jacobian of the axial force is J_0 - J_2 with J_2 quadratic in e: both, from e and 2 e."""
    at_e = judge()["Q_ex_e"]
    at_twice = judged(tuple(cable._replace(e=2 * cable.e) for cable in cables()))["Q_ex_e"]
    quadratic = (at_e - at_twice) / 3
    return at_e + quadratic, quadratic


@holds("PGV", "91", "Invariant K_1: the part of the Jacobian that is quadratic in e")
def first_invariant():
    def quadratic(cable):
        k1, _, e = invariants_of(cable)
        return 2 * np.einsum("ijkn,j,k->in", k1, e, e) + np.einsum("ijkn,k,n->ij", k1, e, e)

    return relative_error([quadratic(cable) for cable in cables()], judged_parts()[1])


@holds("PGV", "92", "Invariant K_2: the Jacobian of the axial force at e = 0")
def second_invariant():
    return relative_error([invariants_of(cable)[1] for cable in cables()], judged_parts()[0])


@holds("PGV", "93", "Jacobian of the axial force: second line, and from the invariants")
def axial_jacobian():
    def second(cable):
        def integrand(p):
            return -2 * p.a @ p.e @ p.e.T @ p.a - (p.e.T @ p.a @ p.e) * p.a + p.a

        return cable.axial / 2 * integral(cable, integrand)

    def third(cable):
        k1, k2, e = invariants_of(cable)
        return -2 * np.einsum("ijkn,j,k->in", k1, e, e) - np.einsum("ijkn,k,n->ij", k1, e, e) + k2

    return max(element_error(second, "Q_ex_e"), element_error(third, "Q_ex_e"))


@holds("PGV", "94", "Axial energy from the invariants")
def axial_energy_from_invariants():
    def energy(cable):
        k1, k2, e = invariants_of(cable)
        quartic, quadratic = np.einsum("ijkn,i,j,k,n", k1, e, e, e, e), e @ k2 @ e
        return np.array([[cable.axial * cable.length / 8 + quartic / 4 - quadratic / 2]])

    return element_error(energy, "U_x")
