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
from esail_jax.joints.roots import Releases
from esail_jax.numerics.vectors import dot
from esail_jax.system import System

OPPOSITE = 0.1
"""1 + cos of the angle turned, below which a node's axes are turned with the hub only: the shortest turn to
the opposite direction is not unique."""

LEVI_CIVITA = -np.cross(np.eye(3)[:, None], np.eye(3))
"""e_ijk with (s x x)_i = sum_jk e_ijk x_j s_k."""

Directions = Float[Array, "3 node tether"]


class Axes(NamedTuple):
    """Attitude of the hub or of the turning frame, unit vectors along the tethers, and which of these
    are released."""

    hub: Rotation
    along: Directions
    releases: Releases = Releases()


class Turn(NamedTuple):
    """From one set of axes to another: the hub's rotation, and that of every node: first with the hub, then
    by the shortest turn between its directions. A held root's position turns with the hub only."""

    hub: Rotation
    nodes: Float[Array, "3 3 node tether"]
    releases: Releases = Releases()

    def forth(self, x: Coordinates) -> Coordinates:
        """Vectors turned."""
        coef, _, node, tether = x.tether.shape
        root = (np.arange(coef)[:, None, None, None] == 0) & (np.arange(node)[:, None] == 0)
        held = root & self.releases.free(jnp.zeros(tether, bool), jnp.ones(tether, bool))
        rotation = jnp.where(held[:, None], self.hub[:, :, None, None], self.nodes)
        turned = (rotation * x.tether[:, None]).sum(2)
        return Coordinates(turned, None if x.hub is None else x.hub @ self.hub.T)

    def back(self, x: Coordinates) -> Coordinates:
        """The inverse."""
        return self._replace(hub=self.hub.T, nodes=jnp.swapaxes(self.nodes, 0, 1)).forth(x)


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
    """What leads from one set of axes to the other: R of the hub, and at the nodes

        (c 1 + [s] + s s^T / (1 + c)) R,    c = a . b,  s = a x b,

    from a, the direction before turned with the hub, to b, that after."""
    hub = after.hub @ before.hub.T
    start = jnp.tensordot(hub, before.along, 1)
    cosine = dot(start, after.along)
    sine = jnp.cross(start, after.along, axis=0)
    # Without a direction, at a node whose slope has vanished, both are zero.
    near = (1.0 + cosine > OPPOSITE) & (cosine**2 + dot(sine, sine) > 0.5)
    cosine, sine = jnp.where(near, cosine, 1.0), jnp.where(near, sine, 0.0)
    # Term by term with R multiplied in, in one loop over the nodes.
    crossed = jnp.tensordot(LEVI_CIVITA, hub, ((1,), (0,)))
    back = jnp.tensordot(hub.T, sine / (1.0 + cosine), 1)
    nodes = (crossed[..., None, None] * sine[:, None]).sum(1)
    return Turn(hub, nodes + cosine * hub[:, :, None, None] + sine[:, None] * back, after.releases)
