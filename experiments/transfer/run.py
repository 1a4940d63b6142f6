"""Arcs about the Sun with all tethers resolved, outward and inward, over half a year and over a year: the
spin plane held by the feedback law, the power limited.

    python experiments/transfer/run.py [--arcs NAME ...] [--runs DIR]

writes a table of every arc by day (NAME.csv), results.csv and the figures half-year.png and year.png here,
and the run files to DIR, if given. Rows and figures of arcs that are not named are kept. `movie.py` makes
the movie of the two arcs of a year.
"""

import argparse
import csv
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp

import esail_jax as esail
from esail_jax.constants import ASTRONOMICAL_UNIT, SOLAR_MU

HERE = Path(__file__).parent
DAY = 86400.0

SAIL = {
    "hub.density": 10.0,
    "tethers.count": 4,
    "tethers.elements": 2,
    "tethers.element": "truss",
    "tethers.bending": False,
    "tethers.bending_damping_time": None,
    "tethers.wire_radius": 12.5e-6,
    "tethers.wires": 4,
    "voltage.law": "feedback",
    "voltage.gain": 0.3,
    "voltage.measured_axis": "angular-momentum",
    "voltage.power_limit": 6.0,
    "integrator.tolerance": 1e-8,
    "output.interval": 6 * 3600.0,
}
"""Four tethers of two trusses and a light hub: the acceleration by the thrust is then larger than that of
the baseline. Lengths, tip masses and voltage are those of the baseline."""


class Arc(NamedTuple):
    """target: sailing angle [deg] that the law aims at, towards the direction of flight if positive; days:
    duration."""

    target: float
    days: float


ARCS = {
    "half-year-outward": Arc(20.0, 180.0),
    "half-year-inward": Arc(-20.0, 180.0),
    "year-outward": Arc(12.0, 365.25),
    "year-inward": Arc(-6.0, 365.25),
}
"""The arcs. The angle settles some three degrees below its target, so that the arcs of a year fly at about
+9 and -9 deg."""


def mass_of(scene):
    """Mass [kg] of the whole sail."""
    t, hub = scene.tethers, scene.hub
    tether = t.density * t.area * t.length + scene.remote_units.mass
    return t.count * tether + hub.density * np.pi * hub.radius**2 * hub.height


def normal_of_tips(run):
    """Unit normal of the plane of the tips at every instant, on the side of X_B at the start."""
    arms = run["tip_position_I"] - run["tip_position_I"].mean(1, keepdims=True)
    normal = np.cross(arms, np.roll(arms, -1, axis=1)).sum(1)
    return normal / np.linalg.norm(normal, axis=1)[:, None]


def point_mass(run, scene):
    """Heliocentric positions (instant, 3) [m] of a point mass with the thrust of the run in the orbital
    frame, smoothed by a polynomial of eighth degree in time: its mean over a turn."""
    end = run.time[-1]
    powers = np.arange(8, -1, -1)
    fits = np.polyfit(run.time / end, run["thrust_O"] / mass_of(scene), 8)

    def rate(t, y):
        size = np.linalg.norm(y[:3])
        k = y[:3] / size
        i = np.array([-k[1], k[0], 0.0]) / np.hypot(k[0], k[1])
        push = np.stack([i, np.cross(k, i), k], 1) @ ((t / end) ** powers @ fits)
        return np.concatenate([y[3:], -SOLAR_MU * k / size**2 + push])

    start = np.concatenate([run["heliocentric_position"][0], run["heliocentric_velocity"][0]])
    found = solve_ivp(rate, (0.0, end), start, "DOP853", run.time, rtol=1e-12, atol=1e-6)
    return found.y[:3].T


def fly(angle, days):
    """Runs one arc. Returns the solution, a row of results, and a table of the arc by day."""
    aims = {"initial.sailing_angle_deg": angle, "voltage.target_sailing_angle_deg": angle}
    scene = esail.load_scene("heliocentric", SAIL | aims | {"integrator.t_end": days * DAY})
    begun = time.process_time()
    run = esail.simulate(scene)
    used, balance = time.process_time() - begun, np.abs(run["energy_balance_error"]).max()
    r, v = run["heliocentric_position"], run["heliocentric_velocity"]
    size = np.linalg.norm(r, axis=1)
    out = r / size[:, None]
    normal, ahead = normal_of_tips(run), np.cross([0.0, 0.0, 1.0], out)
    heliocentric = dict(zip(("x_au", "y_au", "z_au"), r.T / ASTRONOMICAL_UNIT, strict=True))
    tilt = np.rad2deg(np.arctan2((normal * ahead).sum(1), (normal * out).sum(1)))
    wobble = np.rad2deg(np.arccos(np.clip((normal * run["rotation_IB"][:, :, 0]).sum(1), -1.0, 1.0)))
    axis = 1.0 / (2.0 / size - (v**2).sum(1) / SOLAR_MU) / ASTRONOMICAL_UNIT
    alone = np.linalg.norm(point_mass(run, scene) - r, axis=1)
    coast = kepler(r[0], v[0], run.time)
    moved = np.linalg.norm(coast - r, axis=1)
    coning = np.rad2deg(run["coning_angle"])
    table = {
        "day": run.time / DAY,
        "radius_au": size / ASTRONOMICAL_UNIT,
        "semi_major_axis_au": axis,
        "angle_deg": tilt,
        "out_of_plane_deg": np.rad2deg(np.arcsin(normal[:, 2])),
        "hub_to_plane_deg": wobble,
        "spin_mrad_s": 1e3 * run["angular_velocity_B"][:, 0],
        "coning_deg": coning.mean(1),
        "coning_largest_deg": np.abs(coning).max(1),
        "lagging_largest_deg": np.rad2deg(np.abs(run["lagging_angle"])).max(1),
        "power_W": run["electric_power"],
        **heliocentric,
        **dict(zip(("normal_x", "normal_y", "normal_z"), normal.T, strict=True)),
    }
    row = {
        "days": days,
        "semi_major_axis_au": f"{axis[-1]:.5f}",
        "moved_by_the_thrust_m": f"{moved[-1]:.4g}",
        "point_mass_error": f"{alone[-1] / moved[-1]:.1e}",
        "angle_mean_deg": f"{tilt[len(tilt) // 10 :].mean():.2f}",
        "hub_to_plane_largest_deg": f"{wobble.max():.3f}",
        "coning_largest_deg": f"{np.abs(coning).max():.2f}",
        "lagging_largest_deg": f"{np.rad2deg(np.abs(run['lagging_angle'])).max():.2f}",
        "spin_change": f"{run['angular_velocity_B'][-1, 0] / run['angular_velocity_B'][0, 0]:.4f}",
        "largest_power_W": f"{run['electric_power'].max():.4f}",
        "steps": run.stats["steps"],
        "cpu_s": round(used),
        "energy_balance": f"{balance / abs(run['external_work'][-1]):.1e}",
    }
    return run, row, table


def kepler(position, velocity, times):
    """Positions of a body that only the Sun attracts."""
    start = np.concatenate([position, velocity])
    found = solve_ivp(
        lambda _, y: np.concatenate([y[3:], -SOLAR_MU * y[:3] / np.linalg.norm(y[:3]) ** 3]),
        (0.0, times[-1]), start, "DOP853", times, rtol=1e-12, atol=1e-3,
    )  # fmt: skip
    return found.y[:3].T


def draw(name, tables):
    """Draws the arcs of one duration: orbit, angle of the spin plane, cone, spin and power."""
    figure = Figure(figsize=(11, 6), layout="constrained")
    axes = figure.subplots(2, 3)
    for way, table in tables.items():
        day = table["day"]
        lines = axes[0, 0].plot(day, table["radius_au"], label=f"{way}: radius")
        colour = lines[0].get_color()
        axes[0, 0].plot(day, table["semi_major_axis_au"], "--", color=colour, label="semi-major axis")
        axes[0, 1].plot(day, table["angle_deg"], color=colour, label=way)
        axes[0, 2].plot(day, table["hub_to_plane_deg"], color=colour, label=way)
        axes[1, 0].plot(day, table["coning_largest_deg"], color=colour, label=way)
        axes[1, 1].plot(day, table["spin_mrad_s"], color=colour, label=way)
        axes[1, 2].plot(day, table["power_W"], color=colour, label=way)
    labels = (
        "distance from the Sun [au]", "angle of the spin plane [deg]", "hub to plane of the tips [deg]",
        "largest coning angle [deg]", "spin rate [mrad/s]", "electric power [W]",
    )  # fmt: skip
    for panel, label in zip(axes.flat, labels, strict=True):
        panel.set(xlabel="day", ylabel=label)
        panel.legend(fontsize=8)
    figure.savefig(HERE / f"{name}.png", dpi=110)


def table_of(name):
    """Reads the table of an arc that has been run, or returns None."""
    path = HERE / f"{name}.csv"
    if not path.exists():
        return None
    found = np.genfromtxt(path, delimiter=",", names=True)
    return {column: found[column] for column in found.dtype.names}


def tables_of(duration):
    """Reads the tables of the arcs of one duration that have been run, by the direction of the arc."""
    found = {way: table_of(f"{duration}-{way}") for way in ("outward", "inward")}
    return {way: table for way, table in found.items() if table is not None}


def rows_so_far():
    """Reads the rows of results.csv by the name of the arc."""
    path = HERE / "results.csv"
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {row["arc"]: row for row in csv.DictReader(file)}


def write_rows(rows):
    """Writes results.csv."""
    with (HERE / "results.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, next(iter(rows.values())), lineterminator="\n")
        table.writeheader()
        table.writerows(rows[name] for name in ARCS if name in rows)


def main():
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("--arcs", nargs="+", choices=ARCS, default=list(ARCS), metavar="NAME")
    options.add_argument("--runs", type=Path, help="folder for the run files")
    given = options.parse_args()
    for name in given.arcs:
        run, row, table = fly(*ARCS[name])
        print(name, row, flush=True)
        if given.runs is not None:
            esail.save(run, given.runs / f"{name}.h5")
        columns, head = np.stack(list(table.values()), 1)[::8], ",".join(table)
        np.savetxt(HERE / f"{name}.csv", columns, "%.6g", ",", header=head, comments="")
        write_rows(rows_so_far() | {name: {"arc": name} | row})
    for duration in ("half-year", "year"):
        tables = tables_of(duration)
        if tables:
            draw(duration, tables)


if __name__ == "__main__":
    main()
