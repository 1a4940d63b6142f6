"""Layout of the generalized coordinates q, of their rates, and of the multipliers.

The spherical joints are linear, so a tether's root is not a coordinate of its own: the root node in
`tether` always *is* its hub point (or its point of the turning frame). It is kept in the array, where
every operation wants it, and nothing is solved for it.
"""

from typing import NamedTuple

import jax

from esail_jax.array_types import Array, Float, HubPoints, Nodal, Rotation
from esail_jax.numerics.small_matrices import matmul


class Coordinates(NamedTuple):
    """q, v, vdot or forces. tether: nodal vectors; hub: base points, None without a hub."""

    tether: Nodal
    hub: HubPoints | None

    def axpy(self, factor: Array | float, other: "Coordinates") -> "Coordinates":
        """self + factor * other."""
        return jax.tree.map(lambda a, b: a + factor * b, self, other)

    def rotate(self, rotation: Rotation) -> "Coordinates":
        """Every vector turned by `rotation`."""
        columns = rotation.T[:, None, :, None, None]
        tether = sum(columns[j] * self.tether[:, j : j + 1] for j in range(3))
        return Coordinates(tether, None if self.hub is None else matmul(self.hub, rotation.T))


class Multipliers(NamedTuple):
    """Lagrange multipliers [N]. hub: rigidity ([PGV] Eq. 45); clamp: the two conditions on the
    direction of a clamped root slope. None where there is no such constraint. The multipliers of
    the spherical joints are read off the equations of the root nodes (`System.root_reaction`)."""

    hub: Float[Array, "6"] | None
    clamp: Float[Array, "2 tether"] | None
