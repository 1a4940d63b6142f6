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
from esail_jax.numerics.known_solution import known_solution
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


class Balance(NamedTuple):
    """The equations of a relative equilibrium, in the unknowns z = (y, lam): independent coordinates, then
    multipliers in one vector.

    spin: angular velocity Omega [rad/s] of the frame."""

    system: System
    spin: Vector

    def split(self, z: Float[Array, " n"]) -> tuple[Float[Array, " y"], Multipliers]:
        """The independent coordinates and the multipliers."""
        first, unravel = ravel_pytree(self.system.no_multipliers())
        n = z.size - first.size
        return z[:n], unravel(z[n:])

    def at_rest(self, z: Float[Array, " n"]) -> tuple[Float[Array, " n"], Vector]:
        """The unbalanced forces with the constraints, and the acceleration along the axis."""
        y, lam = self.split(z)
        zero = jnp.zeros_like(y)
        frame, acceleration = MovingFrame(self.spin, jnp.zeros(3)), jnp.zeros(3)
        balance, constraints = forces(self.system, frame, y, zero, zero, lam)
        if self.system.hub is not None:
            axis = self.spin / jnp.linalg.norm(self.spin)
            along = translation(self.system, axis)
            mass = along @ uniform_inertia(self.system, axis)
            acceleration = -axis * (balance @ along) / mass
            balance = balance + uniform_inertia(self.system, acceleration)
        return jnp.concatenate([balance, ravel_pytree(constraints)[0]]), acceleration

    def left(self, z: Float[Array, " n"]) -> Float[Array, " n"]:
        """The unbalanced forces with the constraints."""
        return self.at_rest(z)[0]

    def solve(self, z: Float[Array, " n"], rhs: Float[Array, " n"]) -> Float[Array, " n"]:
        """The change of z that changes `left` by the right-hand side."""
        matrix = jax.jacfwd(self.left)(z)
        if self.system.hub is not None:
            matrix = matrix + gauge(self.system, self.spin, self.split(z)[0], matrix)
        return equilibrated_solve(matrix, rhs)


def equilibrium(system: System, start: Coordinates, spin: Vector) -> Equilibrium:
    """Solves for the relative equilibrium by Newton's method from the coordinates `start`.

    spin: angular velocity Omega [rad/s] of the frame, whose axis goes through the origin, in inertial
    components. Zero stands for statics, which needs a system without a hub.

    The result has derivatives of any order with respect to the numbers of the system (implicit function
    theorem); the iterations carry none. The function raises nothing: `converged` of the result is false if
    no equilibrium was found, for example because the matrix is singular (a straight cable without tension).
    """
    balance = Balance(system, spin)
    fixed, start = lax.stop_gradient((balance, start))

    def size(z):
        return jnp.abs(fixed.split(z)[0]).max()

    def small(step, z):
        return step <= STEP_TOLERANCE * size(z)

    def unfinished(carry):
        z, step, count = carry
        return ~small(step, z) & (count < MAX_ITERATIONS)

    def iterate(carry):
        z, _, count = carry
        step = fixed.solve(z, -fixed.left(z))
        moved = expanded(fixed.system, fixed.split(step)[0], derivative=1)
        slope_change = jnp.abs(fixed.system.tethers.interpolate(moved.tether).r_x)
        short = step * jnp.minimum(1.0, MAX_SLOPE_CHANGE / slope_change.max())
        return z + short, size(step), count + 1

    z = jnp.concatenate([independent(system, start), ravel_pytree(system.no_multipliers())[0]])
    begin = (lax.stop_gradient(z), jnp.asarray(jnp.inf), 0)
    reached, step, _ = lax.while_loop(unfinished, iterate, begin)
    last = reached + fixed.solve(reached, -fixed.left(reached))
    settled = known_solution(Balance.left, Balance.solve, balance, last)
    left, acceleration = balance.at_rest(settled)
    y, lam = balance.split(settled)
    return Equilibrium(
        q=expanded(system, y),
        lam=lam,
        frame=MovingFrame(spin, acceleration),
        unbalanced=lax.stop_gradient(jnp.abs(left[: y.size]).max()),
        converged=small(step, reached),
    )


def gauge(
    system: System, spin: Vector, y: Float[Array, " n"], matrix: Float[Array, "m m"]
) -> Float[Array, "m m"]:
    """A matrix that fixes the position of a free system along the spin axis and its angle about it.

    Without this matrix the Newton matrix is singular in these two directions. The solution does not change
    otherwise, because no force acts in them."""
    scale = jnp.abs(jnp.diag(matrix)).max()
    total = jnp.zeros_like(matrix)
    for motion in (translation(system, spin), rotation_about(system, spin, y)):
        unit = jnp.zeros(len(matrix)).at[: len(motion)].set(motion / jnp.linalg.norm(motion))
        total = total + scale * jnp.outer(unit, unit)
    return total


def equilibrated_solve(a: Float[Array, "n n"], b: Float[Array, " n"]) -> Float[Array, " n"]:
    """a^{-1} b, computed with scaled rows and columns: axial, bending and hub rows differ by many
    orders of magnitude."""
    largest = jnp.abs(a).max(1)
    scale = 1.0 / jnp.sqrt(jnp.where(largest > 0.0, largest, 1.0))
    return scale * jnp.linalg.solve(scale[:, None] * a * scale, scale * b)
