"""Layout of the generalized coordinates q, of their rates, and of the multipliers.

The spherical joints are linear, so the root of a tether is not an independent coordinate: the root node in
`tether` always is its hub point, or its point of the turning frame. It stays in the array because every
operation on elements needs it, but it is not an unknown of any solver.
"""

from typing import NamedTuple

import jax

from esail_jax.array_types import Array, Float, HubPoints, Maybe, Nodal, Rotation
from esail_jax.numerics.small_matrices import matmul
from esail_jax.numerics.vectors import total_of


class Coordinates(NamedTuple):
    """q, v, vdot or generalized forces.

    tether: nodal vectors. hub: base points of the hub; None without a hub. ring: own vectors of the
    auxiliary tethers (`elements/ring.py`); None if there are none. reel: deployed lengths [m] that are
    unknowns (`elements/winch.py`), and in forces the force of every winch; None for all others.
    """

    tether: Nodal
    hub: Maybe[HubPoints]
    ring: Maybe[Float[Array, "3 *state vector tether"]] = None
    reel: Maybe[Float[Array, "*state tether"]] = None

    def axpy(self, factor: Array | float, other: "Coordinates") -> "Coordinates":
        """self + factor * other."""
        return jax.tree.map(lambda a, b: a + factor * b, self, other)

    def rotate(self, rotation: Rotation) -> "Coordinates":
        """Every vector rotated by `rotation`."""
        columns = rotation.T[:, None, :, None, None]
        tether = total_of(columns[j] * self.tether[:, j : j + 1] for j in range(3))
        ring = None if self.ring is None else total_of(columns[j, 0] * self.ring[j] for j in range(3))
        hub = None if self.hub is None else matmul(self.hub, rotation.T)
        return Coordinates(tether, hub, ring, self.reel)


class Multipliers(NamedTuple):
    """Lagrange multipliers [N].

    hub: those of the rigidity constraints ([PGV] Eq. 45). clamp: those of the two conditions on the
    direction of a clamped root slope. None where there is no such constraint. The multipliers of the
    spherical joints are not unknowns: they are the residuals of the root nodes (`system.Residual`).
    """

    hub: Maybe[Float[Array, "6"]]
    clamp: Maybe[Float[Array, "2 tether"]]
