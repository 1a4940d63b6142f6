"""Relative equilibrium: the shape of a system that turns steadily, or stands still, under its loads.

    M (Omega x (Omega x q) + a) + Phi_q^T lam = Q(q, Omega x q),      Phi(q) = 0

Found by Newton's method on the derivative of the residual, in steps that turn no element far. With a
hub the whole is free to accelerate along the spin axis, a = F_axial / m; its position along and its
angle about that axis are left as they were. The matrix is dense: sails of some hundred coordinates
take seconds, and nothing in a run's path needs this.

Loads count as they act at time 0. They are steady in the turning frame if they are symmetric about
its axis (a spin axis along the wind); elsewhere there is, in general, no equilibrium to find.
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
"""Newton steps at most."""

STEP_TOLERANCE = 1e-9
"""Newton step, relative to the largest coordinate, that ends the iteration: one more follows it, and
Newton's convergence is quadratic."""


MAX_SLOPE_CHANGE = 0.3
"""Largest change of r_x anywhere in one Newton step: longer steps leave the range in which a cable's
tangent says where its equilibrium is."""


class Equilibrium(NamedTuple):
    """q, lam at rest in `frame`; unbalanced: largest force [N] left; converged: did Newton's method end
    because its steps had become small?"""

    q: Coordinates
    lam: Multipliers
    frame: MovingFrame
    unbalanced: Scalar
    converged: Bool[Array, ""]


def equilibrium(system: System, start: Coordinates, spin: Vector) -> Equilibrium:
    """The relative equilibrium that Newton's method finds from `start`.

    spin: Omega [rad/s] of the frame through the origin, inertial components (zero: statics, without a
    hub only). Differentiable in the numbers of the system (implicit function theorem). Nothing raises
    here: look at `converged`. Where the matrix is singular (a straight cable without tension) it is false.
    """
    first, unravel = ravel_pytree(system.no_multipliers())
    zero = independent(system, start) * 0.0

    def at_rest(y, lam):
        """Forces and constraints, and the acceleration along the axis."""
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
        """The step from z = (y, lam)."""

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
    """What keeps a free system's place along and angle about the spin axis: without it the matrix is
    singular there. It changes nothing else, for these two directions have no force."""
    scale = jnp.abs(jnp.diag(matrix)).max()
    total = jnp.zeros_like(matrix)
    for motion in (translation(system, spin), rotation_about(system, spin, y)):
        unit = jnp.zeros(len(matrix)).at[: len(motion)].set(motion / jnp.linalg.norm(motion))
        total = total + scale * jnp.outer(unit, unit)
    return total


def equilibrated_solve(a: Float[Array, "n n"], b: Float[Array, " n"]) -> Float[Array, " n"]:
    """a^{-1} b after scaling rows and columns: axial, bending and hub rows differ by many orders."""
    largest = jnp.abs(a).max(1)
    scale = 1.0 / jnp.sqrt(jnp.where(largest > 0.0, largest, 1.0))
    return scale * jnp.linalg.solve(scale[:, None] * a * scale, scale * b)
