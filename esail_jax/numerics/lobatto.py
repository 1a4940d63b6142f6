"""Collocation at damped Lobatto points of the unit interval (Hairer & Wanner II, IV.5).

    int_0^{c_i} p(x) dx = b_i p(0) + sum_j A_ij p(c_j)    for every polynomial p of degree s or less

Nodes are 0 and c_1 < ... < c_s = 1: a step begins on what the last one ended on, and has s unknown stages.
They are the roots of x (x - 1) (J_{s-1} + a J_{s-2}), J being the Jacobi polynomials of weight x (1 - x).
With a = 0 the method is Lobatto IIIA, of order 2 s, and does not damp at all: its amplification rho of what
is infinitely stiff has modulus 1. a gives it a chosen rho, 0 < rho < 1, and order 2 s - 1. What is resolved
is damped about (1 - rho) / (1 + rho) times as much as by Radau IIA, whose amplification is the limit
rho = 0.
"""

from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial


class Lobatto(NamedTuple):
    """Tables of one number of stages s.

    nodes c (s), without 0; matrix A and squared A^2 (s, s); start b and start_squared A b (s): weights of
    the value at 0. A = T diag(rates) T^-1: `rates`, `mix` (s, k) and `split` (k, s) with
    T z = Re(mix z) for the one of every conjugate pair that is kept.
    """

    nodes: np.ndarray
    matrix: np.ndarray
    squared: np.ndarray
    start: np.ndarray
    start_squared: np.ndarray
    rates: np.ndarray
    mix: np.ndarray
    split: np.ndarray

    @classmethod
    def of(cls, stages: int, spectral_radius: float) -> "Lobatto":
        """Tables of two stages or more. spectral_radius rho: M'(1) / M'(0), M having the nodes as
        roots."""
        upper, lower = jacobi(stages - 1), jacobi(stages - 2)
        tilt = (spectral_radius - 1.0) / (spectral_radius + 1.0) * upper(1.0) / lower(1.0)
        inner = np.sort((upper + tilt * lower).roots().real)
        every = np.concatenate([[0.0], inner, [1.0]])
        powers = np.arange(stages + 1)
        integrals = every[:, None] ** (powers + 1) / (powers + 1)
        full = np.linalg.solve(np.vander(every, increasing=True).T, integrals.T).T
        matrix, start = full[1:, 1:], full[1:, 0]
        rates, vectors = np.linalg.eig(matrix)
        split = np.linalg.inv(vectors)
        kept = np.flatnonzero(rates.imag > -1e-12)
        weight = np.where(rates[kept].imag > 1e-12, 2.0, 1.0)
        mix = vectors[:, kept] * weight
        return cls(every[1:], matrix, matrix @ matrix, start, matrix @ start, rates[kept], mix, split[kept])

    @property
    def every_node(self) -> np.ndarray:
        """0 and the stages' nodes (s + 1)."""
        return np.append(0.0, self.nodes)

    def integrals(self, power: int) -> np.ndarray:
        """Coefficients (s + 1, s + 1) of the `power`-fold integrals from 0 of the polynomial through values
        at 0 and at the nodes: sum_m x^{m + power} integrals[m] is what these contribute at x."""
        fit = self.extrapolation()
        factor = np.ones(len(fit))
        for n in range(1, power + 1):
            factor /= np.arange(len(fit)) + n
        return fit * factor[:, None]

    def difference(self) -> np.ndarray:
        """Weights of (p(0), p(c_1), ..., p(c_s)) in the coefficient of x^s: the divided difference
        that vanishes for every polynomial of a lower degree."""
        return self.extrapolation()[-1]

    def between(self) -> float:
        """Largest |int_0^x (x - y) prod_j (y - c_j) dy| on the unit interval: by how much, times that
        difference, the twofold integral changes if the polynomial leaves p(0) out."""
        added = Polynomial.fromroots(self.nodes).integ(2, lbnd=0.0)
        return float(np.abs(added(np.linspace(0.0, 1.0, 1001))).max())

    def extrapolation(self) -> np.ndarray:
        """Coefficients (s + 1, s + 1) of the polynomial through values at 0 and at the nodes."""
        return np.linalg.inv(np.vander(self.every_node, increasing=True))


def jacobi(degree: int) -> Polynomial:
    """Jacobi polynomial of weight x (1 - x) on the unit interval, by the formula of Rodrigues, not
    normalised."""
    x = Polynomial([0.0, 1.0])
    weight = x * (1.0 - x)
    return (weight ** (degree + 1)).deriv(degree) // weight
