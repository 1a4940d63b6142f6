"""The temperature of the tethers as a function of time."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Instants, Int, PerTether, Scalar


class SteadyTemperature(eqx.Module):
    """A constant temperature T [K] of every tether."""

    value: PerTether

    def at(self, time: Instants) -> PerTether:
        """T [K]: the same at all instants."""
        return self.value

    def in_segment(self, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> "SteadyTemperature":
        """The same temperature."""
        return self


class TemperatureSeries(eqx.Module):
    """A temperature that is linear between instants, and constant before the first and after the last.

    time: increasing instants t_k [s], the knots. table: T [K], (instant, tether). The derivative of T jumps
    at a knot. A method of integration that passes a knot within a step loses its order there. A run is
    therefore divided at the knots, and in each segment T is the straight line of that segment, also where a
    step, or the rounding of an instant, passes the segment's ends.

    start, until: ends [s] of the segment; infinite ones for a series that is not divided.
    """

    time: Float[Array, " instant"]
    table: Float[Array, "instant tether"]
    start: Scalar
    until: Scalar

    @classmethod
    def undivided(
        cls, time: Float[Array, " instant"], table: Float[Array, "instant tether"]
    ) -> "TemperatureSeries":
        """The series of a run that has no segments yet."""
        ends = (jnp.full((), x, float) for x in (-jnp.inf, jnp.inf))
        return cls(time, table, *ends)

    def in_segment(self, start: Scalar | np.ndarray, until: Scalar | np.ndarray) -> "TemperatureSeries":
        """The series as a segment of a run sees it."""
        return eqx.tree_at(lambda series: (series.start, series.until), self, (start, until))

    def piece(self, time: Instants) -> Int[Array, "..."]:
        """Number of the straight line at each instant: 0 before the first knot. At a knot it is that of the
        line which begins there, but never one outside of the segment."""
        first, last = (self.time <= self.start).sum(), (self.time < self.until).sum()
        return jnp.clip((self.time <= time[..., None]).sum(-1), first, last)

    def at(self, time: Instants) -> Float[Array, "*state tether"]:
        """T [K] at one or several instants. time: one number, or (*state, 1)."""
        piece, count = self.piece(time), self.time.shape[0]
        a, b = jnp.maximum(piece - 1, 0), jnp.minimum(piece, count - 1)
        begin, duration = self.time[a], jnp.where(a == b, 1.0, self.time[b] - self.time[a])
        first, last = (self.table[x[..., 0] if x.ndim else x] for x in (a, b))
        return first + (last - first) * ((time - begin) / duration)
