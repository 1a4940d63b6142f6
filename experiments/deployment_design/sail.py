"""The sail of this experiment, its limits, and a run in which the duration is a number with a derivative.

The instants of a table of rates and the end of a run are plain numbers, without a derivative. But a motion
that takes a times as long is the same motion with rates a times as large, forces and stiffness a^2 times,
and damping times 1/a times: every run here takes REFERENCE seconds, and its duration T is in these
numbers."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

import esail_jax as esail
from esail_jax.array_types import Array
from esail_jax.physics import TipLoad

COUNT, START, GOAL = 4, 50.0, 1000.0
MASS, MODULUS, DAMPING = 0.5, 70e9, 1.0
SPIN = 0.0611  # rad/s at the start: 0.1 N at the guide
REFERENCE = 1024.0
KNOTS = np.linspace(0.0, REFERENCE, 17)
SAIL = {
    "hub.height": 1.0,
    "hub.radius": 1.0,
    "hub.density": 100.0,
    "tethers.count": COUNT,
    "tethers.length": 1.1 * GOAL,
    "tethers.elements": 2,
    "remote_units.mass": MASS,
    "solar_wind": None,
    "voltage": None,
    "initial.sailing_angle_deg": 0.0,
    "deployment.start_length": START,
    "deployment.time": KNOTS,
    "integrator.t_end": REFERENCE,
    "output.interval": REFERENCE / 64,
}
SAVED = [
    "winch_tension", "winch_power", "lagging_angle", "smallest_tether_distance", "spin_rate",
    "deployed_length",
]  # fmt: skip
STEPS = 16000
"""Room for the steps of a derivative. A run takes some 900, but most of them near the start."""

MOST_THRUST = 0.01  # N at every remote unit
LIMITS = {
    "tension": 0.15,  # N, largest
    "slack": 0.01,  # N, smallest tension
    "lag": np.deg2rad(15.0),
    "power": 0.08,  # W at every winch
    "distance": 0.8,  # of the smallest distance of straight radial tethers
    "end tension": 0.1,  # N, at least
    "end lag": np.deg2rad(3.0),
    "end hub": 0.2,  # difference of the spin of hub and sail, over that of the sail
}


class ThrustTable(TipLoad):
    """A force along the motion of every remote unit [N], linear between the knots."""

    forces: Array

    @property
    def knots(self):
        return KNOTS

    def force(self, measurements):
        axis = measurements.spin_axis
        along = jnp.cross(axis[:, None], measurements.outward_from(axis), axis=0)
        return jnp.interp(measurements.time, jnp.asarray(KNOTS), self.forces) * along


class Schedule(eqx.Module):
    """duration [s]; rates [m/s] and forces [N] at the knots, which share it equally."""

    duration: Array
    rates: Array
    forces: Array


def simulate(schedule, scale=None, more=None):
    """The signals of a deployment in seconds, metres and newtons. scale: of the rates of every reel."""
    a = schedule.duration / REFERENCE
    scale = jnp.ones(COUNT) if scale is None else scale
    numbers = {
        "tethers.youngs_modulus": MODULUS * a**2,
        "tethers.axial_damping_time": DAMPING / a,
        "initial.spin_rate": SPIN * a,
        "deployment.rate": a * schedule.rates[:, None] * scale,
    }
    run = esail.simulate(
        "truss",
        SAIL | numbers | (more or {}),
        terms=[ThrustTable(a**2 * schedule.forces)],
        save=SAVED,
        max_steps=STEPS,
    )
    units = {"winch_tension": a**2, "winch_power": a**3, "spin_rate": a}
    return {name: run[name] / units.get(name, 1.0) for name in SAVED} | {"time": a * run.time}


def violations(signals):
    """By how much limits are exceeded, in parts of them; negative within them. Per instant and tether, and
    at the end."""
    tension, lag = signals["winch_tension"], signals["lagging_angle"]
    power, length = signals["winch_power"], signals["deployed_length"]
    hub, sail = signals["spin_rate"][-1]
    distance = signals["smallest_tether_distance"] / (length.min(1) + 1.0)
    return {
        "tension": tension / LIMITS["tension"] - 1.0,
        "slack": 1.0 - tension / LIMITS["slack"],
        "lag": jnp.sqrt(lag**2 + 1e-12) / LIMITS["lag"] - 1.0,
        "power": -power / LIMITS["power"] - 1.0,
        "distance": 1.0 - distance / LIMITS["distance"],
        "end tension": 1.0 - end_tension(sail, length[-1]) / LIMITS["end tension"],
        "end lag": jnp.sqrt(lag[-1] ** 2 + 1e-12) / LIMITS["end lag"] - 1.0,
        "end hub": jnp.sqrt((hub / sail - 1.0) ** 2 + 1e-12) / LIMITS["end hub"] - 1.0,
    }


def end_tension(spin, length):
    """m (l + r) w^2 [N] of a radial tether without mass."""
    return MASS * (length + 1.0) * spin**2
