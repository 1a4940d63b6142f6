"""The sail of the experiments on control: tethers of one truss each, on an orbit of 1 au in a gusty wind.

A circumstance is a seed: it gives the wind and the errors of the lengths (standard deviation 10 m)."""

import jax
import jax.numpy as jnp
import numpy as np
from laws import aim_of

from esail_jax.environment.gusts import gusty_wind

DAY = 86400.0
TURN = 2.0 * np.pi / 4e-3
AIM = np.deg2rad(15.0)

SAVED = ["heliocentric_position", "tip_position_I", "voltage", "coning_angle", "lagging_angle"]


CONSTANT = {"voltage.maximum": None}
"""Override for runs with constant voltages, which take no limit."""

ORBIT = {
    "orbit.position_au": [1.0, 0.0, 0.0],
    "orbit.velocity": [0.0, 29.78e3, 0.0],
    "initial.heliocentric_position_au": None,
}


def sail(duration, sailing_angle_deg=14.0, interval=300.0, orbit=ORBIT):
    """Overrides of the built-in scene `baseline`, without a circumstance."""
    return {
        "tethers.count": 4,
        "tethers.elements": 1,
        "tethers.element": "truss",
        "tethers.bending": False,
        "tethers.bending_damping_time": None,
        "tethers.second_moment": None,
        "initial.sailing_angle_deg": sailing_angle_deg,
        "integrator.t_end": duration,
        "integrator.tolerance": 1e-8,
        "output.interval": interval,
        "voltage.maximum": 40e3,
    } | orbit


def circumstance(seed, duration):
    """Wind and lengths of a seed, as overrides."""
    wind = gusty_wind(seed, duration)
    lengths = 10e3 + 10.0 * np.random.default_rng(seed).standard_normal(4)
    return {"tethers.length": lengths} | {f"solar_wind.{name}": x for name, x in wind.items()}


def miss(run, sailing_angle=AIM):
    """Angle [rad] between the normal of the plane of the tips and its aim, at every saved instant."""
    arms = run["tip_position_I"] - run["tip_position_I"].mean(1, keepdims=True)
    normal = jnp.cross(arms, jnp.roll(arms, -1, axis=1)).sum(1)
    normal = normal / jnp.linalg.norm(normal, axis=1)[:, None]
    position = run["heliocentric_position"]
    wind = position / jnp.linalg.norm(position, axis=1)[:, None]
    aims = jax.vmap(lambda u: aim_of(u, sailing_angle))(wind)
    return jnp.arcsin(jnp.linalg.norm(jnp.cross(normal, aims), axis=1))
