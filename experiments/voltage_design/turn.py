"""Turns the spin axis by 5 deg, to larger sailing angles, in the shortest time.

python experiments/voltage_design/turn.py    # writes turn.csv, turn-voltages.csv, turn.png

Voltages are limited to [0, 40 kV]; they are 20 kV without modulation. Every control is open loop, a table
in time, except the laws of the spin phase and of attitude feedback, which measure the hub. "All or
nothing" is bang-bang control.
"""

import csv
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from run import COARSE, TURN, finer

import esail_jax as esail
from esail_jax.constants import PROTON_MASS, THRUST_FACTOR, VACUUM_PERMITTIVITY
from esail_jax.design import Design, Variable, plane_normals
from esail_jax.scenes.scene import Scene

HERE = Path(__file__).parent
SPIN, VOLTS, MAXIMUM = 4e-3, 20e3, 40e3
START, ANGLE = 10.0, 5.0
"""Sailing angle at the start, and the wanted change of it [deg]."""

KNOTS = 24
"""Knots of the tables per turn; voltages are linear between knots."""

LONGEST, SAVED = 4.0, 40
"""Largest number of turns of a control, and saved instants per turn."""

REST = 0.5
"""Turns at V_0 after the control, over which the spin plane is averaged. Nutation has two periods per
turn, so it counts as an error and not as progress towards the target."""

CALM = 1e-6
"""Weight of the hub's swing: large enough to have an effect, too small to slow the turn."""

ITERATIONS = 25

TIMES = (1.02,)
"""Durations of the designs, relative to the time that bang-bang control needs."""


def sail(turns: float, overrides: dict) -> Scene:
    """The baseline for some turns."""
    times = {"integrator.t_end": turns * TURN, "output.interval": TURN / SAVED}
    return esail.load_scene("baseline", times | {"integrator.tolerance": COARSE} | overrides)


# ---- the limit of a rigid sail ---------------------------------------------------------------------


def rigid_sail() -> tuple[float, float]:
    """H = N I omega [N m s] and N M [N m] of a flat rigid sail with N tethers.

    I = (m_tip + m / 3) L^2; M = sigma u cos alpha L^2 / 2 is the moment of a tether's thrust at MAXIMUM;
    alpha is the mean of the initial and the wanted sailing angle."""
    scene = sail(1.0, {})
    tethers, wind, length = scene.tethers, scene.solar_wind, scene.tethers.length
    inertia = (scene.remote_units.mass + tethers.density * tethers.area * length / 3.0) * length**2
    plasma = np.sqrt(VACUUM_PERMITTIVITY * PROTON_MASS * wind.number_density)
    load = THRUST_FACTOR * (MAXIMUM - wind.cutoff_voltage) * plasma * wind.speed
    moment = 0.5 * load * length**2 * np.cos(np.deg2rad(START + 0.5 * ANGLE))
    count = tethers.count
    return float(count * inertia * SPIN), float(count * moment)


def rigid_turns(wave: float) -> float:
    """The turns that the rigid sail needs, H angle / (N M wave).

    wave: mean over the phase of sin phi times thrust / largest thrust."""
    momentum, moment = rigid_sail()
    return momentum * np.deg2rad(ANGLE) / (moment * wave) / TURN


def waves() -> dict[str, float]:
    """`wave` of bang-bang control, 1 / pi, and of the largest first harmonic within the limits.

    The second is computed by quadrature, including the loss by the cutoff voltage."""
    phase = np.linspace(0.0, 2.0 * np.pi, 3601)[:-1]
    cutoff = float(sail(1.0, {}).solar_wind.cutoff_voltage)
    thrust = np.maximum(VOLTS * (1.0 + np.sin(phase)) - cutoff, 0.0) / (MAXIMUM - cutoff)
    return {"all or nothing": 1.0 / np.pi, "first harmonic": float((thrust * np.sin(phase)).mean())}


# ---- controls -------------------------------------------------------------------------------------


def instants(turns: float) -> np.ndarray:
    """Evenly spaced knots of a table [s]."""
    return np.linspace(0.0, turns * TURN, round(KNOTS * turns) + 1)


def phase_table(knots: np.ndarray, amplitude: float) -> np.ndarray:
    """1 + b cos(omega_0 t + 2 pi i / N), limited to [0, MAXIMUM / VOLTS].

    Tethers on the side towards Y_B(0) have more thrust and turn the angular momentum, which is along X_B,
    to larger sailing angles."""
    azimuth = SPIN * knots[:, None] + 2.0 * np.pi * np.arange(12) / 12
    return np.clip(1.0 + amplitude * np.cos(azimuth), 0.0, MAXIMUM / VOLTS)


def table_law(knots: np.ndarray, table: np.ndarray) -> dict:
    """Overrides for a table that is followed by V_0, one knot later."""
    after = knots[-1] + TURN / KNOTS
    return {
        "voltage.law": "piecewise-linear", "voltage.maximum": MAXIMUM,
        "voltage.time": [*knots.tolist(), after],
        "voltage.table": np.vstack([table, np.ones((1, table.shape[1]))]).tolist(),
    }  # fmt: skip


def known_controls() -> dict[str, dict]:
    """Overrides of the known controls, which are not optimised."""
    knots = instants(LONGEST)
    harmonic = {"voltage.law": "harmonic", "voltage.maximum": MAXIMUM, "voltage.cosine": [0.0]}
    feedback = {
        "voltage.law": "feedback", "voltage.maximum": MAXIMUM,
        "voltage.target_sailing_angle_deg": START + ANGLE,
    }  # fmt: skip
    unlimited = 1.0 / (np.sin(np.deg2rad(ANGLE)) * np.cos(np.deg2rad(START)))
    return {
        "constant": {},
        "first harmonic, table": table_law(knots, phase_table(knots, 1.0)),
        "all or nothing, table": table_law(knots, phase_table(knots, 50.0)),
        "first harmonic of the hub's phase": harmonic | {"voltage.sine": [-1.0]},
        "feedback, gain without clipping": feedback | {"voltage.gain": unlimited},
        "feedback, ten times that gain": feedback | {"voltage.gain": 10.0 * unlimited},
    }


# ---- results of controls --------------------------------------------------------------------------


def turned(run: esail.Solution) -> np.ndarray:
    """Angles [deg] of the spin plane's normal from its start, towards the target and across
    (instant, 2)."""
    normal = np.asarray(plane_normals(run)) @ run["rotation_IB"][0]
    return np.rad2deg(np.stack([np.arctan2(-normal[:, 2], normal[:, 0]), np.arcsin(normal[:, 1])], axis=1))


def turned_in_the_mean(run: esail.Solution) -> tuple[np.ndarray, np.ndarray]:
    """Instants [s], and `turned` averaged over half a turn about them; the mean removes the
    nutation."""
    window = np.ones(SAVED // 2 + 1)
    window[[0, -1]] = 0.5
    mean = np.stack([np.convolve(x, window / window.sum(), "valid") for x in turned(run).T], axis=1)
    return np.asarray(run.time)[SAVED // 4 : -(SAVED // 4)], mean


def swing(run: esail.Solution) -> np.ndarray:
    """The angle between the hub's axis and the spin plane's normal [deg]."""
    apart = np.linalg.norm(run["rotation_IB"][:, :, 0] - np.asarray(plane_normals(run)), axis=1)
    return np.rad2deg(2.0 * np.arcsin(0.5 * apart))


def flown(name: str, run: esail.Solution) -> tuple:
    """The row of turn.csv of a control that does not stop.

    It has the number of turns until ANGLE is reached (nan: never), and the state there, or at the end."""
    time, mean = turned_in_the_mean(run)
    over = np.flatnonzero(mean[:, 0] >= ANGLE)
    end, needed = time[-1], np.nan
    if len(over):
        around = slice(over[0] - 1, over[0] + 1)
        end = np.interp(ANGLE, mean[around, 0], time[around])
        needed = end / TURN
    along, off = (float(np.interp(end, time, x)) for x in mean.T)
    largest = np.nanmax(swing(run)[np.asarray(run.time) <= end])
    return name, "5", float(needed), along, off, np.nan, float(largest), np.nan


def stopped(name: str, elements: int, turns: float, run: esail.Solution) -> tuple:
    """The row of turn.csv of a control that ends after some turns.

    It has the mean of the spin plane's normal over REST from then on, the largest distance from that mean
    (nutation), and the largest swing of the hub before and after the end of the control."""
    time = np.asarray(run.time)
    after = time >= turns * TURN - 1e-6
    angles, rest = turned(run)[after], time[after]
    mean = np.trapezoid(angles, rest, axis=0) / (rest[-1] - rest[0])
    nutation = np.linalg.norm(angles - mean, axis=1).max()
    hub = swing(run)
    numbers = (*mean, nutation, hub[~after].max(), hub[after].max())
    return name, str(elements), turns, *(float(x) for x in numbers)


HEAD = "control elements turns along_deg off_deg nutation_deg hub_swing_deg hub_swing_after_deg".split()


def controlled(turns: float, table: np.ndarray) -> Scene:
    """The scene with a table over some turns, then V_0 for REST."""
    law = table_law(np.linspace(0.0, turns * TURN, len(table)), table)
    count = round(SAVED * turns)
    # Makes the end of the control a saved instant.
    law |= {"integrator.t_end": (turns + REST) * TURN, "output.interval": turns * TURN / count}
    return sail(turns + REST, law)


# ---- design ---------------------------------------------------------------------------------------


def problem(turns: float) -> Design:
    """The design problem: the spin plane close to its target, and at rest, over REST after the
    control.

    The optimisation starts from nine tenths of the largest first harmonic; V_0 after the control is
    fixed."""
    scene = controlled(turns, phase_table(instants(turns), 0.9))
    table = np.asarray(scene.voltage.table)
    lower, upper = np.zeros(table.shape), np.full(table.shape, MAXIMUM / VOLTS)
    lower[-1] = upper[-1] = 1.0
    weights = {f"spin-plane:{START + ANGLE},0,{REST * TURN}": 1.0, "hub-swing": CALM}
    return Design(scene, weights, {"voltage.table": Variable(table, 1.0, lower, upper)})


def design(turns: float) -> np.ndarray:
    """Solves the design problem and returns its table, without the last row."""
    began, found = time.perf_counter(), problem(turns)
    states = []
    for state in found.optimise(ITERATIONS):
        states.append(state)
        print(state.iteration, state.value, flush=True)
    print(f"{turns:.3f} turns: {time.perf_counter() - began:.0f} s", flush=True)
    return np.asarray(found.scene_at(states[-1].x[0]).voltage.table)[:-1]


def draw(runs: dict[str, esail.Solution], table: np.ndarray, turns: float) -> Figure:
    """Draws the angle of the spin plane's normal, the hub's swing, and the designed voltages."""
    figure = Figure(figsize=(12.0, 4.0), layout="constrained")
    way, hub, volts = figure.subplots(1, 3)
    for name, run in runs.items():
        at = np.asarray(run.time) / TURN
        way.plot(at, turned(run)[:, 0], lw=1.0, label=name)
        hub.plot(at, swing(run), lw=1.0)
    way.axhline(ANGLE, color="k", ls=":", lw=0.8)
    way.set_ylabel("spin plane turned by [deg]")
    way.set_ylim(-0.3, 1.5 * ANGLE)  # when the hub tumbles, the normal changes its side
    way.legend(fontsize=6)
    hub.set_ylabel("hub's axis from the spin plane's normal [deg]")
    hub.set_yscale("log")
    hub.set_ylim(0.02, 90.0)
    extent = (0.0, turns, 12.5, 0.5)
    image = volts.imshow(table.T * VOLTS / 1e3, aspect="auto", extent=extent, interpolation="nearest")
    volts.set_ylabel("tether")
    figure.colorbar(image, ax=volts, label="designed voltage [kV]")
    for axis in (way, hub, volts):
        axis.set_xlabel("turns")
    return figure


def main() -> None:
    """Simulates the known controls, designs, checks, writes."""
    runs = {name: esail.simulate(sail(LONGEST, law), throw=False) for name, law in known_controls().items()}
    rows = [flown(name, run) for name, run in runs.items()]
    print("angular momentum [N m s], moments of all tethers at 40 kV [N m]:", *rigid_sail())
    bounds = {name: rigid_turns(wave) for name, wave in waves().items()}
    rows += [
        (f"rigid sail, {name}", "0", turns, ANGLE, 0.0, 0.0, 0.0, 0.0) for name, turns in bounds.items()
    ]
    for row in rows:
        print(*row, flush=True)
    reached = {row[0]: row[2] for row in rows}
    for part in TIMES:
        turns = part * reached["all or nothing, table"]
        tables = {"first harmonic": phase_table(instants(turns), 1.0)}
        tables["all or nothing"] = phase_table(instants(turns), 50.0)
        tables["designed"] = design(turns)
        for name, table in tables.items():
            scene = controlled(turns, table)
            run = esail.simulate(scene)
            rows.append(stopped(name + ", then rest", 5, turns, run))
            rows.append(stopped(name + ", then rest", 10, turns, esail.simulate(finer(scene))))
            print(*rows[-2], *rows[-1], flush=True)
        if part == TIMES[0]:
            best, chosen, runs["designed"] = turns, table, run
    drawn = {name: run for name, run in runs.items() if name != "constant"}
    draw(drawn, chosen, best).savefig(HERE / "turn.png", dpi=110)
    np.savetxt(HERE / "turn-voltages.csv", chosen * VOLTS, "%.0f", ",")
    with open(HERE / "turn.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(HEAD)
        table.writerows([tuple(f"{x:.4g}" if isinstance(x, float) else x for x in row) for row in rows])


if __name__ == "__main__":
    main()
