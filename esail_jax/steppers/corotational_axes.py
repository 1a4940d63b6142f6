"""Corotational axes of a sail: those of the hub, and at every node of a tether the tangent of the tether.

In these axes inertia, elasticity and rigidity change slowly, however far the structure rotates. A matrix
that was factored at one configuration is used at another: residuals are rotated to the reference axes,
solutions back to the current ones. The tangents matter most. A tether is stiff along its axis and soft
across it, so that an error d of the direction couples d^2 of the axial stiffness into the transverse
motion."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Rotation, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.numerics.small_matrices import matmul
from esail_jax.numerics.vectors import dot
from esail_jax.system import System

OPPOSITE = 0.1
"""Bound of 1 + cos(angle of rotation). Below it a node's axes rotate with the hub only, because the
shortest rotation to the opposite direction is not unique."""

Directions = Float[Array, "3 place"]
"""Vectors at every node of every tether."""


class Axes(NamedTuple):
    """Corotational axes of a configuration.

    hub: attitude of the hub or of the rotating frame; along: unit vectors along the tethers; free_mask: 0
    for the positions of held roots, 1 for all other nodal vectors."""

    hub: Rotation
    along: Directions
    free_mask: Float[Array | np.ndarray, "coef place"]


class Turn(NamedTuple):
    """The rotation from one set of axes (reference) to another (current). A vector of the hub rotates by R;
    a vector of a node rotates with the hub, and then by the shortest rotation between the tangents,

        R x + sum_k far_k (near_k . x).

    The position of a held root rotates with the hub only: free_mask is 0 for it and 1 for all others. So do
    the own vectors of auxiliary tethers, which are soft."""

    hub: Rotation
    near: tuple[Directions, Directions]
    far: tuple[Directions, Directions]
    free_mask: Float[Array | np.ndarray, "coef place"]

    def to_current(self, x: Coordinates) -> Coordinates:
        """Vectors rotated from the reference axes to the current ones."""
        flat = x.tether.reshape(*x.tether.shape[:2], -1)
        turned = (self.hub[:, :, None] * flat[:, None]).sum(2)
        for near, far in zip(self.near, self.far, strict=True):
            turned = turned + far * (self.free_mask * (near * flat).sum(1))[:, None]
        hub = None if x.hub is None else matmul(x.hub, self.hub.T)
        ring = None if x.ring is None else (self.hub[:, :, None, None] * x.ring[None]).sum(1)
        return Coordinates(turned.reshape(x.tether.shape), hub, ring, x.reel)

    def to_reference(self, x: Coordinates) -> Coordinates:
        """Vectors rotated from the current axes to the reference ones."""
        return self._replace(hub=self.hub.T, near=self.far, far=self.near).to_current(x)


def axes_of(system: System, time: Scalar, q: Coordinates) -> Axes:
    """The axes of a configuration. A truss has the direction of the element beyond the node."""
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
    """0 for the positions of held roots, and 1 for all other nodal vectors."""
    tethers = system.tethers
    first = np.zeros((tethers.coefs, tethers.elements + 1, tethers.count))
    first[0, 0] = 1.0
    held = jnp.zeros(tethers.count)
    if system.roots is not None:
        held = system.roots.releases.where_released(held, jnp.ones(tethers.count))
    return (1.0 - first * held).reshape(tethers.coefs, -1)


def turn(before: Axes, after: Axes) -> Turn:
    """The rotation from one set of axes to another: R of the hub, and at the nodes

        (1 - (a + b) (a + b)^T / (1 + c) + 2 b a^T) R,    c = a . b,

    two reflections, where a is the tangent before, rotated with the hub, and b the tangent after."""
    hub = matmul(after.hub, before.hub.T)
    start, back = hub @ before.along, hub.T @ after.along
    cosine = dot(start, after.along)
    # At a node whose slope has vanished there is no direction, and the unit vectors are zero.
    turns = (1.0 + cosine > OPPOSITE) & (dot(start, start) * dot(back, back) > 0.5)
    halved = jnp.where(turns, -1.0 / (1.0 + cosine), 0.0) * (start + after.along)
    twice = jnp.where(turns, 2.0, 0.0) * after.along
    return Turn(hub, (before.along + back, before.along), (halved, twice), after.free_mask)
