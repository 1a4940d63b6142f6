"""Gradient-deficient cubic ANCF cable element: shape functions ([PGV] Eq. 16-19).

The nodal vectors are position r and slope r_x. The functions multiply (r_i, l r_x,i, r_j, l r_x,j), so that
they depend on xi = x/l alone and one table serves tethers of different length.
"""

import numpy as np

COEFS_PER_NODE = 2
"""Number of nodal vectors of a node: r and r_x."""


def shape_functions(xi: np.ndarray, derivative: int = 0) -> np.ndarray:
    """Shape functions s_1 ... s_4 of [PGV] Eq. 18 (s_2 and s_4 divided by l), or their derivative of the
    given order with respect to xi: (point, 4)."""
    columns = [
        np.polynomial.Polynomial([1, 0, -3, 2]),
        np.polynomial.Polynomial([0, 1, -2, 1]),
        np.polynomial.Polynomial([0, 0, 3, -2]),
        np.polynomial.Polynomial([0, 0, -1, 1]),
    ]
    return np.stack([s.deriv(derivative)(xi) if derivative else s(xi) for s in columns], axis=1)
