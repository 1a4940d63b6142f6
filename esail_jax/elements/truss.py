"""Linear two-node truss element: shape functions. The only nodal vector is the position."""

import numpy as np

COEFS_PER_NODE = 1
"""Number of nodal vectors of a node: r."""


def shape_functions(xi: np.ndarray, derivative: int = 0) -> np.ndarray:
    """Shape functions 1 - xi and xi, or their derivative of the given order in xi: (point, 2)."""
    columns = [np.polynomial.Polynomial([1, -1]), np.polynomial.Polynomial([0, 1])]
    return np.stack([s.deriv(derivative)(xi) if derivative else s(xi) for s in columns], axis=1)
