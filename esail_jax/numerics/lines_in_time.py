"""Numbers that are linear in time between given instants."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Instants, Int, Scalar


class LinesInTime(eqx.Module):
    """Numbers that are linear between instants, and constant before the first and after the last.

    time: increasing instants t_k [s], the knots. table: the numbers there, (instant, column). The
    derivative jumps at a knot. A method of integration that passes a knot within a step loses its order
    there. A run is therefore divided at the knots, and in each segment the numbers are the straight line of
    that segment, also where a step, or the rounding of an instant, passes the segment's ends.

    start, until: ends [s] of the segment; infinite ones for a table that is not divided.
    """

    time: Float[Array, " instant"]
    table: Float[Array, "instant column"]
    start: Scalar
    until: Scalar

    @classmethod
    def undivided(
        cls, time: Float[Array, " instant"], table: Float[Array, "instant column"]
    ) -> "LinesInTime":
        """The table of a run that has no segments yet."""
        ends = (jnp.full((), x, float) for x in (-jnp.inf, jnp.inf))
        return cls(time, table, *ends)

    def in_segment(self, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> "LinesInTime":
        """The table as a segment of a run sees it."""
        return eqx.tree_at(lambda lines: (lines.start, lines.until), self, (start, until))

    def piece(self, time: Instants) -> Int[Array, "..."]:
        """Number of the straight line at each instant: 0 before the first knot. At a knot it is that of the
        line which begins there, but never one outside of the segment."""
        first, last = (self.time <= self.start).sum(), (self.time < self.until).sum()
        return jnp.clip((self.time <= time[..., None]).sum(-1), first, last)

    def line(self, time: Instants) -> tuple[Array, Array, Array, Array]:
        """The line at each instant, which may be (*state, 1): the numbers of the knots at its ends, one per
        state; the time since its beginning [s]; and its duration [s], 1 of one outside the table."""
        piece, count = self.piece(time), self.time.shape[0]
        a, b = jnp.maximum(piece - 1, 0), jnp.minimum(piece, count - 1)
        since, duration = time - self.time[a], jnp.where(a == b, 1.0, self.time[b] - self.time[a])
        if piece.ndim:
            a, b = a[..., 0], b[..., 0]
        return a, b, since, duration

    def at(self, time: Instants) -> Float[Array, "*state column"]:
        """The numbers at one or several instants. time: one number, or (*state, 1)."""
        a, b, since, duration = self.line(time)
        first, last = self.table[a], self.table[b]
        return first + (last - first) * (since / duration)
