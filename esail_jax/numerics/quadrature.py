"""Gauss-Legendre quadrature on the unit interval."""

import numpy as np


def gauss_legendre(points: int) -> tuple[np.ndarray, np.ndarray]:
    """Abscissae xi and weights w on [0, 1]: sum(w f(xi)) is exact for polynomials up to degree
    2 `points` - 1."""
    xi, weights = np.polynomial.legendre.leggauss(points)
    return (xi + 1.0) / 2.0, weights / 2.0
