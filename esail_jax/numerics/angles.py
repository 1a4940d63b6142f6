"""Angles, lengths and axes with finite derivatives, also where those of the textbook formulas are not."""

import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Rotation, Vector
from esail_jax.numerics.own_derivative import custom_jvp
from esail_jax.numerics.small_matrices import matmul

GIMBAL_LOCK = 1e-7
"""Gimbal lock is assumed if cos(theta) is below this; psi is then set to zero, as only psi and phi together
are determined."""


@custom_jvp
def smallest_eigenvector(matrix: Float[Array, "3 3"]) -> Vector:
    """The unit eigenvector of the smallest eigenvalue of a symmetric matrix.

    The derivative follows from A n = lambda n, n . n = 1 for this eigenvector alone. JAX's rule for `eigh`
    divides by the difference of the two other eigenvalues, which is zero for a symmetric sail.
    """
    return jnp.linalg.eigh(matrix)[1][:, 0]


@smallest_eigenvector.defjvp
def _smallest_eigenvector_jvp(primals, tangents):
    matrix, change = *primals, *tangents
    vector = smallest_eigenvector(matrix)
    stiffness = matrix - (vector @ matrix @ vector) * jnp.eye(3)
    bordered = jnp.block([[stiffness, -vector[:, None]], [-vector[None], jnp.zeros((1, 1))]])
    return vector, -jnp.linalg.solve(bordered, jnp.append(change @ vector, 0.0))[:3]


def safe_length(x: Array, y: Array) -> Array:
    """hypot(x, y), with derivative 0 at the origin."""
    squared = x**2 + y**2
    positive = squared > 0.0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, squared, 1.0)), 0.0)


def safe_angle(y: Array, x: Array) -> Array:
    """atan2(y, x), with derivative 0 at the origin."""
    origin = (x == 0.0) & (y == 0.0)
    return jnp.arctan2(jnp.where(origin, 0.0, y), jnp.where(origin, 1.0, x))


ROUNDING = 1e-10
"""Part of its size from which a vector has a direction: below it, rounding decides. Sums of forces that
balance each other are 1e-13 of the sum of their sizes; components of unit vectors are wrong by 1e-15 in
long runs."""


def where_defined(angle: Array, size: Array, of: Array | float) -> Array:
    """The direction of a vector, or NaN if the vector is rounding: if its `size` is at most
    ROUNDING times the size `of` what it was computed from, or zero."""
    return jnp.where(size > ROUNDING * of, angle, jnp.nan)


def euler_angles(rotation: Rotation) -> Vector:
    """The angles (psi, theta, phi) [rad] of a rotation matrix, in the sequence Z-Y-X.

    The columns of the matrix are the axes of the rotated frame. theta lies in [-pi/2, pi/2]; at gimbal lock
    psi is 0."""
    level = safe_length(rotation[0, 0], rotation[1, 0])
    locked = level < GIMBAL_LOCK
    psi = jnp.where(locked, 0.0, safe_angle(rotation[1, 0], rotation[0, 0]))
    theta = jnp.arctan2(-rotation[2, 0], level)
    phi = jnp.where(
        locked,
        safe_angle(-rotation[1, 2], rotation[1, 1]),
        safe_angle(rotation[2, 1], rotation[2, 2]),
    )
    return jnp.stack([psi, theta, phi])


def rotation_of(angles: Vector) -> Rotation:
    """The rotation matrix of angles (psi, theta, phi) [rad] in the sequence Z-Y-X, of which
    `euler_angles` is the inverse: R_z(psi) R_y(theta) R_x(phi)."""
    (a, b, c), (d, e, f) = jnp.cos(angles), jnp.sin(angles)
    return jnp.array(
        [[a * b, a * e * f - d * c, a * e * c + d * f], [d * b, d * e * f + a * c, d * e * c - a * f],
         [-e, b * f, b * c]]
    )  # fmt: skip


SMALL_SQUARE = 1e-4
"""Square of an angle [rad^2] below which the formula of Rodrigues takes its series: the first term that is
left out is 2e-16 of the first."""


def rotation_by(vector: Vector) -> Rotation:
    """The active rotation about a vector by the angle |vector| [rad] (formula of Rodrigues).

    Its derivatives of every order exist at zero, too: there it is a series in the square of the angle."""
    square = (vector**2).sum()
    small = square < SMALL_SQUARE
    angle = jnp.sqrt(jnp.where(small, 1.0, square))
    x, y, z = vector
    zero = jnp.zeros_like(x)
    cross = jnp.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]])
    once = jnp.where(small, 1.0 - square / 6.0 + square**2 / 120.0, jnp.sinc(angle / jnp.pi))
    half = 0.5 * jnp.sinc(0.5 * angle / jnp.pi) ** 2
    twice = jnp.where(small, 0.5 - square / 24.0 + square**2 / 720.0, half)
    return jnp.eye(3) + once * cross + twice * matmul(cross, cross)
