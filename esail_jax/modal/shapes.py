"""Shapes of modes: displacements along every tether, in the axes of that tether, of the hub, and of the
auxiliary tethers (`ring_shapes.py`)."""

from typing import NamedTuple

import numpy as np

from esail_jax.array_types import Complex, Float, Maybe
from esail_jax.equilibria.motions import rotation_about_x
from esail_jax.modal.ring_shapes import POINTS, RingPlaces, along_batch, ring_displacement, ring_places_of
from esail_jax.system import System

Host = np.ndarray

DIRECTIONS = ("axial", "in-plane", "out-of-plane")
"""Directions of a displacement: along the chord of the steady tether, along the azimuth, and normal to
both. The names of the first two axes of `Shape.tether`."""


class Shape(NamedTuple):
    """Displacements in one or several modes, the last axis, in any common unit of length.

    tether: at the points of `Places`, in the directions of DIRECTIONS; the first point is the root.
    hub: translation along, and rotation [1/m of the unit] about, the axes of B; zero without a hub. ring:
    of the auxiliary tethers, relative to the line between their ends, in the directions of DIRECTIONS; None
    without a ring."""

    tether: Complex[Host, "3 point tether mode"]
    hub: Complex[Host, "6 mode"]
    ring: Maybe[Complex[Host, "3 ring_point tether mode"]] = None


class Places(NamedTuple):
    """The points at which shapes are evaluated.

    distance: from the root along the undeformed tether [m], (point, tether); mass: what each point stands
    for [kg], (point, tether), the remote units at the last one; hub: mass and moments of inertia of the hub
    for its six motions; axes: unit vectors of DIRECTIONS (direction, component, tether), in the axes of
    each tether (along the spin axis, radial, azimuthal); ring: those of the ring, None without one."""

    distance: Float[Host, "point tether"]
    mass: Float[Host, "point tether"]
    hub: Float[Host, "6"]
    axes: Float[Host, "3 3 tether"]
    ring: Maybe[RingPlaces] = None


def nodal(system: System, local: Host, hub: Host) -> Host:
    """The nodal vectors (coef, node, component, tether, mode) of motions with a rigid hub.

    local: coordinates of the tethers (coordinate, tether, mode) in their own axes; hub: (6, mode)."""
    tethers = system.tethers
    k, n = tethers.coefs, tethers.elements
    count, modes = local.shape[1:]
    free = local[: 3 * n].reshape(n, 3, count, modes)
    root = np.zeros((1, 3, count, modes), local.dtype)
    if system.hub is not None:
        arms = arms_of(system)
        for i in range(count):
            turned = rotation_about_x(-2.0 * np.pi * i / tethers.count)
            arm = arms[:, i]
            root[0, :, i] = turned @ (hub[:3] + np.cross(hub[3:], arm, axis=0))
    displacements = np.concatenate([root, free])[None]
    if k == 1:
        return displacements
    slopes = local[3 * n : 3 * (2 * n + 1)]
    return np.concatenate([displacements, slopes.reshape(1, n + 1, 3, count, modes)])


def arms_of(system: System) -> Host:
    """The positions of the roots from the hub's centre, in B [m], (3, tether)."""
    return np.asarray(system.hub.base_points.T @ system.roots.weights)


def places_of(system: System, steady: Host) -> Places:
    """The points of shapes. steady: coordinates of the tethers in the equilibrium, (coordinate,
    tether), in their own axes with respect to the hub's centre."""
    tethers = system.tethers
    n, count = tethers.elements, tethers.count
    length = np.broadcast_to(np.asarray(tethers.element_length), (count,))
    inside = (np.arange(n * POINTS) + 0.5) / POINTS
    distance = np.concatenate([[0.0], inside, [n]])[:, None] * length
    share = np.asarray(tethers.line_density) * length / POINTS
    mass = np.concatenate([np.zeros((1, count)), np.tile(share, (n * POINTS, 1)), [tethers.tip_mass]])
    inertia = np.zeros(6)
    roots = np.zeros((3, count))
    if system.hub is not None:
        m = float(system.hub.second_moments[3, 3])
        inertia = np.concatenate([[m, m, m], np.diag(system.hub.inertia)])
        turns = [rotation_about_x(-2.0 * np.pi * i / count) for i in range(count)]
        roots = np.stack([turn @ arm for turn, arm in zip(turns, arms_of(system).T, strict=True)], axis=1)
    tip = steady[3 * (n - 1) : 3 * n] - roots
    chord = tip / np.linalg.norm(tip, axis=0)
    azimuthal = np.cross(np.array([[1.0], [0.0], [0.0]]), chord, axis=0)
    azimuthal /= np.linalg.norm(azimuthal, axis=0)
    axes = np.stack([chord, azimuthal, np.cross(chord, azimuthal, axis=0)])
    ring = None if system.ring is None else ring_places_of(system.ring, steady[3 * (n - 1) : 3 * n])
    return Places(distance, mass, inertia, axes, ring)


def shape_of(system: System, places: Places, local: Host, hub: Host, wave: int | None) -> Shape:
    """The shapes of motions with a rigid hub. local: (coordinate, tether, mode) for the first
    tethers of the sail; hub: (6, mode); wave: number of the wave of which `local` has the first tether;
    None if it has all tethers."""
    nodes = nodal(system, local, hub)
    vectors = along_batch(system.tethers, nodes)
    axes = places.axes[:, :, : local.shape[1]]
    ring = None
    if places.ring is not None:
        own = local[len(local) - 3 * system.ring.own_vectors :]
        ring = ring_displacement(system.ring, places.ring, nodes[0, -1], own, wave)
    return Shape(np.einsum("dit,iptm->dptm", axes, vectors), hub, ring)
