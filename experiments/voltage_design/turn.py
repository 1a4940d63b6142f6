"""Turning the spin axis by 5 deg, to larger sailing angles, in the shortest time.

python experiments/voltage_design/turn.py    # writes turn.csv, turn-voltages.csv, turn.png

Voltages lie in [0, 40 kV]; 20 kV without modulation. Every control is flown open loop as a table in time,
but for the laws of the spin phase and of attitude feedback, which look at the hub.
"""

import csv
import time
from pathlib import Path

import jax
import numpy as np
from matplotlib.figure import Figure
from run import COARSE, FINER, TURN

import esail_jax as esail
from esail_jax.constants import PROTON_MASS, THRUST_FACTOR, VACUUM_PERMITTIVITY
from esail_jax.design import Design, State, Variable
from esail_jax.objectives import plane_normals
from esail_jax.scenes.scene import Scene
from esail_jax.simulate import Solution

HERE = Path(__file__).parent
SPIN, VOLTS, MAXIMUM = 4e-3, 20e3, 40e3
START, ANGLE = 10.0, 5.0
"""Sailing angle at the start, and by how much the axis turns [deg]."""

KNOTS = 24
"""Of the tables, per turn: straight lines between."""

FAR = 10.0
"""[deg] A target beyond reach: the nearest to it is the largest angle."""

LONGEST, SAVED = 4.0, 40
"""Turns that controls may take, and saved instants per turn."""

CALM = 1e-4
"""Weight of the hub's swing: enough to notice, too little to slow the turn."""


def sail(turns: float, overrides: dict) -> Scene:
    """The baseline for some turns."""
    times = {"integrator.t_end": turns * TURN, "output.interval": TURN / SAVED}
    return esail.load_scene("baseline", times | {"integrator.tolerance": COARSE} | overrides)


# ---- what a rigid sail could do -------------------------------------------------------------------


def rigid_turns(wave: float, high: float) -> float:
    """Turns that a flat rigid sail needs, whose thrust follows `wave` about its mean: H angle / torque.

    H = N I omega, I = (m_tip + m / 3) L^2; torque N M wave, where M = sigma u cos alpha L^2 / 2 is the moment
    of a tether at voltage `high` and `wave` the mean over the phase of (thrust / its value at `high`) sin phi.
    alpha: in the middle of the way."""
    scene = sail(1.0, {})
    tethers, wind, length = scene.tethers, scene.solar_wind, scene.tethers.length
    inertia = (scene.remote_units.mass + tethers.density * tethers.area * length / 3.0) * length**2
    plasma = np.sqrt(VACUUM_PERMITTIVITY * PROTON_MASS * wind.number_density)
    load = THRUST_FACTOR * (high - wind.cutoff_voltage) * plasma * wind.speed
    moment = 0.5 * load * length**2 * np.cos(np.deg2rad(START + 0.5 * ANGLE))
    rate = moment * wave / (inertia * SPIN)
    return float(np.deg2rad(ANGLE) / rate / TURN)


def waves() -> dict[str, tuple[float, float]]:
    """Means of thrust times sin phi: of all or nothing, 1 / pi; of the largest first harmonic without
    clipping, with what the cutoff voltage takes, by quadrature."""
    phase = np.linspace(0.0, 2.0 * np.pi, 3601)[:-1]
    cutoff = float(sail(1.0, {}).solar_wind.cutoff_voltage)
    thrust = np.maximum(VOLTS * (1.0 + np.sin(phase)) - cutoff, 0.0) / (MAXIMUM - cutoff)
    return {
        "all or nothing": (1.0 / np.pi, MAXIMUM),
        "first harmonic": ((thrust * np.sin(phase)).mean(), MAXIMUM),
    }


# ---- controls -------------------------------------------------------------------------------------


def instants(turns: float) -> np.ndarray:
    """Knots of a table [s], evenly spaced."""
    return np.linspace(0.0, turns * TURN, round(KNOTS * turns) + 1)


def phase_table(time: np.ndarray, amplitude: float) -> np.ndarray:
    """1 + b cos(omega_0 t + 2 pi i / N), limited: tethers on the side towards Y_B(0) pull more, and turn the
    angular momentum, which is along X_B, to larger sailing angles."""
    azimuth = SPIN * time[:, None] + 2.0 * np.pi * np.arange(12) / 12
    return np.clip(1.0 + amplitude * np.cos(azimuth), 0.0, MAXIMUM / VOLTS)


def table_law(time: np.ndarray, table: np.ndarray) -> dict:
    """Overrides: a table, and V_0 a knot after its end."""
    after = time[-1] + TURN / KNOTS
    return {
        "voltage.law": "piecewise-linear", "voltage.maximum": MAXIMUM,
        "voltage.time": [*time.tolist(), after],
        "voltage.table": np.vstack([table, np.ones((1, table.shape[1]))]).tolist(),
    }  # fmt: skip


def known_controls() -> dict[str, dict]:
    """Overrides of controls that need no design."""
    time = instants(LONGEST)
    harmonic = {"voltage.law": "harmonic", "voltage.maximum": MAXIMUM, "voltage.cosine": [0.0]}
    feedback = {
        "voltage.law": "feedback", "voltage.maximum": MAXIMUM,
        "voltage.target_sailing_angle_deg": START + ANGLE,
    }  # fmt: skip
    unlimited = 1.0 / (np.sin(np.deg2rad(ANGLE)) * np.cos(np.deg2rad(START)))
    return {
        "constant": {},
        "first harmonic, table": table_law(time, phase_table(time, 1.0)),
        "all or nothing, table": table_law(time, phase_table(time, 50.0)),
        "first harmonic of the hub's phase": harmonic | {"voltage.sine": [-1.0]},
        "feedback, gain without clipping": feedback | {"voltage.gain": unlimited},
        "feedback, ten times that gain": feedback | {"voltage.gain": 10.0 * unlimited},
    }


# ---- what they do ---------------------------------------------------------------------------------


def aim() -> np.ndarray:
    """In B(0): the normal to reach, and, along the way and across, what is orthogonal to the start."""
    angle = np.deg2rad(ANGLE)
    return np.array([np.cos(angle), 0.0, -np.sin(angle)])


def turned(run: Solution) -> tuple[np.ndarray, np.ndarray]:
    """Angles [deg] of the spin plane's normal from its start along the way, and off it."""
    normal = np.asarray(plane_normals(run)) @ run["rotation_IB"][0]
    return np.rad2deg(np.arctan2(-normal[:, 2], normal[:, 0])), np.rad2deg(np.arcsin(normal[:, 1]))


def swing(run: Solution) -> np.ndarray:
    """Angle of the hub's axis from the spin plane's normal [deg]."""
    apart = np.linalg.norm(run["rotation_IB"][:, :, 0] - np.asarray(plane_normals(run)), axis=1)
    return np.rad2deg(2.0 * np.arcsin(0.5 * apart))


def summary(name: str, run: Solution, until: float | None = None) -> tuple:
    """A row of turn.csv: time at which ANGLE is reached, or `until`, and what is so there."""
    along, across = turned(run)
    time = np.asarray(run.time)
    end = until
    if end is None:
        over = np.flatnonzero(along >= ANGLE)
        i = over[0] if len(over) else None
        end = np.interp(ANGLE, along[i - 1 : i + 1], time[i - 1 : i + 1]) if len(over) else time[-1]
    angle, off = (float(np.interp(end, time, x)) for x in (along, across))
    spin = float(np.interp(end, time, run["angular_velocity_B"][:, 0])) / SPIN - 1.0
    return name, float(end), float(end / TURN), angle, off, float(swing(run)[time <= end].max()), spin


# ---- design ---------------------------------------------------------------------------------------


def problem(turns: float, table: np.ndarray, target: float, calm: float) -> Design:
    """The spin plane as near as possible to a target at the end of a table."""
    scene = sail(turns, {
        "output.interval": turns * TURN / 50, "voltage.law": "piecewise-linear", "voltage.maximum": MAXIMUM,
        "voltage.time": np.linspace(0.0, turns * TURN, len(table)).tolist(), "voltage.table": table.tolist(),
    })  # fmt: skip
    weights = {f"spin-plane:{START + target}": 1.0}
    if calm:
        weights["hub-swing"] = calm
    return Design(scene, weights, {"voltage.table": Variable(table, 1.0, 0.0, MAXIMUM / VOLTS)})


def say(state: State) -> None:
    print(state.iteration, state.value, flush=True)
