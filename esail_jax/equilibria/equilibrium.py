"""Relative equilibrium: the shape in which a system rotates steadily, or rests, under its loads.

    M (Omega x (Omega x q) + a) + Phi_q^T lam = Q(q, Omega x q),      Phi(q) = 0

The solution is found by Newton's method with the derivative of the system's residual; the steps are
limited, so that no element rotates far in one of them. A system with a hub is free to accelerate along the
spin axis, a = F_axial / m; its position along this axis and its angle about it keep their values. The
matrix is dense: a sail of a few hundred coordinates takes seconds. No run needs this module.

Loads are evaluated at time 0. They are steady in the rotating frame if they are symmetric about its axis (a
spin axis along the wind). For other loads there is, in general, no relative equilibrium.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jax.flatten_util import ravel_pytree

from esail_jax.array_types import Array, Bool, Float, Scalar, Vector
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.equilibria.moving_frame import (
    MovingFrame,
    expanded,
    forces,
    independent,
    rotation_about,
    translation,
    uniform_inertia,
)
from esail_jax.system import System

MAX_ITERATIONS = 40
"""Largest number of Newton steps."""

STEP_TOLERANCE = 1e-9
"""The iteration ends when a Newton step, relative to the largest coordinate, is at most this. One more step
follows; the convergence of Newton's method is quadratic."""


MAX_SLOPE_CHANGE = 0.3
"""Largest change of r_x at any point in one Newton step. In longer steps the tangent of a cable no longer
points to its equilibrium."""


class Equilibrium(NamedTuple):
    """A relative equilibrium, as `equilibrium` returns it.

    q, lam: coordinates and multipliers, constant in `frame`
    frame: angular velocity and acceleration of the frame in which the system rests
    unbalanced: largest remaining force [N]
    converged: true if the steps of Newton's method became small; otherwise q is no equilibrium
    """

    q: Coordinates
    lam: Multipliers
    frame: MovingFrame
    unbalanced: Scalar
    converged: Bool[Array, ""]


def equilibrium(system: System, start: Coordinates, spin: Vector) -> Equilibrium:
    """Solves for the relative equilibrium by Newton's method from the coordinates `start`.

    spin: angular velocity Omega [rad/s] of the frame, whose axis goes through the origin, in inertial
    components. Zero stands for statics, which needs a system without a hub.

    The result is differentiable with respect to the numbers of the system (implicit function theorem).
    The function raises nothing: `converged` of the result is false if no equilibrium was found, for
    example because the matrix is singular (a straight cable without tension).
    """
    first, unravel = ravel_pytree(system.no_multipliers())
    zero = independent(system, start) * 0.0

    def at_rest(y, lam):
        """Returns the unbalanced forces with the constraints, and the acceleration along the axis."""
        frame, acceleration = MovingFrame(spin, jnp.zeros(3)), jnp.zeros(3)
        balance, constraints = forces(system, frame, y, zero, zero, unravel(lam))
        if system.hub is not None:
            axis = spin / jnp.linalg.norm(spin)
            along = translation(system, axis)
            mass = along @ uniform_inertia(system, axis)
            acceleration = -axis * (balance @ along) / mass
            balance = balance + uniform_inertia(system, acceleration)
        return jnp.concatenate([balance, ravel_pytree(constraints)[0]]), acceleration

    n = zero.size

    def newton(z):
        """Returns the Newton step from z = (y, lam)."""

        def left(z):
            return at_rest(z[:n], z[n:])[0]

        fixed = lax.stop_gradient(z)
        matrix = lax.stop_gradient(jax.jacfwd(left)(fixed))
        if system.hub is not None:
            matrix = matrix + gauge(system, lax.stop_gradient(spin), fixed[:n], matrix)
        return -equilibrated_solve(matrix, left(z))

    def small(step, z):
        return step <= STEP_TOLERANCE * jnp.abs(z[:n]).max()

    def unfinished(carry):
        z, step, count = carry
        return ~small(step, z) & (count < MAX_ITERATIONS)

    def iterate(carry):
        z, _, count = carry
        step = newton(z)
        slope_change = jnp.abs(
            system.tethers.interpolate(expanded(system, step[:n], derivative=1).tether).r_x
        )
        short = step * jnp.minimum(1.0, MAX_SLOPE_CHANGE / slope_change.max())
        return z + short, jnp.abs(step[:n]).max(), count + 1

    z = jnp.concatenate([independent(system, start), first])
    begin = (lax.stop_gradient(z), jnp.asarray(jnp.inf), 0)
    found, step, _ = lax.stop_gradient(lax.while_loop(unfinished, iterate, begin))
    settled = found + newton(found)
    left, acceleration = at_rest(settled[:n], settled[n:])
    return Equilibrium(
        q=expanded(system, settled[:n]),
        lam=unravel(settled[n:]),
        frame=MovingFrame(spin, acceleration),
        unbalanced=lax.stop_gradient(jnp.abs(left[:n]).max()),
        converged=small(step, found),
    )


def gauge(
    system: System, spin: Vector, y: Float[Array, " n"], matrix: Float[Array, "m m"]
) -> Float[Array, "m m"]:
    """Returns a matrix that fixes the position of a free system along the spin axis and its angle about it.

    Without this matrix the Newton matrix is singular in these two directions. The solution does not change
    otherwise, because no force acts in them."""
    scale = jnp.abs(jnp.diag(matrix)).max()
    total = jnp.zeros_like(matrix)
    for motion in (translation(system, spin), rotation_about(system, spin, y)):
        unit = jnp.zeros(len(matrix)).at[: len(motion)].set(motion / jnp.linalg.norm(motion))
        total = total + scale * jnp.outer(unit, unit)
    return total


def equilibrated_solve(a: Float[Array, "n n"], b: Float[Array, " n"]) -> Float[Array, " n"]:
    """Returns a^{-1} b, computed with scaled rows and columns: axial, bending and hub rows differ by many
    orders of magnitude."""
    largest = jnp.abs(a).max(1)
    scale = 1.0 / jnp.sqrt(jnp.where(largest > 0.0, largest, 1.0))
    return scale * jnp.linalg.solve(scale[:, None] * a * scale, scale * b)
