"""Makes initial states that no scene key describes: another shape of the tethers, with rigid rotation."""

import jax.numpy as jnp
import numpy as np

from esail_jax.coordinates import Coordinates
from esail_jax.simulation import blocks, entry
from esail_jax.simulation.prepare import Prepared


def with_start(prepared: Prepared, start: str) -> Prepared:
    """Returns the prepared scene with another start: "short 0.9", "arc 180" or "inwards 5"."""
    if not start:
        return prepared
    kind, number = start.split()
    system = prepared.problem.system
    q, v = state_of(prepared)
    q, v = {"short": shortened, "arc": bent, "inwards": moving}[kind](prepared, q, v, float(number))
    zero = jnp.zeros(())
    q, v = system.place_roots(zero, q), system.place_roots(zero, v, derivative=1)
    return prepared._replace(carry=carry_of(prepared, q, v))


def state_of(prepared: Prepared) -> tuple[Coordinates, Coordinates]:
    """Returns q and v at the start of the run."""
    carry = prepared.carry
    state = carry.state if isinstance(carry, entry.Carry) else carry.seen
    return state.q, state.v


def carry_of(prepared: Prepared, q: Coordinates, v: Coordinates):
    """Returns the initial state of the method for given q and v."""
    system = prepared.problem.system
    if not prepared.collocated:
        return entry.starting_carry(q, v, system)
    progress = prepared.problem.method.start(system, jnp.zeros(()), q, v)
    energy = blocks.observables.kinetic_energy(system, v) + blocks.observables.elastic_energy(system, q)
    return blocks.Carry(progress, energy, progress.now, progress.taken)


def omega_of(prepared: Prepared) -> jnp.ndarray:
    """Returns the initial angular velocity in I [rad/s]; X_B is the spin axis."""
    axis = prepared.problem.system.rotation(jnp.zeros(()), state_of(prepared)[0])[:, 0]
    return axis * prepared.scene.initial.spin_rate


def turning(prepared: Prepared, tether: jnp.ndarray) -> jnp.ndarray:
    """Returns the velocities of nodal vectors that rotate with the hub."""
    return jnp.moveaxis(jnp.cross(omega_of(prepared), jnp.moveaxis(tether, 1, -1)), -1, 1)


def shortened(prepared: Prepared, q: Coordinates, v: Coordinates, part: float):
    """Returns straight tethers that are compressed to a part of their initial length."""
    root = q.tether[:1, :, :1]
    tether = part * q.tether
    tether = tether.at[0].add((1.0 - part) * root[0])
    return q._replace(tether=tether), v._replace(tether=turning(prepared, tether))


def bent(prepared: Prepared, q: Coordinates, v: Coordinates, degrees: float):
    """Returns unstretched arcs of `degrees` in the spin plane, radial at their roots."""
    tethers = prepared.problem.system.tethers
    root, total = q.tether[0, :, 0], np.deg2rad(degrees)
    length = jnp.broadcast_to(tethers.element_length, (tethers.elements, tethers.count)).sum(0)
    outward = q.tether[0, :, -1] - root
    outward = outward / jnp.linalg.norm(outward, axis=0)
    axis = prepared.problem.system.rotation(jnp.zeros(()), q)[:, 0]
    sideways = jnp.cross(axis, outward.T).T
    turn = total * jnp.linspace(0.0, 1.0, tethers.elements + 1)[:, None]
    x, y = length / total * jnp.sin(turn), length / total * (1.0 - jnp.cos(turn))
    position = root[:, None] + outward[:, None] * x + sideways[:, None] * y
    slope = outward[:, None] * jnp.cos(turn) + sideways[:, None] * jnp.sin(turn)
    tether = jnp.stack([position, slope][: tethers.coefs])
    return q._replace(tether=tether), v._replace(tether=turning(prepared, tether))


def moving(prepared: Prepared, q: Coordinates, v: Coordinates, speed: float):
    """Returns tethers with a uniform rate of contraction; the tips move at `speed` [m/s] towards the
    root."""
    offset = q.tether.at[0].add(-q.tether[0, :, :1])
    reach = jnp.linalg.norm(offset[0, :, -1], axis=0)
    return q, v._replace(tether=v.tether - speed * offset / reach)
