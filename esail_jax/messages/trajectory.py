"""A motion about the Sun as rows of position and velocity, and its interpolation between the rows.

Through the position and the velocity of m rows goes one polynomial of degree 2 m - 1 (Hermite):

    p(t) = sum_i l_i^2 ((1 - 2 (t - t_i) l_i'(t_i)) p_i + (t - t_i) v_i)

with Lagrange's polynomials l_i of the rows. The velocity is its derivative. The rows are those around the
instant; near the ends of the table they are the first or the last ones."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from esail_jax.calendar.instants import Instants, after, seconds_between


class Trajectory(NamedTuple):
    """Rows of a motion about the Sun: instants that increase, and heliocentric positions [m] and velocities
    [m/s] in the ecliptic of J2000."""

    at: Instants
    position: Float[np.ndarray, "time 3"]
    velocity: Float[np.ndarray, "time 3"]

    def first(self) -> Instants:
        """The instant of the first row."""
        return Instants(self.at.day[:1].reshape(()), self.at.second[:1].reshape(()), self.at.scale)

    def rows(self, which: slice) -> "Trajectory":
        """The motion with some of its rows."""
        at = Instants(self.at.day[which], self.at.second[which], self.at.scale)
        return Trajectory(at, self.position[which], self.velocity[which])

    def seconds(self, at: Instants) -> Float[np.ndarray, "*time"]:
        """The SI seconds from the first row to instants in the scale of the rows."""
        return seconds_between(self.first(), at)


def rows_of_degree(degree: int) -> int:
    """The number of rows whose polynomial has a degree, or the next odd one; two or more."""
    return max(degree // 2 + 1, 2)


def interpolated(
    rows: Trajectory, at: Instants, degree: int
) -> tuple[Float[np.ndarray, "*time 3"], Float[np.ndarray, "*time 3"]]:
    """Position [m] and velocity [m/s] at instants in the scale of the rows and within them, by polynomials
    of an odd degree, or of that of all rows if these are too few."""
    knots = rows.seconds(rows.at)
    count = min(rows_of_degree(degree), len(knots))
    wanted = rows.seconds(at)
    t = np.atleast_1d(wanted)
    # The instant is in the middle of its rows: between two of them if their number is even.
    places = np.searchsorted(knots, t, side="right") - 1
    if count % 2:
        nearest = np.minimum(places + 1, len(knots) - 1)
        places = np.where(np.abs(knots[nearest] - t) < np.abs(knots[places] - t), nearest, places)
    first = np.clip(places - (count - 1) // 2, 0, len(knots) - count)
    index = first[:, None] + np.arange(count)
    # Differences from the first row of each polynomial: a small part of the distance from the Sun.
    base = rows.position[first]
    position, velocity = hermite(
        knots[index], rows.position[index] - base[:, None], rows.velocity[index], t
    )
    shape = (*wanted.shape, 3)
    return (position + base).reshape(shape), velocity.reshape(shape)


def hermite(
    knots: Float[np.ndarray, "time row"],
    values: Float[np.ndarray, "time row 3"],
    slopes: Float[np.ndarray, "time row 3"],
    t: Float[np.ndarray, " time"],
) -> tuple[Float[np.ndarray, "time 3"], Float[np.ndarray, "time 3"]]:
    """Values and slopes at t of the polynomials, one for each t, through values and slopes at knots."""
    count = knots.shape[1]
    gaps = knots[:, :, None] - knots[:, None, :] + np.eye(count)
    away = t[:, None] - knots
    others = ~np.eye(count, dtype=bool)
    ratios = np.where(others, away[:, None, :] / gaps, 1.0)
    basis = ratios.prod(axis=2)
    basis_rate = np.zeros_like(basis)
    for k in range(count):
        without = np.where(np.arange(count) == k, 1.0, ratios).prod(axis=2)
        basis_rate += np.where(others[:, k], without / gaps[:, :, k], 0.0)
    lean = 2.0 * (others / gaps).sum(axis=2)
    of_value, of_slope = basis**2 * (1.0 - away * lean), basis**2 * away
    value_rate = 2.0 * basis * basis_rate * (1.0 - away * lean) - basis**2 * lean
    slope_rate = 2.0 * basis * basis_rate * away + basis**2

    def summed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.asarray(np.einsum("tr,trx->tx", a, values) + np.einsum("tr,trx->tx", b, slopes))

    return summed(of_value, of_slope), summed(value_rate, slope_rate)


def interpolation_error(rows: Trajectory, degree: int) -> tuple[float, float]:
    """The largest errors of the interpolated position [m] and velocity [m/s] when every second row is left
    out. They bound those between all rows, which are about 2^(degree + 1) and 2^degree times smaller for a
    smooth motion. There must be three rows or more.

    They are differences from the polynomials through all rows, at the rows that are left out, where the
    position errs most, and in the middle between all rows, where the velocity does. In the middle between
    the kept rows the error of the velocity vanishes, by symmetry."""
    kept = rows.rows(slice(0, None, 2))
    knots = rows.seconds(rows.at)[: 2 * len(kept.position) - 1]
    places = after(rows.first(), np.concatenate([knots[1::2], 0.5 * (knots[1:] + knots[:-1])]))
    errors = zip(interpolated(kept, places, degree), interpolated(rows, places, degree), strict=True)
    position, velocity = (float(np.linalg.norm(x - y, axis=1).max()) for x, y in errors)
    return position, velocity
