"""Interpolation between rows: polynomials are exact, and the stated error bounds that of an orbit."""

import numpy as np
import pytest
import spiceypy

from esail_jax.calendar.instants import Instants, after, read_instant
from esail_jax.messages.trajectory import Trajectory, interpolated, interpolation_error, rows_of_degree
from support.ellipses import Ellipse

RNG = np.random.default_rng(71)
START = read_instant("2016-12-31T12:00:00", "x")
DAY = 86400.0
ORBIT = Ellipse(1.5e11, 0.2, 365.25 * DAY, 0.0)


def rows_of(motion, times):
    return Trajectory(after(START, times), motion.position(times).T, motion.velocity(times).T)


class Polynomial:
    """A motion with coefficients (3, degree + 1), from the highest power of t/DAY on."""

    def __init__(self, coefficients):
        self.coefficients = coefficients

    def position(self, t):
        return np.array([np.polyval(x, t / DAY) for x in self.coefficients])

    def velocity(self, t):
        return np.array([np.polyval(np.polyder(x), t / DAY) for x in self.coefficients]) / DAY


@pytest.mark.parametrize("degree", [3, 5, 7, 9])
def test_a_polynomial_of_the_degree_is_exact(degree):
    """Everywhere, with rows at unequal distances, also where the rows are those at an end; and of one
    degree more it is not."""
    times = np.sort(RNG.uniform(0.0, 3.0 * DAY, 12))
    wanted = np.concatenate([times, RNG.uniform(times[0], times[-1], 200)])
    motion = Polynomial(RNG.normal(size=(3, degree + 1)))
    position, velocity = interpolated(rows_of(motion, times), after(START, wanted), degree)
    assert np.abs(position - motion.position(wanted).T).max() < 1e-11 * np.abs(position).max()
    assert np.abs(velocity - motion.velocity(wanted).T).max() < 1e-10 * np.abs(velocity).max()
    higher = Polynomial(np.ones((3, degree + 2)))
    position, _ = interpolated(rows_of(higher, times), after(START, wanted), degree)
    assert np.abs(position - higher.position(wanted).T).max() > 1e-9 * np.abs(position).max()


@pytest.mark.parametrize("degree", [3, 5, 7, 11])
def test_polynomials_are_those_of_spice(tmp_path, degree):
    """Of a kernel with rows and Hermite polynomials (type 13), with rows at unequal distances: the same
    rows are chosen, also at the ends and if their number is odd."""
    times = np.cumsum(RNG.uniform(2.0, 6.0, 20)) * DAY
    rows = rows_of(ORBIT, times)
    states = 1e-3 * np.hstack([rows.position, rows.velocity]).copy(order="C")
    path = str(tmp_path / "rows.bsp")
    handle = spiceypy.spkopn(path, "rows", 0)
    spiceypy.spkw13(
        handle, -999, 10, "ECLIPJ2000", times[0], times[-1], "rows", degree, len(times), states, times
    )
    spiceypy.spkcls(handle)
    wanted = np.concatenate([times, RNG.uniform(times[0], times[-1], 300)])
    spiceypy.furnsh(path)
    try:
        known = [spiceypy.spkgeo(-999, t, "ECLIPJ2000", 10)[0] for t in wanted]
    finally:
        spiceypy.unload(path)
    position, velocity = interpolated(rows, after(START, wanted), degree)
    assert np.abs(position - 1e3 * np.array(known)[:, :3]).max() < 1e-2
    assert np.abs(velocity - 1e3 * np.array(known)[:, 3:]).max() < 1e-7


def test_a_row_is_itself():
    times = np.arange(0.0, 40.0, 2.0) * DAY
    rows = rows_of(ORBIT, times)
    position, velocity = interpolated(rows, rows.at, 7)
    assert np.array_equal(position, rows.position)
    assert np.array_equal(velocity, rows.velocity)
    one, _ = interpolated(rows, after(START, np.array(3.0 * DAY)), 7)
    assert one.shape == (3,)


@pytest.mark.parametrize("degree", [3, 4, 5, 7, 9])
def test_the_stated_error_bounds_that_between_the_rows(degree):
    """On a Kepler orbit with a leap second between two rows; and it grows with the power of the degree."""
    times = np.arange(0.0, 101.0, 4.0) * DAY
    rows = rows_of(ORBIT, times)
    stated = interpolation_error(rows, degree)
    wanted = np.linspace(times[0], times[-1], 3001)
    found = interpolated(rows, after(START, wanted), degree)
    known = ORBIT.position(wanted).T, ORBIT.velocity(wanted).T
    errors = [np.linalg.norm(x - y, axis=1) for x, y in zip(found, known, strict=True)]
    assert stated[0] > errors[0].max() and stated[1] > errors[1].max()
    twice = interpolation_error(rows.rows(slice(None, None, 2)), degree)
    odd = degree + 1 - degree % 2
    for grown, power in zip(np.log2(np.divide(twice, stated)), (odd + 1, odd), strict=True):
        assert abs(grown - power) < 0.25 * power


def test_a_leap_second_between_two_rows_counts():
    """The rows are as far apart as the clock of TAI says: a second is 30 km of the orbit."""
    times = 43200.5 + 600.0 * np.arange(-3.0, 4.0)
    rows = rows_of(ORBIT, times)
    assert rows.at.second[3] == DAY + 0.5 and rows.at.second[4] == 599.5
    wanted = np.array([43000.0, 43199.5, 43200.25, 43201.0, 43300.0])
    found, _ = interpolated(rows, after(START, wanted), 7)
    assert np.abs(found - ORBIT.position(wanted).T).max() < 1e-3
    without = rows._replace(at=Instants(*after(Instants(*START[:2], "TDB"), times)[:2], "UTC"))
    shifted, _ = interpolated(without, after(START, wanted), 7)
    assert np.linalg.norm(shifted - ORBIT.position(wanted).T, axis=1)[-1] > 1e4


def test_few_rows_have_the_degree_that_they_can():
    rows = rows_of(ORBIT, np.array([0.0, DAY]))
    middle = after(START, np.array(0.5 * DAY))
    assert np.array_equal(interpolated(rows, middle, 7)[0], interpolated(rows, middle, 3)[0])
    assert [rows_of_degree(x) for x in (1, 2, 3, 4, 5, 7, 8)] == [2, 2, 2, 3, 3, 4, 5]
