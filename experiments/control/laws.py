"""Voltage laws of the experiments in this folder, written against the public interface only."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.environment.orbit import orbital_frame

VOLTS = 20e3
"""Mean voltage V_0 [V]."""


def aim_of(wind, sailing_angle):
    """Unit vector in I of the spin axis whose components in the orbital frame O are (sin alpha, 0,
    cos alpha), alpha the sailing angle [rad]."""
    return orbital_frame(wind) @ jnp.array([jnp.sin(sailing_angle), 0.0, jnp.cos(sailing_angle)])


def axis_of(measurements, lost):
    """Axis about which the sail turns: the angular momentum, or that of the remaining tips about the hub if
    tethers are lost, as the angular momentum includes the tethers that fly away."""
    if not lost:
        return measurements.momentum_axis
    kept = np.setdiff1d(np.arange(measurements.chords.shape[1]), np.array(lost) - 1)
    position, velocity = (x[:, kept] for x in motion_of_tips(measurements))
    momentum = jnp.cross(position, velocity, axis=0).sum(1)
    return momentum / jnp.linalg.norm(momentum)


def motion_of_tips(measurements):
    """Positions [m] and velocities [m/s] of the tips relative to the hub, in axes parallel to I."""
    turn = measurements.rotation
    position, rate = turn @ measurements.tip_position, turn @ measurements.angular_velocity
    return position, turn @ measurements.tip_velocity + jnp.cross(rate[:, None], position, axis=0)


def speeds_along_wind(measurements, axis):
    """Speed [m/s] of every tip along the wind, relative to a rigid sail that turns about an axis with the
    mean rate of the tips. Speeds relative to the hub would not do: the hub is light and nutates."""
    position, velocity = motion_of_tips(measurements)
    around = jnp.cross(axis[:, None], position, axis=0)
    spin = jnp.median((around * velocity).sum(0) / (around**2).sum(0))
    return measurements.wind @ (velocity - spin * around)


def miss_of(measurements, axis, sailing_angle):
    """The part of the aim normal to the axis, and the levers with which tethers turn the sail: the outward
    directions of the chords turned by 90 degrees."""
    aim = aim_of(measurements.wind, sailing_angle)
    miss = aim - axis * (axis @ aim)
    outward = measurements.outward_from(axis)
    return miss, jnp.cross(outward, axis[:, None], axis=0)


class Steering(eqx.Module):
    """Proportional and integral feedback of the direction of the angular momentum, and damping.

    V_i = V_0 (1 + (n . u) (g d + k s) . (e_i x n) - c w_i), n the axis (`axis_of`), d the miss, s its
    integral over time in units of an hour with a leak of one day, w_i the speed of the tip along the wind
    (`speeds_along_wind`). lost: numbers of tethers that are not counted.
    """

    gain: jax.Array
    integral: jax.Array
    damping: jax.Array
    sailing_angle: float | jax.Array = float(np.deg2rad(15.0))
    period: float = eqx.field(static=True, default=60.0)
    lost: tuple[int, ...] = eqx.field(static=True, default=())

    def towards(self, sailing_angle):
        """The law with another sailing angle [rad] as its aim."""
        return eqx.tree_at(lambda law: law.sailing_angle, self, sailing_angle)

    def init(self, measurements):
        return jnp.zeros(3)

    def update(self, measurements, total):
        axis = axis_of(measurements, self.lost)
        miss, levers = miss_of(measurements, axis, self.sailing_angle)
        wind = axis @ measurements.wind
        change = (self.gain * miss + self.integral * total) @ levers
        total = total * (1.0 - self.period / 86400.0) + miss * self.period / 3600.0
        damping = jnp.clip(self.damping * speeds_along_wind(measurements, axis), -0.5, 0.5)
        return VOLTS * (1.0 + wind * change - damping), total


class Policy(eqx.Module):
    """A network beside the gains: it sees the miss and its leaking integral along the lever of a tether,
    the speed of the tip along the wind and the tension, and adds up to a fifth of V_0.

    Its last layer is zero at first, so that the policy starts as the steering law that it contains. The
    gains of that law are trained as well."""

    net: eqx.nn.MLP
    steering: Steering

    def __init__(self, steering, width, key):
        net = eqx.nn.MLP(4, "scalar", width, 2, activation=jnp.tanh, key=key)
        last = net.layers[-1]
        zero = (jnp.zeros_like(last.weight), jnp.zeros_like(last.bias))
        self.net = eqx.tree_at(lambda n: (n.layers[-1].weight, n.layers[-1].bias), net, zero)
        self.steering = steering

    @property
    def period(self):
        return self.steering.period

    def init(self, measurements):
        return self.steering.init(measurements)

    def update(self, measurements, total):
        volts, after = self.steering.update(measurements, total)
        axis = measurements.momentum_axis
        miss, levers = miss_of(measurements, axis, self.steering.sailing_angle)
        speed = speeds_along_wind(measurements, axis)
        seen = jnp.stack(
            [50.0 * miss @ levers, 50.0 * total @ levers, speed, measurements.root_tension / 0.26 - 1.0]
        )
        return volts + 0.2 * VOLTS * jnp.tanh(jax.vmap(self.net, 1)(seen)), after
