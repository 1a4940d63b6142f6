"""The ecliptic of J2000, in which the package counts, and the equator of J2000, in which files are.

Frame H, the heliocentric frame of the package, has the mean ecliptic and equinox of J2000; the frame
EME2000 of flight dynamics has the mean equator of J2000. They share the X axis, towards the equinox:

    v_EME2000 = R_x(eps) v_H,    eps = 84381.448 arc seconds

with the obliquity of the IAU (1976), which is that of SPICE's frame ECLIPJ2000. The axes of EME2000 are
taken as those of the ICRF, as SPICE does: the two differ by 0.02 arc seconds."""

import math

import numpy as np
from jaxtyping import Float

OBLIQUITY = math.radians(84381.448 / 3600.0)
"""eps [rad]: the angle between equator and ecliptic of J2000."""

TO_EQUATOR = np.array([
    [1.0, 0.0, 0.0],
    [0.0, math.cos(OBLIQUITY), -math.sin(OBLIQUITY)],
    [0.0, math.sin(OBLIQUITY), math.cos(OBLIQUITY)],
])  # fmt: skip
"""R_x(eps): maps components in the ecliptic of J2000 to components in EME2000."""


def to_equatorial(vectors: Float[np.ndarray, "*time 3"]) -> Float[np.ndarray, "*time 3"]:
    """Positions, velocities or directions in EME2000, of those in the ecliptic of J2000."""
    return vectors @ TO_EQUATOR.T


def to_ecliptic(vectors: Float[np.ndarray, "*time 3"]) -> Float[np.ndarray, "*time 3"]:
    """Positions, velocities or directions in the ecliptic of J2000, of those in EME2000."""
    return vectors @ TO_EQUATOR


def attitude_to_equatorial(rotation: Float[np.ndarray, "*time 3 3"]) -> Float[np.ndarray, "*time 3 3"]:
    """Rotations that map components in a body's axes to components in EME2000, of those that map them to
    the ecliptic of J2000, such as `rotation_IB`."""
    return TO_EQUATOR @ rotation


def quaternions(rotation: Float[np.ndarray, "time 3 3"]) -> Float[np.ndarray, "time 4"]:
    """Unit quaternions (Q1, Q2, Q3, QC), the scalar last, of a series of rotation matrices.

    Q1, Q2, Q3 = e sin(phi/2) and QC = cos(phi/2), where the turn by the angle phi about the axis e takes
    the axes of frame A to those of frame B; the matrix maps components in B to components in A. It is the
    quaternion from A to B of CCSDS 504.0-B. The first one has QC >= 0, and each other one the sign with
    which it is nearer to the one before.

    The matrix q q^T is linear in the rotation; its column with the largest diagonal is free of
    cancellation (Shepperd 1978)."""
    r = np.moveaxis(rotation, 0, -1)
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    product = np.empty((4, 4, len(rotation)))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        product[i, i] = 1.0 + 2.0 * r[i, i] - trace
        product[i, j] = product[j, i] = r[i, j] + r[j, i]
        product[i, 3] = product[3, i] = r[k, j] - r[j, k]
    product[3, 3] = 1.0 + trace
    largest = np.argmax(np.einsum("iit->it", product), axis=0)
    found = product[:, largest, np.arange(len(rotation))].T
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    cosines = np.concatenate([found[:1, 3], np.einsum("ti,ti->t", found[1:], found[:-1])])
    signs = np.cumprod(np.where(cosines < 0.0, -1.0, 1.0))
    return np.asarray(found * signs[:, None])
