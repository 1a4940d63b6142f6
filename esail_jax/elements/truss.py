"""Linear two-node truss element: shape functions. Nodal vector is the position alone."""

import numpy as np

COEFS_PER_NODE = 1
"""Nodal vectors of a node: r."""


def shape_functions(xi: np.ndarray, derivative: int = 0) -> np.ndarray:
    """1 - xi and xi, or their `derivative` in xi: (point, 2)."""
    columns = [np.polynomial.Polynomial([1, -1]), np.polynomial.Polynomial([0, 1])]
    return np.stack([s.deriv(derivative)(xi) if derivative else s(xi) for s in columns], axis=1)
