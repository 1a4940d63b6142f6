"""Makes initial states that no scene key describes: another shape of the tethers, with rigid rotation."""

import jax
import jax.numpy as jnp
import numpy as np

import esail_jax as esail
from esail_jax.coordinates import Coordinates
from esail_jax.scenes.build import build
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.structure import split
from esail_jax.steppers.stepper import Point
from esail_jax.system import Power, System


def start_of(scene: esail.Scene, start: str) -> Point | None:
    """The initial state "short 0.9", "arc 180" or "inwards 5" of a scene; None for the scene's
    own."""
    if not start:
        return None
    kind, number = start.split()
    model = jax.jit(build, static_argnums=0)(*split(with_method(scene)))
    system, zero = model.system, jnp.zeros(())
    # X_B is the spin axis.
    omega = system.rotation(zero, model.q)[:, 0] * scene.initial.spin_rate
    shape = {"short": shortened, "arc": bent, "inwards": moving}[kind]
    q, v = shape(system, model.q, model.v, omega, float(number))
    q, v = system.place_roots(zero, q), system.place_roots(zero, v, derivative=1)
    return Point(zero, q, v, Power(zero, zero), jnp.asarray(True))


def rotating(omega: jnp.ndarray, tether: jnp.ndarray) -> jnp.ndarray:
    """The velocities of nodal vectors that rotate with the hub; omega: angular velocity in I
    [rad/s]."""
    return jnp.moveaxis(jnp.cross(omega, jnp.moveaxis(tether, 1, -1)), -1, 1)


def shortened(system: System, q: Coordinates, v: Coordinates, omega: jnp.ndarray, part: float):
    """Straight tethers that are compressed to a part of their initial length."""
    root = q.tether[:1, :, :1]
    tether = part * q.tether
    tether = tether.at[0].add((1.0 - part) * root[0])
    return q._replace(tether=tether), v._replace(tether=rotating(omega, tether))


def bent(system: System, q: Coordinates, v: Coordinates, omega: jnp.ndarray, degrees: float):
    """Unstretched arcs of `degrees` in the spin plane, radial at their roots."""
    tethers = system.tethers
    root, total = q.tether[0, :, 0], np.deg2rad(degrees)
    length = jnp.broadcast_to(tethers.element_length, (tethers.elements, tethers.count)).sum(0)
    outward = q.tether[0, :, -1] - root
    outward = outward / jnp.linalg.norm(outward, axis=0)
    axis = system.rotation(jnp.zeros(()), q)[:, 0]
    sideways = jnp.cross(axis, outward.T).T
    turn = total * jnp.linspace(0.0, 1.0, tethers.elements + 1)[:, None]
    x, y = length / total * jnp.sin(turn), length / total * (1.0 - jnp.cos(turn))
    position = root[:, None] + outward[:, None] * x + sideways[:, None] * y
    slope = outward[:, None] * jnp.cos(turn) + sideways[:, None] * jnp.sin(turn)
    tether = jnp.stack([position, slope][: tethers.coefs])
    return q._replace(tether=tether), v._replace(tether=rotating(omega, tether))


def moving(system: System, q: Coordinates, v: Coordinates, omega: jnp.ndarray, speed: float):
    """Tethers with a uniform rate of contraction; the tips move at `speed` [m/s] towards the
    root."""
    offset = q.tether.at[0].add(-q.tether[0, :, :1])
    reach = jnp.linalg.norm(offset[0, :, -1], axis=0)
    return q, v._replace(tether=v.tether - speed * offset / reach)
