"""Tables of collocation at damped Lobatto points of the unit interval (Hairer & Wanner II, IV.5).

    int_0^{c_i} p(x) dx = b_i p(0) + sum_j A_ij p(c_j)    for every polynomial p of degree s or less

The nodes are 0 and c_1 < ... < c_s = 1. The first stage of a step is the last stage of the step before, so
that s stages are unknown. The nodes are the roots of x (x - 1) (J_{s-1} + a J_{s-2}), where J are the
Jacobi polynomials of weight x (1 - x). With a = 0 the method is Lobatto IIIA of order 2 s, which has no
damping: its amplification rho of infinitely stiff modes has modulus 1. Another a gives the method a chosen
rho, 0 < rho < 1, and the order 2 s - 1. Resolved modes are then damped about (1 - rho) / (1 + rho) times as
much as by Radau IIA, which is the limit rho = 0.
"""

from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial


class Lobatto(NamedTuple):
    """Tables for s stages.

    nodes: c (s), without 0
    matrix, squared: A and A^2 (s, s)
    start, start_squared: b and A b (s), the weights of the value at 0
    rates, mix, split: the eigenvalues (k) of A = T diag(rates) T^-1, the columns (s, k) of T and the rows
    (k, s) of T^-1. Of every conjugate pair only one is stored, so that T z = Re(mix z).
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
        """Computes the tables for at least two stages. spectral_radius: rho = |M'(1) / M'(0)|, where M is
        the polynomial with the nodes as roots."""
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
        stored = np.flatnonzero(rates.imag > -1e-12)
        weight = np.where(rates[stored].imag > 1e-12, 2.0, 1.0)
        mix = vectors[:, stored] * weight
        return cls(
            every[1:], matrix, matrix @ matrix, start, matrix @ start, rates[stored], mix, split[stored]
        )

    @property
    def every_node(self) -> np.ndarray:
        """All nodes (s + 1): 0 and those of the stages."""
        return np.append(0.0, self.nodes)

    def integrals(self, power: int) -> np.ndarray:
        """Coefficients (s + 1, s + 1) of the `power`-fold integral from 0 of the polynomial through
        values at all nodes: at x the integral is sum_m x^{m + power} integrals[m] . values."""
        fit = self.extrapolation()
        factor = np.ones(len(fit))
        for n in range(1, power + 1):
            factor /= np.arange(len(fit)) + n
        return fit * factor[:, None]

    def difference(self) -> np.ndarray:
        """The weights of (p(0), p(c_1), ..., p(c_s)) in the coefficient of x^s. This divided
        difference is zero for every polynomial of a lower degree."""
        return self.extrapolation()[-1]

    def between(self) -> float:
        """The largest |int_0^x (x - y) prod_j (y - c_j) dy| on the unit interval. Times
        `difference` it is the change of the twofold integral if the polynomial is not required to pass
        through p(0)."""
        added = Polynomial.fromroots(self.nodes).integ(2, lbnd=0.0)
        return float(np.abs(added(np.linspace(0.0, 1.0, 1001))).max())

    def extrapolation(self) -> np.ndarray:
        """Coefficients (s + 1, s + 1) of the polynomial through values at all nodes."""
        return np.linalg.inv(np.vander(self.every_node, increasing=True))


def jacobi(degree: int) -> Polynomial:
    """The Jacobi polynomial of weight x (1 - x) on the unit interval, by the formula of Rodrigues
    and not normalised."""
    x = Polynomial([0.0, 1.0])
    weight = x * (1.0 - x)
    return (weight ** (degree + 1)).deriv(degree) // weight
