"""Axes that move with a sail: the hub's, and at every node of a tether some along it.

In such axes inertia, elasticity and rigidity change slowly, however far the structure turns. A matrix
factored at one configuration is used at another by turning residuals back and solutions forth. Along
a tether that matters most: it is stiff in its own direction and slack across, so that an error d in the
direction couples d^2 of the axial stiffness into the transverse motion.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Rotation, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.numerics.small_matrices import matmul
from esail_jax.numerics.vectors import dot
from esail_jax.system import System

OPPOSITE = 0.1
"""1 + cos of the angle turned, below which a node's axes are turned with the hub only: the shortest turn to
the opposite direction is not unique."""

Directions = Float[Array, "3 place"]
"""At every node of every tether."""


class Axes(NamedTuple):
    """Attitude of the hub or of the turning frame, unit vectors along the tethers, and 0 for the positions
    of held roots, 1 for all other nodal vectors."""

    hub: Rotation
    along: Directions
    free_mask: Float[Array | np.ndarray, "coef place"]


class Turn(NamedTuple):
    """From one set of axes to another: the hub's rotation R, and that of every node: first with the hub,
    then by the shortest turn between its directions,

        R x + sum_k far_k (near_k . x).

    A held root's position turns with the hub only: free_mask, 0 for it and 1 for all others."""

    hub: Rotation
    near: tuple[Directions, Directions]
    far: tuple[Directions, Directions]
    free_mask: Float[Array | np.ndarray, "coef place"]

    def to_current(self, x: Coordinates) -> Coordinates:
        """Vectors turned."""
        flat = x.tether.reshape(*x.tether.shape[:2], -1)
        turned = (self.hub[:, :, None] * flat[:, None]).sum(2)
        for near, far in zip(self.near, self.far, strict=True):
            turned = turned + far * (self.free_mask * (near * flat).sum(1))[:, None]
        hub = None if x.hub is None else matmul(x.hub, self.hub.T)
        return Coordinates(turned.reshape(x.tether.shape), hub)

    def to_reference(self, x: Coordinates) -> Coordinates:
        """The inverse."""
        return self._replace(hub=self.hub.T, near=self.far, far=self.near).to_current(x)


def axes_of(system: System, time: Scalar, q: Coordinates) -> Axes:
    """Axes of a configuration. A truss has the direction of the element beyond the node."""
    if system.tethers.coefs == 2:
        along = q.tether[1]
    else:
        links = jnp.diff(q.tether[0], axis=1)
        along = jnp.concatenate([links, links[:, -1:]], axis=1)
    along = along.reshape(3, -1)
    squared = dot(along, along)
    length = jnp.sqrt(jnp.where(squared > 0.0, squared, 1.0))
    return Axes(system.rotation(time, q), along / length, free_mask(system))


def free_mask(system: System) -> Float[Array | np.ndarray, "coef place"]:
    """0 for the positions of held roots, 1 for all other nodal vectors."""
    tethers = system.tethers
    first = np.zeros((tethers.coefs, tethers.elements + 1, tethers.count))
    first[0, 0] = 1.0
    held = jnp.zeros(tethers.count)
    if system.roots is not None:
        held = system.roots.releases.where_released(held, jnp.ones(tethers.count))
    return (1.0 - first * held).reshape(tethers.coefs, -1)


def turn(before: Axes, after: Axes) -> Turn:
    """What leads from one set of axes to the other: R of the hub, and at the nodes

        (1 - (a + b) (a + b)^T / (1 + c) + 2 b a^T) R,    c = a . b,

    from a, the direction before turned with the hub, to b, that after: two reflections."""
    hub = matmul(after.hub, before.hub.T)
    start, back = hub @ before.along, hub.T @ after.along
    cosine = dot(start, after.along)
    # Without a direction, at a node whose slope has vanished, they are zero.
    turns = (1.0 + cosine > OPPOSITE) & (dot(start, start) * dot(back, back) > 0.5)
    halved = jnp.where(turns, -1.0 / (1.0 + cosine), 0.0) * (start + after.along)
    twice = jnp.where(turns, 2.0, 0.0) * after.along
    return Turn(hub, (before.along + back, before.along), (halved, twice), after.free_mask)
