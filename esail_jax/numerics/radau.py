"""Radau IIA: collocation at the right Radau points of the unit interval (Hairer & Wanner II, IV.5).

    int_0^{c_i} p(x) dx = sum_j A_ij p(c_j)    for every polynomial p of degree below the stages'

The last node is 1, so a step ends on its last stage. Order 2 s - 1; what is infinitely stiff is damped
in one step (A regular, stiffly accurate).
"""

from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial


class Radau(NamedTuple):
    """Tables of one number of stages s.

    nodes c (s); matrix A (s, s); squared A^2.
    A = T diag(rates) T^-1: `rates`, `mix` (s, k) and `split` (k, s) with T z = Re(mix z) for the one of
    every conjugate pair that is kept.
    """

    nodes: np.ndarray
    matrix: np.ndarray
    squared: np.ndarray
    rates: np.ndarray
    mix: np.ndarray
    split: np.ndarray

    @classmethod
    def of(cls, stages: int) -> "Radau":
        """Nodes are the roots of (d/dx)^{s-1} x^{s-1} (x - 1)^s."""
        x = Polynomial([0.0, 1.0])
        nodes = np.sort((x ** (stages - 1) * (x - 1.0) ** stages).deriv(stages - 1).roots().real)
        nodes[-1] = 1.0
        powers = np.arange(stages)
        integrals = nodes[:, None] ** (powers + 1) / (powers + 1)
        matrix = np.linalg.solve(np.vander(nodes, increasing=True).T, integrals.T).T
        rates, vectors = np.linalg.eig(matrix)
        split = np.linalg.inv(vectors)
        kept = np.flatnonzero(rates.imag > -1e-12)
        weight = np.where(rates[kept].imag > 1e-12, 2.0, 1.0)
        return cls(nodes, matrix, matrix @ matrix, rates[kept], vectors[:, kept] * weight, split[kept])

    def integrals(self, power: int) -> np.ndarray:
        """Coefficients (power, s) of the `power`-fold integrals from 0 of the stages' polynomial:
        sum_m x^{m + power} integrals[m] is what stage values contribute at x."""
        stages = len(self.nodes)
        fit = np.linalg.inv(np.vander(self.nodes, increasing=True))
        factor = np.ones(stages)
        for n in range(1, power + 1):
            factor /= np.arange(stages) + n
        return fit * factor[:, None]

    def difference(self) -> np.ndarray:
        """Weights of (p(0), p(c_1), ..., p(c_s)) in the coefficient of x^s: the divided difference
        that vanishes for what the stages' polynomial can represent."""
        return np.linalg.inv(np.vander(np.append(0.0, self.nodes), increasing=True))[-1]

    def between(self) -> float:
        """Largest |int_0^x (x - y) prod_j (y - c_j) dy| on the unit interval: by how much, times that
        difference, the twofold integral changes if p(0) is represented too."""
        added = Polynomial.fromroots(self.nodes).integ(2, lbnd=0.0)
        return float(np.abs(added(np.linspace(0.0, 1.0, 1001))).max())

    def extrapolation(self, degree: int) -> np.ndarray:
        """Coefficients (degree + 1, s + 1) of the polynomial fitted by least squares to values at 0
        and at the nodes."""
        return np.linalg.pinv(np.vander(np.append(0.0, self.nodes), degree + 1, increasing=True))
