"""Which coordinates of a sail act on each other: the sparsity of its linearised equations.

The nodes of an element act on each other, those of a tether and those of an auxiliary tether, whose first
and last nodes are the tips of two tethers. The hub acts on all. Nodes without a common neighbour have
columns without a common row (but the hub's) and can be differentiated together: they get one colour
(Curtis, Powell and Reid 1974). A tether needs three colours, whatever its number of elements; with a ring
there are some eight.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from esail_jax.array_types import Int
from esail_jax.system import System

Host = np.ndarray

NONE = -1
"""Stands for a coordinate that a node does not have."""


class Indices(NamedTuple):
    """Places of coordinates in y (`moving_frame.py`).

    tether: (coef, xyz, node, tether), with NONE for the roots' positions; hub: its twelve, empty without
    one; ring: of the own vectors of the auxiliary tethers, (xyz, vector, tether), without vectors if there
    are none."""

    tether: Int[Host, "coef 3 node tether"]
    hub: Int[Host, " hub"]
    ring: Int[Host, "3 vector tether"]

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return int((self.tether != NONE).sum()) + len(self.hub) + self.ring.size


class Couplings(NamedTuple):
    """The nodes of tethers and ring, and which of them act on each other.

    places: coordinates of every node in y, filled up with NONE; roots: the nodes at the roots, one for each
    tether; first, second: all pairs of nodes that act on each other, with every node and itself; colour: of
    every node."""

    places: Int[Host, "node slot"]
    roots: Int[Host, " tether"]
    first: Int[Host, " pair"]
    second: Int[Host, " pair"]
    colour: Int[Host, " node"]

    @property
    def seeds(self) -> list[tuple[int, int]]:
        """Pairs of a colour and a slot: the nodes' coordinates that are differentiated together."""
        used = self.places != NONE
        colours, slots = range(self.colour.max() + 1), range(used.shape[1])
        return [(c, s) for c in colours for s in slots if used[self.colour == c, s].any()]


def indices(system: System) -> Indices:
    """The places of all coordinates in y."""
    tethers, ring = system.tethers, system.ring
    k, n, p = tethers.coefs, tethers.elements, tethers.count
    cuts = (3 * k * n * p, 3 * (k * n + k - 1) * p)
    places = np.full((k, 3, n + 1, p), NONE)
    places[:, :, 1:] = np.arange(cuts[0]).reshape(k, 3, n, p)
    places[1:, :, 0] = np.arange(*cuts).reshape(k - 1, 3, p)
    hub = np.arange(cuts[1], cuts[1] + (12 if system.hub is not None else 0))
    vectors = 0 if ring is None else ring.own_vectors
    own = cuts[1] + len(hub) + np.arange(3 * vectors * p).reshape(3, vectors, p)
    return Indices(places, hub, own)


def couplings(system: System) -> Couplings:
    """The nodes of a sail and their couplings. The nodes of the tethers come first, those of the
    ring last; the ends of an auxiliary tether have its slopes there, for trusses nothing."""
    at, ring = indices(system), system.ring
    k, _, nodes, count = at.tether.shape
    tethers = np.arange(nodes * count).reshape(nodes, count)
    members: list[tuple[Host, ...]] = [(tethers[:-1], tethers[1:])]
    parts = [at.tether.transpose(2, 3, 0, 1).reshape(-1, 3 * k)]
    if ring is not None:
        m, last = ring.segments.coefs, ring.segments.elements
        nothing = np.full_like(tethers[0], NONE)
        end = np.full((3, 1, count), NONE)
        split = ring.own_vectors + 1 - m
        every = np.concatenate([end, at.ring[:, :split], end, at.ring[:, split:]], axis=1)
        parts.append(every.reshape(3, last + 1, m, count).transpose(1, 3, 2, 0).reshape(-1, 3 * m))
        own = nodes * count + np.arange((last + 1) * count).reshape(last + 1, count)
        tips = tethers[-1]
        for e in range(last):
            first = tips if e == 0 else nothing
            second = np.roll(tips, -1) if e == last - 1 else nothing
            members.append((first, own[e], own[e + 1], second))
    width = max(part.shape[1] for part in parts)
    places = np.concatenate(
        [np.pad(x, ((0, 0), (0, width - x.shape[1])), constant_values=NONE) for x in parts]
    )
    near = neighbours(members, len(places)).tocoo()
    return Couplings(places, tethers[0], near.row, near.col, colours(near))


def neighbours(members: list[tuple[Host, ...]], count: int) -> sp.csr_matrix:
    """The matrix whose entries are pairs of nodes in one element. members: the first nodes of
    elements, the second ones and so on; NONE for no node; count: number of nodes."""
    nodes = [np.stack([np.ravel(x) for x in group], axis=1) for group in members]
    pairs = []
    for group in nodes:
        for i in range(group.shape[1]):
            for j in range(group.shape[1]):
                pair = group[:, [i, j]]
                pairs.append(pair[(pair != NONE).all(axis=1)])
    row, column = np.concatenate(pairs).T
    return sp.csr_matrix((np.ones(len(row)), (row, column)), shape=(count, count))


def colours(near: sp.spmatrix) -> Int[Host, " node"]:
    """A colour for every node, so that nodes of one colour have no common neighbour. near: its
    entries are the neighbours, with every node itself."""
    common = sp.csr_matrix(near @ near.T)
    colour = np.full(common.shape[0], NONE)
    for node in range(len(colour)):
        others = colour[common.indices[common.indptr[node] : common.indptr[node + 1]]]
        colour[node] = np.setdiff1d(np.arange(len(others) + 1), others)[0]
    return colour
