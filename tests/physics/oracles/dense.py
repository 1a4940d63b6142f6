"""A bordered matrix written out in full, entry by entry, in NumPy.

The module does not use chains, ports or rings. Every block row is written, also those of the roots and of
both ends of a ring's segments; the roots are then expressed by the border's points, and the ends of
segments by the last blocks of the chains, x = E z, E^T A E z = E^T b.
"""

import itertools

import numpy as np

from esail_jax.numerics.bordered import Vector


class Dense:
    """Numbering of all unknowns, (tether, block, row), then the extra ones, then those of the segments
    (segment, block, row), then the border; and the matrices made with it."""

    def __init__(self, matrix):
        blocks, size, _, p = matrix.diag.shape
        extra = 0 if matrix.local is None else matrix.local.shape[0] - (size - 3)
        border = 0 if matrix.border is None else len(matrix.border)
        ring = (0, 0) if matrix.segments is None else matrix.segments.diag.shape[:2]
        count = p * (blocks * size + extra + ring[0] * ring[1]) + border
        numbers = np.arange(count)
        cuts = p * blocks * size, p * (blocks * size + extra)
        self.blocks = numbers[: cuts[0]].reshape(p, blocks, size)
        self.extra = numbers[cuts[0] : cuts[1]].reshape(p, extra)
        self.ring = numbers[cuts[1] : count - border].reshape(p, *ring)
        self.border = numbers[count - border :]
        self.count = count

    def matrix(self, matrix):
        """A in all rows and columns."""
        a = np.zeros((self.count, self.count))
        p, last = self.blocks.shape[0], self.blocks.shape[1] - 1
        for i in range(p):
            rows = self.blocks[i]
            for k in range(last + 1):
                a[np.ix_(rows[k], rows[k])] += matrix.diag[k, :, :, i]
            for k in range(last):
                a[np.ix_(rows[k], rows[k + 1])] += matrix.upper[k, :, :, i]
                a[np.ix_(rows[k + 1], rows[k])] += matrix.lower[k, :, :, i]
            local = np.concatenate([rows[0, 3:], self.extra[i]])
            if matrix.local is not None:
                a[np.ix_(local, local)] += matrix.local[:, :, i]
            if matrix.local_border is not None:
                a[np.ix_(local, self.border)] += matrix.local_border[:, :, i]
                a[np.ix_(self.border, local)] += matrix.border_local[:, :, i]
            for k, here in enumerate(self.ring[i]):
                a[np.ix_(here, here)] += matrix.segments.diag[k, :, :, i]
            for k, pair in enumerate(itertools.pairwise(self.ring[i])):
                a[np.ix_(*pair)] += matrix.segments.upper[k, :, :, i]
                a[np.ix_(*pair[::-1])] += matrix.segments.lower[k, :, :, i]
        if matrix.border is not None:
            a[np.ix_(self.border, self.border)] += matrix.border
        return a

    @property
    def ends(self):
        """The positions of both ends of all segments, and those of the tips that they are."""
        ends = np.concatenate([self.ring[:, :1, :3].reshape(-1), self.ring[:, -1:, :3].reshape(-1)])
        tips = self.blocks[:, -1, :3]
        both = np.concatenate([tips.reshape(-1), np.roll(tips, -1, axis=0).reshape(-1)])
        return ends, both[: len(ends)]

    @property
    def held(self):
        """The positions of the roots and of the ends of segments."""
        return np.concatenate([self.blocks[:, 0, :3].reshape(-1), self.ends[0]])

    def roots_held(self, matrix):
        """E: the held rows follow the border's points, or stay where they are; ends of segments follow the
        tips."""
        e = np.eye(self.count)
        ends, tips = self.ends
        e[ends, ends] = 0.0
        e[ends, tips] = 1.0
        for i, root in enumerate(self.blocks[:, 0, :3]):
            e[root, root] = 0.0
            if matrix.weights is not None:
                for axis, (k, weight) in itertools.product(range(3), enumerate(matrix.weights[:, i])):
                    e[root[axis], self.border[3 * k + axis]] = weight
        return np.delete(e, self.held, axis=1)

    def flatten(self, vector):
        flat = np.zeros(self.count)
        flat[self.blocks] = np.moveaxis(vector.blocks, -1, 0)
        if vector.local is not None:
            flat[self.extra] = np.transpose(vector.local)
        if vector.border is not None:
            flat[self.border] = vector.border
        if vector.ring is not None:
            flat[self.ring] = np.moveaxis(vector.ring, -1, 0)
        return flat

    def unflatten(self, flat):
        """The inverse of `flatten`, of the last axis of an array."""
        blocks = np.moveaxis(flat[..., self.blocks], -3, -1)
        local = np.swapaxes(flat[..., self.extra], -1, -2) if self.extra.size else None
        ring = np.moveaxis(flat[..., self.ring], -3, -1) if self.ring.size else None
        return Vector(blocks, local, flat[..., self.border] if self.border.size else None, ring)

    def independent(self, matrix):
        """E^T A E."""
        e = self.roots_held(matrix)
        return e.T @ self.matrix(matrix) @ e

    def solver(self, matrix):
        """The map from right-hand sides to solutions, in all rows."""
        e, a = self.roots_held(matrix), self.independent(matrix)
        return lambda rhs: e @ np.linalg.solve(a, e.T @ rhs)
