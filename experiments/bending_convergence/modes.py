"""Computes frequencies of small transverse vibrations of one spinning tether by several interpolations.

    omega_k^2 M w = K w,    w(0) = 0,    T(x) = omega^2 (m_u L + mu (L^2 - x^2) / 2),
    K = integral of T w'^2 + EI w''^2 dx,    M = integral of mu w^2 dx + m_u w(L)^2

The equations hold out of the spin plane; in the plane omega_k^2 is less by omega^2. The first mode, w = x,
has the frequency of the spin. The root of the tether is at the centre; its stretch is neglected.
"""

from collections.abc import Callable

import numpy as np
import scipy.linalg

from esail_jax.elements import ancf_cable

LENGTH, SPIN, TIP_MASS = 10e3, 4e-3, 1.5
LINE_DENSITY = 7653.0 * 4.28e-9
SCENE_EI = 70e9 * 1.47e-18
GAUSS = np.polynomial.legendre.leggauss(8)
XI, WEIGHTS = 0.5 * (GAUSS[0] + 1.0), 0.5 * GAUSS[1]


def tension(x: np.ndarray | float) -> np.ndarray | float:
    """The tension T(x) [N] of the unstretched tether."""
    return SPIN**2 * (TIP_MASS * LENGTH + 0.5 * LINE_DENSITY * (LENGTH**2 - x**2))


def boundary_layer(factor: float = 1.0) -> float:
    """The bending length sqrt(EI / T(L/2)) [m] for `factor` times the scene's EI."""
    return float(np.sqrt(factor * SCENE_EI / tension(0.5 * LENGTH)))


def lagrange(degree: int) -> Callable:
    """The shape functions of a C0 element with `degree` + 1 equidistant nodes."""
    nodes = np.linspace(0.0, 1.0, degree + 1)
    coefs = np.linalg.inv(np.vander(nodes, increasing=True))

    def shapes(xi: np.ndarray, derivative: int = 0) -> np.ndarray:
        columns = [np.polynomial.Polynomial(c) for c in coefs.T]
        return np.stack([(c.deriv(derivative) if derivative else c)(xi) for c in columns], axis=1)

    return shapes


INTERPOLATIONS = {
    "linear C0 (truss)": (lagrange(1), 1),
    "quadratic C0": (lagrange(2), 2),
    "cubic C0": (lagrange(3), 3),
    "cubic C1 (cable)": (ancf_cable.shape_functions, 2),
}
"""Name, shape functions, and number of unknowns that each element adds."""


def matrices(shapes: Callable, stride: int, n: int, stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    """K and M of n elements with a fixed root."""
    length = LENGTH / n
    s, ds = shapes(XI), shapes(XI, 1) / length
    dds = shapes(XI, 2) / length**2 if stiffness else 0.0 * s
    size = s.shape[1]
    total = (n - 1) * stride + size
    k, m = np.zeros((total, total)), np.zeros((total, total))
    for e in range(n):
        rows = slice(e * stride, e * stride + size)
        pull = tension((e + XI) * length)
        k[rows, rows] += length * (np.einsum("q,qa,qb->ab", WEIGHTS * pull, ds, ds))
        k[rows, rows] += length * stiffness * np.einsum("q,qa,qb->ab", WEIGHTS, dds, dds)
        m[rows, rows] += length * LINE_DENSITY * np.einsum("q,qa,qb->ab", WEIGHTS, s, s)
    tip = np.zeros(total)
    tip[total - size :] = shapes(np.ones(1))[0]
    m += TIP_MASS * np.outer(tip, tip)
    return k[1:, 1:], m[1:, 1:]


def frequencies(name: str, n: int, factor: float = 0.0) -> np.ndarray:
    """The frequencies [rad/s] out of the plane, ascending; factor: EI / EI of the scene."""
    shapes, stride = INTERPOLATIONS[name]
    k, m = matrices(shapes, stride, n, factor * SCENE_EI)
    # Slopes are multiplied by the element's length, so that all unknowns have the size of positions.
    return np.sqrt(np.abs(scipy.linalg.eigh(k, m, eigvals_only=True)))
