"""Bases of a sail's small motions: its tethers with a rigid hub, and waves around the circle.

If the tethers are equal, a rotation by the angle 2 pi / p between them maps motions on motions. Small
motions are then sums of waves

    u_i = exp(i n phi_i) R(phi_i) u_0,    n = 0 ... p - 1,

with the azimuth phi_i = 2 pi i / p of tether i and the rotation R about the spin axis, and waves of
different n do not influence each other. n = 0 is the collective motion of all tethers. The rigid hub takes
part in n = 0, by translation along the axis and rotation about it, and in n = 1 and n = p - 1, by
translation and rotation across it; at all other n it rests.
"""

import numpy as np
import scipy.sparse as sp

from esail_jax.array_types import Float, Inexact
from esail_jax.equilibria.couplings import NONE, indices
from esail_jax.equilibria.sparse import Sparse, SparseMatrices
from esail_jax.equilibria.steady_state import translations
from esail_jax.system import System

Host = np.ndarray

EQUAL = 1e-8
"""Largest difference, relative to the largest entry, between the matrices of a sail and those of the sail
turned by one tether, if the tethers count as equal."""

HELICAL = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1j, -1j]]) / np.array([1.0, 2**0.5, 2**0.5])
"""Columns: unit vectors in B that a rotation by phi about X_B multiplies by exp(-i m phi), m = 0, 1, -1."""


def hub_motions(system: System, y: Float[Host, " n"], axes: Float[Host, "3 3"]) -> Float[Host, "n 6"]:
    """The displacements of y in translations of the hub along `axes` (columns) and in rotations
    about the axes through its centre."""
    hub = indices(system).hub
    displacements = np.zeros((len(y), 6))
    if len(hub):
        points = y[hub].reshape(4, 3)
        arms = points - 0.5 * (points[0] + points[1])
        for j, axis in enumerate(axes.T):
            displacements[hub, j] = np.tile(axis, 4)
            displacements[hub, 3 + j] = np.cross(axis, arms).ravel()
    return displacements


def rigid_hub_basis(system: System, y: Float[Host, " n"], axes: Float[Host, "3 3"]) -> Sparse:
    """The basis of all motions with a rigid hub: the tethers' coordinates, in the axes of each
    tether (along the spin axis, radial, azimuthal), and the hub's six motions.

    Columns are ordered tether by tether, each followed by the auxiliary tether from its tip to the next
    one, in the same axes; the hub's are last."""
    places, hub, ring = indices(system)
    count, size = places.shape[-1], len(y)
    rows, columns, values = [], [], []
    column = 0
    for i in range(count):
        turned = axes @ rotation_about_x(2.0 * np.pi * i / count)
        own = places[:, :, :, i].transpose(0, 2, 1)  # coefficient, node, component
        own = np.concatenate([own[own[:, :, 0] != NONE], ring[:, :, i].T])
        m = len(own)
        local = column + np.arange(3 * m).reshape(m, 3)
        rows.append(np.repeat(own[:, :, None], 3, axis=2).ravel())
        columns.append(np.repeat(local[:, None, :], 3, axis=1).ravel())
        values.append(np.tile(turned.ravel(), m))
        column += 3 * m
    tethers = sp.csc_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(size, column)
    )
    if not len(hub):
        return tethers
    return sp.hstack([tethers, sp.csc_matrix(hub_motions(system, y, axes))], format="csc")


def rotation_about_x(angle: float) -> Float[Host, "3 3"]:
    """The active rotation about the first axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def waves(count: int, coordinates: int, hub: bool, n: int) -> Sparse:
    """The waves of number n, in the coordinates of `rigid_hub_basis`.

    count: number of tethers p; coordinates: number of coordinates of a tether."""
    phase = np.exp(2j * np.pi * n * np.arange(count) / count)[:, None] / np.sqrt(count)
    columns = sp.kron(sp.csc_matrix(phase), sp.eye(coordinates), format="csc")
    if not hub:
        return columns
    chosen = [k for k, m in enumerate((0, 1, -1)) if (n - m) % count == 0]
    vectors = HELICAL if count > 2 else np.eye(3)  # of one or two tethers both directions have the same n
    helical = sp.kron(sp.eye(2), sp.csc_matrix(vectors[:, chosen]), format="csc")
    return sp.block_diag([columns, helical], format="csc")


def one_tether_further(count: int, coordinates: int, hub: bool) -> Sparse:
    """The rotation of a motion by the angle between two tethers, in the coordinates of
    `rigid_hub_basis`."""
    shift = sp.csc_matrix(np.roll(np.eye(count), 1, axis=0))
    turned = sp.kron(shift, sp.eye(coordinates), format="csc")
    if not hub:
        return turned
    rotation = sp.csc_matrix(rotation_about_x(2.0 * np.pi / count))
    return sp.block_diag([turned, rotation, rotation], format="csc")


def tethers_are_equal(reduced: list[Sparse], count: int, hub: bool) -> bool:
    """Tells whether the matrices, in the coordinates of `rigid_hub_basis`, stay the same if the sail is
    turned by one tether."""
    size = reduced[0].shape[0]
    turn = one_tether_further(count, (size - 6 * hub) // count, hub)
    return all(abs(turn @ a @ turn.T - a).max() <= EQUAL * abs(a).max() for a in reduced if a.nnz)


def conditions(system: System, matrices: SparseMatrices) -> Sparse:
    """The conditions on small motions, one a row with unit length: the constraints and, with a
    hub, a resting centre of mass.

    The motion of the centre of mass follows from the other motions and does not act on them, because
    inner forces, wind, gravity and forces on the remote units are the same everywhere; it has the
    eigenvalues 0 and +-i Omega of a free particle in the rotating frame."""
    rows = [matrices.constraint]
    if system.hub is not None:
        rows.append(sp.csr_matrix((matrices.mass @ translations(system)).T))
    stacked = sp.csr_matrix(sp.vstack(rows))
    length = np.sqrt(np.asarray(stacked.multiply(stacked).sum(axis=1)).ravel())
    return sp.csr_matrix(sp.diags(1.0 / np.maximum(length, 1e-300)) @ stacked)


def allowed(rows: Inexact[Host, "c n"]) -> Inexact[Host, "n m"]:
    """An orthonormal basis, in columns, of the vectors on which all rows vanish."""
    import scipy.linalg

    rows = rows[np.abs(rows).max(axis=1, initial=0.0) > 1e-9]
    if not len(rows):
        return np.eye(rows.shape[1])
    q, r, _ = scipy.linalg.qr(rows.conj().T, pivoting=True)
    diagonal = np.abs(np.diag(r))
    return q[:, int((diagonal > 1e-9 * diagonal[0]).sum()) :]
