"""Eigenvalues s and motions u of M s^2 u + (G + C) s u + K u = 0 on the allowed motions.

The eigenvalues of a sail differ by nine orders of magnitude, from swinging in the spin plane to damped
stretching of one element. The matrix whose eigenvalues are computed is therefore the inverse

    (A - sigma)^{-1} (u, u') = (x, sigma x + u),
    (sigma^2 M + sigma (G + C) + K) x = -(G + C + sigma M) u - M u',

with a real shift sigma > 0 below the spin rate: its largest eigenvalues 1 / (s - sigma), which are the most
accurate ones, belong to the slowest motions. Nothing is lost at the other end: 3600 / s is exact to 1e-9.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, eigs, splu

from esail_jax.array_types import Complex, Inexact
from esail_jax.equilibria.sparse import Sparse

Host = np.ndarray

SHIFT = 0.37
"""The shift sigma over the spin rate. No motion of a sail grows at this rate."""

MAX_PASSES = 40
"""Largest number of Arnoldi iterations that look for further copies of multiple eigenvalues."""


class Spectrum(NamedTuple):
    """Eigenvalues s [1/s], those of both signs of Im s, and the motions u, one a column."""

    eigenvalue: Complex[Host, " mode"]
    motion: Complex[Host, "n mode"]


def dense_spectrum(
    mass: Inexact[Host, "m m"], rate: Inexact[Host, "m m"], stiffness: Inexact[Host, "m m"], spin: float
) -> Spectrum:
    """All 2 m eigenvalues."""
    import scipy.linalg

    shift, size = SHIFT * abs(spin), len(mass)
    pencil = shift**2 * mass + shift * rate + stiffness
    scale = 1.0 / np.sqrt(np.maximum(np.abs(pencil).max(axis=1), 1e-300))
    factor = scipy.linalg.lu_factor(scale[:, None] * pencil * scale)
    right = np.hstack([rate + shift * mass, shift * mass])  # velocities as multiples of the shift
    x = -scale[:, None] * scipy.linalg.lu_solve(factor, scale[:, None] * right)
    unit = np.hstack([np.eye(size), np.zeros((size, size))])
    values, vectors = np.linalg.eig(np.vstack([x, x + unit / shift]))
    return Spectrum(shift + 1.0 / values.astype(complex), vectors[:size].astype(complex))


def sparse_spectrum(
    mass: Sparse,
    rate: Sparse,
    stiffness: Sparse,
    conditions: Sparse,
    spin: float,
    count: int,
) -> tuple[Spectrum, float]:
    """About 2 `count` eigenvalues nearest to the shift, and the radius [1/s] about zero within
    which all are found.

    Arnoldi's method finds one copy of a multiple eigenvalue for certain. It is therefore repeated on the
    complement of the motions found, until nothing within the radius is left."""
    shift, size, held = SHIFT * abs(spin), mass.shape[0], conditions.shape[0]
    pencil: Sparse = shift**2 * mass + shift * rate + stiffness
    scale = 1.0 / np.sqrt(np.maximum(abs(pencil).max(axis=1).toarray().ravel(), 1e-300))
    scaled = sp.diags(scale) @ pencil @ sp.diags(scale)
    border = conditions @ sp.diags(scale)
    border = sp.diags(1.0 / np.maximum(abs(border).max(axis=1).toarray().ravel(), 1e-300)) @ border
    factor = splu(sp.block_array([[scaled, border.T], [border, None]], format="csc"))

    def solved(right):
        """The allowed x for which the pencil times x is `right`."""
        return scale * factor.solve(np.concatenate([scale * right, np.zeros(held)]))[:size]

    def inverse(state):
        u, velocity = state[:size], shift * state[size:]
        x = -solved(rate @ u + shift * (mass @ u) + mass @ velocity)
        return np.concatenate([x, x + u / shift])

    basis, radius = np.zeros((2 * size, 0)), np.inf
    random = np.random.default_rng(0)
    wanted = min(2 * count + 8, 2 * (size - held) - 2)
    for _ in range(MAX_PASSES):

        def deflated(state, basis=basis):
            state = np.asarray(state).ravel()
            new = inverse(state - basis @ (basis.T @ state))
            return new - basis @ (basis.T @ new)

        start = np.concatenate([solved(random.standard_normal(size)) for _ in range(2)])
        operator = LinearOperator((2 * size, 2 * size), matvec=deflated, dtype=float)
        k = wanted if not basis.size else min(wanted, max(16, wanted // 8))
        values, vectors = eigs(
            operator, k=k, v0=deflated(start), tol=1e-12, ncv=min(2 * size - 1, 2 * k + 20)
        )
        if not basis.size:
            radius = 1.0 / np.abs(values).min()
        near = np.abs(values) >= (1.0 - 1e-9) / radius
        if not near.any():
            break
        new = np.hstack([basis, vectors[:, near].real, vectors[:, near].imag])
        left, size_of, _ = np.linalg.svd(new, full_matrices=False)
        basis = left[:, size_of > 1e-8 * size_of[0]]
    image = np.stack([inverse(x) for x in basis.T], axis=1)
    values, vectors = np.linalg.eig(basis.T @ image)
    return Spectrum(shift + 1.0 / values.astype(complex), (basis @ vectors)[:size]), radius - shift
