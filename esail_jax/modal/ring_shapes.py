"""Shapes of modes along the auxiliary tethers that join the tips of neighbouring tethers into a ring.

The tips carry the ends of an auxiliary tether. Its own motion is the displacement relative to the straight
line between its ends; it is zero for a single truss.
"""

from typing import NamedTuple

import numpy as np

from esail_jax.array_types import Complex, Float
from esail_jax.elements.ring import Ring
from esail_jax.elements.tether import TetherBatch
from esail_jax.equilibria.motions import rotation_about_x

Host = np.ndarray

POINTS = 8
"""Number of points per element at which a shape is evaluated. The highest vibration that a cubic element
can have changes its sign three times in it."""


class RingPlaces(NamedTuple):
    """The points along the auxiliary tethers at which shapes are evaluated.

    mass: what each point stands for [kg], (point, tether), zero at the ends; axes: unit vectors along the
    chord, in the spin plane across it, outwards, and normal to both (direction, component, tether), in the
    axes of the tether from whose tip the segment starts."""

    mass: Float[Host, "ring_point tether"]
    axes: Float[Host, "3 3 tether"]


def along_batch(batch: TetherBatch, nodes: Host) -> Host:
    """Vectors (component, point, tether, mode) at the first node, at POINTS points of every element
    and at the last node, from nodal vectors (coef, node, component, tether, mode) with slopes in metres."""
    xi = (np.arange(POINTS) + 0.5) / POINTS
    table = batch.shape_table(xi, 0)
    ends = [nodes[c, here] for here in (slice(-1), slice(1, None)) for c in range(batch.coefs)]
    inside = np.einsum("qa,aeitm->ieqtm", table, np.stack(ends))
    inside = inside.reshape(3, -1, *nodes.shape[-2:])
    return np.concatenate([nodes[0, 0][:, None], inside, nodes[0, -1][:, None]], axis=1)


def ring_places_of(ring: Ring, tips: Float[Host, "3 tether"]) -> RingPlaces:
    """The points of shapes. tips: positions of the tips in the equilibrium, each in the axes of its
    own tether with respect to the hub's centre."""
    segments = ring.segments
    count = segments.count
    length = np.broadcast_to(np.asarray(segments.element_length), (count,))
    share = np.asarray(segments.line_density) * length / POINTS
    end = np.zeros((1, count))
    mass = np.concatenate([end, np.tile(share, (segments.elements * POINTS, 1)), end])
    chord = following(tips[:, :, None], count, None)[..., 0] - tips
    chord /= np.linalg.norm(chord, axis=0)
    outwards = np.cross(chord, np.array([[1.0], [0.0], [0.0]]), axis=0)
    outwards /= np.linalg.norm(outwards, axis=0)
    return RingPlaces(mass, np.stack([chord, outwards, np.cross(chord, outwards, axis=0)]))


def following(tips: Host, count: int, wave: int | None) -> Host:
    """Vectors (component, tether, mode) of the next tethers in the axes of each tether. wave: as
    for `shape_of`."""
    turned = rotation_about_x(2.0 * np.pi / count)
    others = np.roll(tips, -1, axis=1) if wave is None else np.exp(2j * np.pi * wave / count) * tips
    return np.einsum("ij,jtm->itm", turned, others)


def ring_displacement(
    ring: Ring, places: RingPlaces, tips: Host, own: Host, wave: int | None
) -> Complex[Host, "3 ring_point tether mode"]:
    """Displacements relative to the line between the ends of each segment, in the axes of `places`.

    tips: displacements (component, tether, mode); own: own vectors of the segments (coordinate, tether,
    mode), both in the axes of the tethers; wave: as for `shape_of`."""
    segments = ring.segments
    k, n = segments.coefs, segments.elements
    first, last = tips, following(tips, segments.count, wave)
    vectors = own.reshape(ring.own_vectors, *tips.shape)
    split = ring.own_vectors + 1 - k
    every = np.concatenate([first[None], vectors[:split], last[None], vectors[split:]])
    moved = along_batch(segments, np.moveaxis(every.reshape(n + 1, k, *tips.shape), 1, 0))
    inside = (np.arange(n * POINTS) + 0.5) / (n * POINTS)
    x = np.concatenate([[0.0], inside, [1.0]])[:, None, None]
    line = (1.0 - x) * first[:, None] + x * last[:, None]
    return np.einsum("dit,iptm->dptm", places.axes[:, :, : tips.shape[1]], moved - line)
