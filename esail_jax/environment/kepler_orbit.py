"""A Kepler orbit about the Sun in closed form, and the tidal acceleration relative to a particle on it.

With the units r_0 of length and sqrt(r_0^3/mu) of time, s = r_0 . v_0 / sqrt(mu r_0), b = 2 - v_0^2 r_0/mu
(positive for an ellipse, negative for a hyperbola) and the functions c_k of Stumpff at z = b x^2, the
universal anomaly x at the time t is the root of Kepler's equation

    F(x) = x + s x^2 c_2(z) + (1 - b) x^3 c_3(z) - t,      dF/dx = r

(Battin 1987, An Introduction to the Mathematics and Methods of Astrodynamics, Sec. 4.5-4.6). F increases
with x. The root is found by Laguerre's method (Conway 1986), which converges with third order, from the
classical guess of the eccentric or hyperbolic anomaly: in 3 to 13 iterations for eccentricities from 0 to
30, 1 - 1e-8 among them. Its derivative is that of the implicit function.
"""

import math
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Float, Instants, Scalar, Vector, VectorPerPoint
from esail_jax.constants import SOLAR_MU
from esail_jax.numerics.own_derivative import custom_jvp
from esail_jax.numerics.vectors import dot

SERIES_TERMS = 10
"""Terms of the series of c_2 and c_3 for |z| < 1: the next one is below 1e-20."""

MOST_ITERATIONS = 40
"""Bound of the iterations. It is reached only if a number is not finite."""

CLOSE = 1e-7
"""Relative change of the anomaly at which the iteration ends: its next error is of order CLOSE^3."""

DEGREE = 5.0
"""Degree of the polynomial by which Laguerre's method approximates F (Conway 1986)."""

Numbers = Float[Array, "..."]
Parts = TypeVar("Parts")


class KeplerOrbit(eqx.Module):
    """The Kepler orbit about the Sun through a heliocentric position [m] with a velocity [m/s] at the time
    epoch [s]."""

    position: Vector
    velocity: Vector
    epoch: Scalar = eqx.field(default_factory=lambda: jnp.zeros(()))

    def at(self, time: Instants) -> tuple[Float[Array, "3 ..."], Float[Array, "3 ..."]]:
        """Heliocentric position [m] and velocity [m/s] at one or several instants [s]."""
        r0, v0 = (x.reshape(3, *(1,) * jnp.ndim(time)) for x in (self.position, self.velocity))
        length = jnp.sqrt((self.position**2).sum())
        rate = jnp.sqrt(SOLAR_MU / length**3)
        t = rate * (time - self.epoch)
        s = (self.position @ self.velocity) / (rate * length**2)
        b = 2.0 - (self.velocity @ self.velocity) / (rate * length) ** 2
        x = anomaly(t, *(jnp.broadcast_to(y, jnp.shape(t)) for y in (s, b)))
        z = b * x**2
        c2, c3 = stumpff(z)
        c1 = 1.0 - z * c3
        r = 1.0 + s * x * c1 + (1.0 - b) * x**2 * c2
        f, g = 1.0 - x**2 * c2, (t - x**3 * c3) / rate
        f_rate, g_rate = -rate * x * c1 / r, 1.0 - x**2 * c2 / r
        return f * r0 + g * v0, f_rate * r0 + g_rate * v0


class PlaceOnOrbit(eqx.Module):
    """A Kepler orbit of which only one or several instants are needed. There the position [m] and velocity
    [m/s] are known, so that Kepler's equation is not solved again."""

    position: Float[Array, "3 ..."]
    velocity: Float[Array, "3 ..."]

    def at(self, time: Instants) -> tuple[Float[Array, "3 ..."], Float[Array, "3 ..."]]:
        """The known position and velocity, in the shape of the instants, which must be the known ones."""
        shape = (3, *jnp.shape(time))
        return self.position.reshape(shape), self.velocity.reshape(shape)


def at_place(parts: Parts, place: PlaceOnOrbit | KeplerOrbit | None) -> Parts:
    """The parts of a model with another orbit, or with a known place instead of their orbit: Kepler's
    equation is then solved once for the tide, the wind and the laws. If `place` is None, the parts are
    returned as they are."""
    if place is None:
        return parts

    def is_orbit(x: Any) -> bool:
        return isinstance(x, KeplerOrbit | PlaceOnOrbit)

    return jax.tree.map(lambda x: place if is_orbit(x) else x, parts, is_leaf=is_orbit)


def tide(origin: Vector, r: VectorPerPoint) -> VectorPerPoint:
    """Acceleration [m/s^2] by the Sun at r, relative to a particle in free fall at the origin of r.

    a = mu (R/|R|^3 - (R + r)/|R + r|^3) = -(mu/|R|^3) (r + f (R + r)),   f = (1 + q)^(-3/2) - 1,
    q = r . (2 R + r)/|R|^2,    f = -q (3 + 3 q + q^2)/(s (1 + s)),   s = (1 + q)^(3/2)

    The last form has no difference of nearly equal numbers (Battin 1987, Sec. 8.4, of Encke's method). It
    is exact at any distance. origin: heliocentric position R [m]. r [m].
    """
    squared = origin @ origin
    place = origin.reshape(3, *(1,) * (r.ndim - 1))
    q = dot(r, 2.0 * place + r) / squared
    cubed = (1.0 + q) * jnp.sqrt(1.0 + q)
    f = -q * (3.0 + q * (3.0 + q)) / (cubed * (1.0 + cubed))
    return -SOLAR_MU / (squared * jnp.sqrt(squared)) * (r + f * (place + r))


# ---- Kepler's equation -------------------------------------------------------------------------


def stumpff(z: Numbers) -> tuple[Numbers, Numbers]:
    """Functions of Stumpff: c_2 = (1 - cos sqrt z)/z and c_3 = (sqrt z - sin sqrt z)/sqrt(z)^3, with
    hyperbolic functions for z < 0 and the power series for |z| < 1."""
    small = jnp.abs(z) < 1.0
    near = jnp.where(small, z, 0.0)
    series2 = series3 = jnp.zeros_like(z)
    for k in reversed(range(SERIES_TERMS)):
        series2 = 1.0 / math.factorial(2 * k + 2) - near * series2
        series3 = 1.0 / math.factorial(2 * k + 3) - near * series3
    p, h = jnp.sqrt(jnp.maximum(z, 1.0)), jnp.sqrt(jnp.maximum(-z, 1.0))
    far2 = jnp.where(z > 0.0, (1.0 - jnp.cos(p)) / p**2, (jnp.cosh(h) - 1.0) / h**2)
    far3 = jnp.where(z > 0.0, (p - jnp.sin(p)) / p**3, (jnp.sinh(h) - h) / h**3)
    return jnp.where(small, series2, far2), jnp.where(small, series3, far3)


def elapsed(x: Numbers, s: Numbers, b: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """The time at the anomaly x, F(x) + t, with its first two derivatives by x."""
    z = b * x**2
    c2, c3 = stumpff(z)
    c1, c0 = 1.0 - z * c3, 1.0 - z * c2
    time = x + x**2 * (s * c2 + (1.0 - b) * x * c3)
    return time, 1.0 + x * (s * c1 + (1.0 - b) * x * c2), s * c0 + (1.0 - b) * x * c1


def first_guess(t: Numbers, s: Numbers, b: Numbers) -> Numbers:
    """The anomaly from E = M + 0.85 e sign(sin M) of an ellipse, or from H = asinh(M/e) of a hyperbola."""
    h = jnp.sqrt(jnp.maximum(jnp.abs(b), 1e-12))
    e = jnp.sqrt((1.0 - b) ** 2 + b * s**2)
    start = jnp.arctan2(s * h, 1.0 - b)
    mean = start - s * h + h**3 * t
    turns = 2.0 * jnp.pi * jnp.round(mean / (2.0 * jnp.pi))
    ellipse = mean + 0.85 * e * jnp.sign(mean - turns) - start
    e = jnp.maximum(e, 1.0)
    start = jnp.arcsinh(s * h / e)
    hyperbola = jnp.arcsinh((s * h - start + h**3 * t) / e) - start
    return jnp.where(b > 0.0, ellipse, hyperbola) / h


@custom_jvp
def anomaly(t: Numbers, s: Numbers, b: Numbers) -> Numbers:
    """The universal anomaly x, the root of Kepler's equation."""

    def goes_on(state):
        x, change, count = state
        return (jnp.abs(change) > CLOSE * (1.0 + jnp.abs(x))).any() & (count < MOST_ITERATIONS)

    def correct(state):
        x, _, count = state
        time, r, slope = elapsed(x, s, b)
        miss = time - t
        root = jnp.sqrt(jnp.abs((DEGREE - 1.0) * ((DEGREE - 1.0) * r**2 - DEGREE * miss * slope)))
        change = DEGREE * miss / (r + root)
        return x - change, change, count + 1

    guess = first_guess(t, s, b)
    return lax.while_loop(goes_on, correct, (guess, jnp.full_like(guess, jnp.inf), 0))[0]


@anomaly.defjvp
def _anomaly_jvp(primals, tangents):
    """dx = (dt - partial F by s and b) / r."""
    x = anomaly(*primals)
    at_rest, change = jax.jvp(lambda s, b: elapsed(x, s, b)[0], primals[1:], tangents[1:])
    del at_rest
    return x, (tangents[0] - change) / elapsed(x, *primals[1:])[1]
