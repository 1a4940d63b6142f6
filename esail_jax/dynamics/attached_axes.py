"""Axes that move with a sail: the hub's, and at every node of a tether some along it.

In such axes inertia, elasticity and rigidity change slowly, however far the structure turns. A matrix
factored at one configuration is used at another by turning residuals back and solutions forth. Along
a tether that matters most: it is stiff in its own direction and slack across, so that an error d in the
direction couples d^2 of the axial stiffness into the transverse motion.
"""

from typing import NamedTuple

import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Nodal, Rotation, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.joints.roots import Releases
from esail_jax.numerics.vectors import dot
from esail_jax.system import System

OPPOSITE = 0.1
"""1 + cos of the angle turned, below which a node's axes are turned with the hub only: the shortest turn to
the opposite direction is not unique."""

Directions = Float[Array, "3 node tether"]


class Axes(NamedTuple):
    """Attitude of the hub or of the turning frame, unit vectors along the tethers, and which of these
    are released."""

    hub: Rotation
    along: Directions
    releases: Releases = Releases()


class Turn(NamedTuple):
    """From one set of axes to another: first with the hub, then every node but a held root by the shortest
    turn between its directions, with the cosine and the vector (of the length of the sine)."""

    hub: Rotation
    cosine: Float[Array, "node tether"]
    sine: Directions
    releases: Releases = Releases()

    def forth(self, x: Coordinates) -> Coordinates:
        """Vectors turned."""
        turned = x.rotate(self.hub)
        return turned._replace(tether=self._at_nodes(turned.tether, self.sine))

    def back(self, x: Coordinates) -> Coordinates:
        """The inverse."""
        return x._replace(tether=self._at_nodes(x.tether, -self.sine)).rotate(self.hub.T)

    def _at_nodes(self, nodal: Nodal, sine: Directions) -> Nodal:
        halving = 1.0 / (1.0 + self.cosine)

        def turned(x):
            lever = dot(sine, x) * halving
            return self.cosine * x + jnp.cross(sine, x, axis=0) + lever * sine

        nodes = jnp.stack([turned(x) for x in nodal])
        root = self.releases.free(nodes[0, :, 0], nodal[0, :, 0])
        return nodes.at[0, :, 0].set(root)


def axes_of(system: System, time: Scalar, q: Coordinates) -> Axes:
    """Axes of a configuration. A truss has the direction of the element beyond the node."""
    if system.tethers.coefs == 2:
        along = q.tether[1]
    else:
        links = jnp.diff(q.tether[0], axis=1)
        along = jnp.concatenate([links, links[:, -1:]], axis=1)
    squared = dot(along, along)
    length = jnp.sqrt(jnp.where(squared > 0.0, squared, 1.0))
    releases = Releases() if system.roots is None else system.roots.releases
    return Axes(system.rotation(time, q), along / length, releases)


def turn(before: Axes, after: Axes) -> Turn:
    """What leads from one set of axes to the other."""
    hub = after.hub @ before.hub.T
    start = jnp.tensordot(hub, before.along, 1)
    cosine = dot(start, after.along)
    sine = jnp.cross(start, after.along, axis=0)
    # Without a direction, at a node whose slope has vanished, both are zero.
    near = (1.0 + cosine > OPPOSITE) & (cosine**2 + dot(sine, sine) > 0.5)
    return Turn(hub, jnp.where(near, cosine, 1.0), jnp.where(near, sine, 0.0), after.releases)
