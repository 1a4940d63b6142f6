"""A bordered matrix written out in full, entry by entry, in NumPy.

The module does not use chains, ports or rings. Every block row is written, also those of the roots; the
roots are then expressed by the border's points, x = E z, E^T A E z = E^T b.
"""

import itertools

import numpy as np

from esail_jax.numerics.bordered import Vector


class Dense:
    """Numbering of all unknowns, (tether, block, row), then the extra ones, then the border; and the
    matrices made with it."""

    def __init__(self, matrix):
        blocks, size, _, p = matrix.diag.shape
        extra = 0 if matrix.local is None else matrix.local.shape[0] - (size - 3)
        border = 0 if matrix.border is None else len(matrix.border)
        count = p * (blocks * size + extra) + border
        numbers = np.arange(count)
        self.blocks = numbers[: p * blocks * size].reshape(p, blocks, size)
        self.extra = numbers[p * blocks * size : count - border].reshape(p, extra)
        self.border = numbers[count - border :]
        self.count = count

    def matrix(self, matrix, tips):
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
            if tips is not None:
                after, before = self.blocks[(i + 1) % p, last], self.blocks[(i - 1) % p, last]
                a[np.ix_(rows[last], after)] += tips.upper[:, :, i]
                a[np.ix_(rows[last], before)] += tips.lower[:, :, i]
        if matrix.border is not None:
            a[np.ix_(self.border, self.border)] += matrix.border
        return a

    @property
    def held(self):
        """The positions of the roots."""
        return self.blocks[:, 0, :3].reshape(-1)

    def roots_held(self, matrix):
        """E: the held rows follow the border's points, or stay where they are."""
        e = np.eye(self.count)
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
        return flat

    def unflatten(self, flat):
        """The inverse of `flatten`, of the last axis of an array."""
        blocks = np.moveaxis(flat[..., self.blocks], -3, -1)
        local = np.swapaxes(flat[..., self.extra], -1, -2) if self.extra.size else None
        return Vector(blocks, local, flat[..., self.border] if self.border.size else None)

    def independent(self, matrix, tips=None):
        """E^T A E."""
        e = self.roots_held(matrix)
        return e.T @ self.matrix(matrix, tips) @ e

    def solver(self, matrix, tips):
        """The map from right-hand sides to solutions, in all rows."""
        e, a = self.roots_held(matrix), self.independent(matrix, tips)
        return lambda rhs: e @ np.linalg.solve(a, e.T @ rhs)
