"""Vibration modes about a relative equilibrium: natural frequencies, damping ratios and shapes.

In the frame that rotates with the equilibrium, and on the tangent space of the constraints, small motions u
satisfy

    M u'' + (G + C) u' + K u = 0,

where M, G + C and K are the derivatives of the system's residual by y'', y' and y (`moving_frame.py`). K
contains elastic, geometric, centrifugal, load and constraint stiffness, G the gyroscopic terms. Frequencies
refer to the rotating frame. The matrices are dense: the module is meant for up to a thousand coordinates.
"""

from typing import NamedTuple

import jax
import numpy as np

from esail_jax.array_types import Array, Complex, Float
from esail_jax.equilibria.equilibrium import Equilibrium
from esail_jax.equilibria.moving_frame import MovingFrame, forces, independent
from esail_jax.system import System

Host = np.ndarray


class Matrices(NamedTuple):
    """Matrices of the linearised equations: mass M [kg], rate G + C [kg/s] and stiffness K [N/m] in the
    independent coordinates y, and constraint Phi_y [-]."""

    mass: Float[Array, "n n"]
    rate: Float[Array, "n n"]
    stiffness: Float[Array, "n n"]
    constraint: Float[Array, "c n"]


class Modes(NamedTuple):
    """Modes, sorted by frequency; of each conjugate pair there is one.

    eigenvalue: s [1/s]
    frequency: |s| / (2 pi) [Hz]
    damping_ratio: -Re s / |s|; overdamped motions have the ratio 1, monotonically growing ones -1
    shape: mode shapes in the independent coordinates y [m]; the largest component is 1

    Rigid-body modes come first, with s = 0.
    """

    eigenvalue: Complex[Host, " mode"]
    frequency: Float[Host, " mode"]
    damping_ratio: Float[Host, " mode"]
    shape: Complex[Host, "n mode"]


@jax.jit
def linearised(system: System, at: Equilibrium) -> Matrices:
    """M, G + C, K and Phi_y at a relative equilibrium."""
    y = independent(system, at.q)
    zero = 0.0 * y
    # The acceleration of the frame is the same for every y: only its value at the equilibrium matters.
    frame = MovingFrame(at.frame.spin, at.frame.acceleration)

    def balance(y, rate, second):
        return forces(system, frame, y, rate, second, at.lam)[0]

    def constraints(y):
        return jax.tree.leaves(forces(system, frame, y, zero, zero, at.lam)[1])

    stiffness, rate, mass = jax.jacfwd(balance, argnums=(0, 1, 2))(y, zero, zero)
    gradients = [x.reshape(-1, y.size) for x in jax.jacfwd(constraints)(y)]
    constraint = jax.numpy.concatenate(gradients) if gradients else jax.numpy.zeros((0, y.size))
    return Matrices(mass, rate, stiffness, constraint)


def modes(system: System, at: Equilibrium) -> Modes:
    """All vibration modes of a system about a relative equilibrium (`equilibrium`).

    The result is not differentiable. Raises ValueError if the equilibrium has not converged.
    """
    import scipy.linalg  # takes a third as long to import as JAX

    if not at.converged:
        left = float(at.unbalanced)
        raise ValueError(f"the equilibrium must be balanced, but a force of {left:.1e} N is left")
    mass, rate, stiffness, constraint = (np.asarray(x) for x in linearised(system, at))
    held = constraint.shape[0]
    basis = np.linalg.qr(constraint.T, mode="complete")[0][:, held:]
    mass, rate, stiffness = (basis.T @ x @ basis for x in (mass, rate, stiffness))
    # In coordinates with unit mass matrix the state matrix is as well scaled as the frequencies.
    root = scipy.linalg.cholesky(0.5 * (mass + mass.T), lower=True)

    def scaled(x):
        half = scipy.linalg.solve_triangular(root, x, lower=True)
        return scipy.linalg.solve_triangular(root, half.T, lower=True).T

    rate, stiffness = scaled(rate), scaled(stiffness)
    n = len(stiffness)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -rate]])
    values, vectors = np.linalg.eig(state)
    # Rigid-body modes have s^2 = 0 up to rounding of the largest stiffness, and each has two values of s.
    floor = np.sqrt(np.finfo(float).eps * n * np.abs(stiffness).max())
    moving = np.abs(values) > floor
    rigid = np.flatnonzero(~moving)[::2]
    pick = np.flatnonzero(moving & (values.imag >= 0.0))
    pick = np.concatenate([rigid, pick[np.argsort(np.abs(values[pick]), kind="stable")]])
    shapes = basis @ scipy.linalg.solve_triangular(root, vectors[:n, pick], lower=True, trans="T")
    largest = shapes[np.abs(shapes).argmax(0), np.arange(len(pick))]
    values = np.where(moving, values, 0.0)[pick]
    magnitude = np.abs(values)
    ratio = -values.real / np.where(magnitude > 0.0, magnitude, 1.0)
    return Modes(values, magnitude / (2.0 * np.pi), ratio, shapes / largest)
