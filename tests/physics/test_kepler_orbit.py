"""The closed form of a Kepler orbit, the Sun's tide, orbital elements: against longer numbers and exact
laws."""

import decimal

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.constants import ASTRONOMICAL_UNIT as AU
from esail_jax.constants import SOLAR_MU
from esail_jax.environment.kepler_orbit import KeplerOrbit, PlaceOnOrbit, anomaly, tide
from esail_jax.environment.orbital_elements import orbital_elements
from esail_jax.loads.fields import SolarTide
from support.quick import jit

ORBITS = {
    "nearly circular": (0.0, 29.78e3, 10.0),
    "eccentric": (3e3, 8e3, 2e3),
    "nearly parabolic": (0.0, 42121.9, 1.0),
    "hyperbola": (-20e3, 45e3, 5e3),
}
"""Velocities [m/s] at 1 au on the X axis."""

at = jit(lambda orbit, time: orbit.at(time))


def orbit_of(name):
    return KeplerOrbit(jnp.array([AU, 0.0, 0.0]), jnp.array(ORBITS[name]))


def propagated(position, velocity, time):
    """Position after a time, in numbers of 64 bits of mantissa, from the eccentric or hyperbolic anomaly:
    not the equation that the package solves. The bisection needs no derivative."""
    r, v = (np.asarray(x, np.longdouble) for x in (position, velocity))
    mu, t = np.longdouble(SOLAR_MU), np.longdouble(time)
    size = np.sqrt(r @ r)
    a = 1 / (2 / size - v @ v / mu)
    h = np.array([r[1] * v[2] - r[2] * v[1], r[2] * v[0] - r[0] * v[2], r[0] * v[1] - r[1] * v[0]])
    cross = np.array([v[1] * h[2] - v[2] * h[1], v[2] * h[0] - v[0] * h[2], v[0] * h[1] - v[1] * h[0]])
    apse = cross / mu - r / size
    e = np.sqrt(apse @ apse)
    p = apse / e
    q = np.array([h[1] * p[2] - h[2] * p[1], h[2] * p[0] - h[0] * p[2], h[0] * p[1] - h[1] * p[0]])
    q = q / np.sqrt(h @ h)
    x, y, rate = r @ p, r @ q, np.sqrt(mu / abs(a) ** 3)
    if a > 0:
        start = np.arctan2(y / np.sqrt(1 - e**2), x + a * e)
        mean = start - e * np.sin(start) + rate * t

        def miss(u):
            return u - e * np.sin(u) - mean
    else:
        start = np.arcsinh(y / (-a * np.sqrt(e**2 - 1)))
        mean = e * np.sinh(start) - start + rate * t

        def miss(u):
            return e * np.sinh(u) - u - mean

    low, high = (mean - 1.1, mean + 1.1) if a > 0 else (np.longdouble(-60), np.longdouble(60))
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if miss(middle) < 0 else (low, middle)
    if a > 0:
        return a * (np.cos(low) - e) * p + a * np.sqrt(1 - e**2) * np.sin(low) * q
    return -a * (e - np.cosh(low)) * p - a * np.sqrt(e**2 - 1) * np.sinh(low) * q


@pytest.mark.parametrize("name", ORBITS)
def test_orbit_against_longer_numbers(name, validate):
    """Positions along ten years agree with those of longer numbers to 1e-12 of the distance.

    The anomaly is known to about 1e-16 of itself, that is to 1e-14 of a turn after ten years, and a time to
    1e-16 of ten years; an orbit magnifies both ten- to a hundredfold near its pericentre."""
    orbit, times = orbit_of(name), np.array([1.0, 86400.0, 1e7, 3.15576e7, 3.15576e8, -2e7])
    found = np.asarray(at(orbit, jnp.asarray(times))[0]).T
    exact = np.array([propagated(orbit.position, orbit.velocity, t) for t in times])
    error = (np.linalg.norm(found - exact, axis=1) / np.linalg.norm(exact, axis=1)).max()
    validate(
        f"ORB-1 {name}", "Kepler orbit", "eccentric or hyperbolic anomaly in longer numbers",
        "position / distance, ten years", float(error), 1e-12,
    )  # fmt: skip


def test_anomaly_against_bisection(validate):
    """Eccentric anomalies of ellipses with e from 0 to 0.999 agree with bisection of Kepler's equation in
    longer numbers: from the pericentre and from a place after it, over 1e-9 to 100 radians of mean anomaly.

    The error is measured in the equation's own terms: t, s and b are rounded, which moves the anomaly by
    2e-16 (1 + |M|)/(1 - e cos E), a time by its rounding over the rate. Measured: 1.5 of these units."""
    e, mean, start = (
        x.ravel()
        for x in np.meshgrid(
            [0.0, 1e-8, 0.1, 0.5, 0.9, 0.95, 0.99, 0.999],
            [1e-9, 1e-6, 1e-4, 1e-3, 0.01, 0.1, 0.5, 1.0, 2.0, 3.0, 3.14159, 3.2, 4.5, 6.2, 6.283, 100.0],
            [0.0, 1e-3, 0.3, 2.0],
        )
    )
    e, mean, start = (np.asarray(x, np.longdouble) for x in (e, mean, start))
    begun = start - e * np.sin(start)
    distance = 1 - e * np.cos(start)
    given = mean / distance**1.5, e * np.sin(start) / np.sqrt(distance), distance
    x = jit(anomaly)(*(jnp.asarray(np.asarray(y, float)) for y in given))
    found = start + np.sqrt(distance) * np.asarray(x)
    low, high = begun + mean - 1.1, begun + mean + 1.1
    for _ in range(80):
        middle = (low + high) / 2
        above = middle - e * np.sin(middle) > begun + mean
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    unit = 2.2e-16 * (1 + np.abs(low)) / (1 - e * np.cos(low))
    validate(
        "ORB-5", "Kepler's equation, e to 0.999", "bisection in longer numbers",
        "anomaly / its change by rounding", float((np.abs(found - low) / unit).max()), 10.0,
    )  # fmt: skip


@pytest.mark.parametrize("name", ORBITS)
def test_derivatives_of_the_orbit(name):
    """The time derivative of the position is the velocity, that of the velocity is gravity, to rounding
    (1e-11 of their sizes: the anomaly after half a year loses two digits); and the derivative by the start
    is symplectic, as for every Hamiltonian motion: S^T J S = J."""
    orbit, time, one = orbit_of(name), jnp.asarray(1.6e7), jnp.ones(())

    @jit
    def derivatives(orbit, time):
        rates = jax.jvp(orbit.at, (time,), (one,))

        def end(x):
            # In units of 1 au and of the rate of a year, so that all entries are of order one.
            r, v = KeplerOrbit(x[:3] * AU, x[3:] * 3e4).at(time)
            return jnp.concatenate([r / AU, v / 3e4])

        start = jnp.concatenate([orbit.position / AU, orbit.velocity / 3e4])
        return rates, jax.jacfwd(end)(start), jax.jacrev(end)(start)

    ((r, v), (velocity, acceleration)), forward, reverse = derivatives(orbit, time)
    gravity = -SOLAR_MU * r / np.linalg.norm(r) ** 3
    assert np.allclose(velocity, v, rtol=0, atol=1e-11 * np.linalg.norm(v))
    assert np.allclose(acceleration, gravity, rtol=0, atol=1e-11 * np.linalg.norm(gravity))
    j = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
    size = np.abs(forward).max() ** 2
    assert np.allclose(forward.T @ j @ forward, j, rtol=0, atol=1e-12 * size)
    assert np.allclose(forward, reverse, rtol=0, atol=1e-12 * np.abs(forward).max())


@pytest.mark.parametrize("size", [1e-3, 1e4, 1e10, 1e11])
def test_tide_has_no_cancellation(size):
    """The tide at distances from a millimetre to 1e11 m has all its digits: it agrees with the difference
    of two accelerations in numbers of 60 digits to 1e-15 of its size (a few roundings)."""
    decimal.getcontext().prec = 60
    origin, r = np.array([AU, 0.3 * AU, 1e9]), size * np.array([0.3, -0.7, 0.2])
    big, small = ([decimal.Decimal(float(x)) for x in y] for y in (origin, r))
    place = [a + b for a, b in zip(big, small, strict=True)]
    cubes = [sum(x * x for x in y) ** decimal.Decimal("1.5") for y in (big, place)]
    mu = decimal.Decimal(SOLAR_MU)
    exact = [float(mu * (a / cubes[0] - b / cubes[1])) for a, b in zip(big, place, strict=True)]
    found = tide(jnp.asarray(origin), jnp.asarray(r))
    assert np.abs(found - np.array(exact)).max() < 1e-15 * np.abs(exact).max()


def test_tide_on_slopes():
    """A slope gets the derivative of the tide along it: -(mu/R^3) (I - 3 k k^T) near the origin, k the unit
    vector from the Sun, to r/R = 1e-7."""
    origin, node = jnp.array([0.0, AU, 0.0]), jnp.array([[1e3, 2e3, 3e3], [0.6, 0.8, 0.0]])
    field = SolarTide(PlaceOnOrbit(origin, jnp.zeros(3)))
    nodal = node[:, :, None, None]
    found = field.at_nodes(jnp.zeros(()), nodal, jnp.zeros_like(nodal))[:, :, 0, 0]
    gradient = -SOLAR_MU / AU**3 * np.diag([1.0, -2.0, 1.0])
    assert np.allclose(found, node @ gradient, rtol=1e-6, atol=1e-20)


@pytest.mark.parametrize("angles", [(0.4, 2.1, -1.3, 2.7), (2.9, -0.5, 0.8, -3.0), (0.0, 0.0, 1.2, 0.4)])
@pytest.mark.parametrize("e", [0.3, 1.4])
def test_orbital_elements(angles, e):
    """Elements of positions and velocities that were made of elements. An ellipse and a hyperbola, in the
    plane of the ecliptic too, prograde and retrograde; 1e-14 is rounding."""
    tilt, node, argument, anomaly = angles
    anomaly = anomaly if e < 1 else 0.5 * anomaly
    a = 1.3 * AU if e < 1 else -0.8 * AU

    def about(axis, x):
        c, s = np.cos(x), np.sin(x)
        i, j = {"x": (1, 2), "z": (0, 1)}[axis]
        turn = np.eye(3)
        turn[[i, j], [i, j]] = c
        turn[i, j], turn[j, i] = -s, s
        return turn

    p = a * (1.0 - e**2)
    r = p / (1.0 + e * np.cos(anomaly)) * np.array([np.cos(anomaly), np.sin(anomaly), 0.0])
    v = np.sqrt(SOLAR_MU / p) * np.array([-np.sin(anomaly), e + np.cos(anomaly), 0.0])
    turn = about("z", node) @ about("x", tilt) @ about("z", argument)
    found = orbital_elements(jnp.asarray(turn @ r), jnp.asarray(turn @ v))
    assert np.allclose(found, [a, e, tilt, node, argument, anomaly], rtol=1e-14, atol=1e-14)


def test_elements_of_a_circle_have_finite_derivatives():
    """Angles that are not defined on a circle in the ecliptic are zero there, with finite derivatives."""
    r, v = jnp.array([0.0, AU, 0.0]), jnp.array([-float(np.sqrt(SOLAR_MU / AU)), 0.0, 0.0])
    elements = orbital_elements(r, v)
    assert np.allclose(elements[0], AU, rtol=1e-14) and np.allclose(elements[1:4], 0.0, atol=1e-15)
    assert np.allclose(elements[4] + elements[5], 0.5 * np.pi)
    slopes = jax.jacrev(orbital_elements, (0, 1))(r, v)
    assert all(bool(jnp.isfinite(x).all()) for x in slopes)
