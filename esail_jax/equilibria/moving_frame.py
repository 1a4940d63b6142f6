"""Equations of motion in a frame that rotates steadily and is uniformly accelerated.

The frame is parallel to the inertial frame at time 0. With the coordinates x in this frame,

    v = x' + Omega x x,      vdot = x'' + 2 Omega x x' + Omega x (Omega x x) + a,

so that centrifugal, gyroscopic and damping terms all follow from the system's residual. A state at rest in
the frame is a relative equilibrium (`equilibrium.py`); small motions about it are modes (`modes.py`). The
unknowns are the independent coordinates y [m]: all nodal vectors except the root positions, with slopes
multiplied by the element length, and the hub's base points.
"""

import equinox as eqx
import jax
import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Vector
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.system import System


class MovingFrame(eqx.Module):
    """Angular velocity Omega [rad/s] and acceleration a [m/s^2] of a frame, inertial components at time
    0."""

    spin: Vector
    acceleration: Vector

    def turned(self, q: Coordinates) -> Coordinates:
        """Omega x r for every vector r."""
        tether = jnp.cross(self.spin, q.tether, axisb=1, axisc=1)
        ring = None if q.ring is None else jnp.cross(self.spin, q.ring, axisb=0, axisc=0)
        return Coordinates(tether, None if q.hub is None else jnp.cross(self.spin, q.hub), ring)

    def velocity(self, q: Coordinates, rate: Coordinates) -> Coordinates:
        """v of a motion x, x' in the frame."""
        return rate.axpy(1.0, self.turned(q))

    def vdot(self, q: Coordinates, rate: Coordinates, second: Coordinates) -> Coordinates:
        """vdot of a motion x, x', x'' in the frame. The acceleration a acts on points, not on
        slopes; that of a ring's own points is added by `forces`."""
        coriolis = second.axpy(2.0, self.turned(rate)).axpy(1.0, self.turned(self.turned(q)))
        tether = coriolis.tether.at[0].add(self.acceleration[:, None, None])
        hub = None if coriolis.hub is None else coriolis.hub + self.acceleration
        return Coordinates(tether, hub, coriolis.ring)


def independent(system: System, q: Coordinates) -> Float[Array, " n"]:
    """The independent coordinates y [m] of given coordinates."""
    tether = system.tethers.scale_slopes(q.tether)
    parts = [tether[:, :, 1:], tether[1:, :, 0]] + ([] if q.hub is None else [q.hub])
    parts += [] if q.ring is None else [q.ring]
    return jnp.concatenate([part.reshape(-1) for part in parts])


def expanded(system: System, y: Float[Array, " n"], derivative: int = 0) -> Coordinates:
    """The coordinates that belong to y (derivative = 0) or to a displacement of y (derivative = 1).

    The result is linear in a displacement. Roots follow the hub, or rest in the rotating frame."""
    tethers = system.tethers
    k, n, p = tethers.coefs, tethers.elements, tethers.count
    cuts = (3 * k * n * p, 3 * (k * n + k - 1) * p)
    nodes = y[: cuts[0]].reshape(k, 3, n, p)
    root = jnp.concatenate([jnp.zeros((1, 3, p)), y[cuts[0] : cuts[1]].reshape(k - 1, 3, p)])
    tether = jnp.concatenate([root[:, :, None], nodes], axis=2)
    if k == 2:
        tether = jnp.stack([tether[0], tether[1] / tethers.element_length])
    hub, last = None, y[cuts[1] :]
    if system.hub is not None:
        hub, last = last[:12].reshape(4, 3), last[12:]
    q = Coordinates(tether, hub, last.reshape(3, -1, p) if last.size else None)
    if derivative and system.hub is None:
        return q
    return system.place_roots(jnp.zeros(()), q)


def forces(
    system: System,
    frame: MovingFrame,
    y: Float[Array, " n"],
    rate: Float[Array, " n"],
    second: Float[Array, " n"],
    lam: Multipliers,
) -> tuple[Float[Array, " n"], Multipliers]:
    """The residuals of the equations of motion, conjugate to y [N], and of the constraints [m], for
    y, y', y'' in the frame."""
    time = jnp.zeros(())
    q = expanded(system, y)
    x1, x2 = (expanded(system, d, derivative=1) for d in (rate, second))
    vdot = frame.vdot(q, x1, x2)
    if vdot.ring is not None:
        vdot = vdot._replace(ring=vdot.ring + system.ring.uniform(frame.acceleration))
    residual, _ = system.residual(time, q, frame.velocity(q, x1), vdot, lam)
    return conjugate(system, residual.forces), residual.constraints


def conjugate(system: System, forces: Coordinates) -> Float[Array, " n"]:
    """The generalized forces on y that belong to nodal forces: the transpose of `expanded`."""
    zero = jnp.zeros(independent(system, forces).shape)
    return jax.vjp(lambda d: expanded(system, d, derivative=1), zero)[1](forces)[0]


def uniform_inertia(system: System, acceleration: Vector) -> Float[Array, " n"]:
    """M times a uniform acceleration of a system with a hub, conjugate to y [N]."""
    hub = system.hub.mass_matrix @ jnp.broadcast_to(acceleration, (4, 3))
    inertia = system.member_inertia(uniform(system, acceleration))
    return conjugate(system, inertia._replace(hub=hub))


def uniform(system: System, vector: Vector) -> Coordinates:
    """Coordinates with `vector` as every position of tethers and ring, and zero slopes; without
    the hub."""
    ring = None if system.ring is None else system.ring.uniform(vector)
    return Coordinates(system.tethers.uniform(vector), None, ring)


def translation(system: System, direction: Vector) -> Float[Array, " n"]:
    """The displacement of y in a uniform translation of a system with a hub."""
    hub = jnp.broadcast_to(direction, (4, 3))
    return independent(system, uniform(system, direction)._replace(hub=hub))


def rotation_about(system: System, spin: Vector, y: Float[Array, " n"]) -> Float[Array, " n"]:
    """The displacement of y in a rotation about the axis of `spin` through the origin."""
    return independent(system, MovingFrame(spin, jnp.zeros(3)).turned(expanded(system, y)))
