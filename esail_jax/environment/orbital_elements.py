"""Osculating Kepler elements of a motion about the Sun."""

import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Vector
from esail_jax.constants import SOLAR_MU
from esail_jax.numerics.angles import safe_angle, safe_length

FLAT = 1e-14
"""Rounding: a smaller sine of the inclination, or eccentricity, counts as zero."""


def orbital_elements(position: Vector, velocity: Vector) -> Float[Array, "6"]:
    """Elements of the Kepler orbit about the Sun through a heliocentric position r [m] with a velocity v
    [m/s], in ecliptic axes (Battin 1987, Sec. 3.4):

    a [m] (negative for a hyperbola), e, and the angles [rad] i in [0, pi] and, in (-pi, pi], the longitude
    of the ascending node, the argument of the pericentre and the true anomaly.

    In the plane of the ecliptic the node is on the X axis; a circle has its pericentre at the node. The
    derivatives of undefined angles are zero. FLAT is the bound of sin i and of e for both.
    """
    r = jnp.sqrt(position @ position)
    h = jnp.cross(position, velocity)
    normal = h / jnp.sqrt(h @ h)
    e_vector = jnp.cross(velocity, h) / SOLAR_MU - position / r
    e = safe_length(safe_length(e_vector[0], e_vector[1]), e_vector[2])
    a = 1.0 / (2.0 / r - (velocity @ velocity) / SOLAR_MU)
    inclination = safe_angle(safe_length(h[0], h[1]), h[2])
    flat = safe_length(normal[0], normal[1]) < FLAT
    node = jnp.where(flat, 0.0, safe_angle(h[0], -h[1]))
    toward_node = jnp.stack([jnp.cos(node), jnp.sin(node), jnp.zeros(())])
    circle = e < FLAT
    to_pericentre = jnp.where(circle, toward_node, e_vector)
    beside = jnp.cross(normal, to_pericentre)
    argument = safe_angle(to_pericentre @ jnp.cross(normal, toward_node), to_pericentre @ toward_node)
    return jnp.stack([
        a, e, inclination, node, argument, safe_angle(position @ beside, position @ to_pericentre)
    ])  # fmt: skip
