"""A month of a sail in a wind with storms and gaps: thrust, coning, power and attitude, and what the mean
wind would have predicted.

    python experiments/measured_wind/run.py [--wind FILE ... --epoch DATE] [--kernel FILE] [--days 30]
                                            [--out DIR]

Without --wind it writes and takes a synthetic file (`synthetic.py`). The runs are made by `esail run` in
DIR/runs and are kept there: a run that was interrupted goes on, a complete one is read. Writes wind.csv,
results.csv, predictions.csv, month.csv, apart.csv, messages.csv and the figures to DIR, this folder if left
out.
"""

import argparse
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import synthetic
from measures import (
    apart_row,
    messages_rows,
    month_rows,
    prediction_rows,
    result_row,
    wind_of,
    wind_rows,
    write,
)
from pictures import draw_cost_of_gaps, draw_month, draw_wind

import esail_jax as esail
from esail_jax.scenes.toml_text import to_toml

HERE = Path(__file__).parent
SAIL = HERE / "sail.toml"
DAY = 86400.0

LARGEST_GAP = 43200.0
"""Longest time [s] between two rows that is bridged by a straight line: eleven missing hours."""

CONSTANT_THRUST = {
    "voltage.value": None,
    "voltage.gain": None,
    "voltage.target_sailing_angle_deg": None,
    "voltage.measured_axis": None,
    "voltage.law": "constant-thrust",
    "voltage.thrust": 0.047,
}

TRUSSES = {
    "tethers.element": "truss",
    "tethers.elements": 2,
    "tethers.bending": False,
    "tethers.second_moment": None,
    "tethers.bending_damping_time": None,
}


class Case(NamedTuple):
    """A run. overrides: of `sail.toml`; wind: "series", "mean" (the time means of speed and density), or
    "whole" (the synthetic series before hours were taken out); days: how long it is at most."""

    overrides: dict[str, Any]
    wind: str = "series"
    days: float = np.inf


CASES = {
    "held": Case({}),
    "held, mean wind": Case({}, "mean"),
    "constant thrust": Case(CONSTANT_THRUST),
    "held, 40 W at most": Case({"voltage.power_limit": 40.0}),
    "held, two trusses": Case(TRUSSES),
    "held, tolerance 5e-10": Case({"integrator.tolerance": 5e-10}, days=3.0),
    "held, no gaps": Case({}, "whole"),
}

IN_MONTH = ("held", "held, mean wind", "held, 40 W at most", "constant thrust")
"""Cases in month.csv."""

COMPARED = ("held, two trusses", "held, tolerance 5e-10", "held, no gaps")
"""Cases that are compared with `held`, row by row."""

SECOND_STORM = (506 * 3600.0, 556 * 3600.0)
"""The synthetic storm in which hours are missing, from before its shock on [s]."""


def scenes(given: argparse.Namespace) -> dict[str, esail.Scene]:
    """The scene of every case."""
    runs = given.out / "runs"
    common: dict[str, Any] = {"integrator.t_end": given.days * DAY}
    if given.epoch is not None:
        common["initial.epoch"] = given.epoch
    if given.kernel is not None:
        numbers = dict.fromkeys(("orbit.position_au", "orbit.velocity", "orbit.frame"))
        common |= numbers | {"orbit.start_at": "earth", "orbit.kernel": str(given.kernel)}
    files = {"series": given.wind}
    if given.wind is None:
        files = {"series": [str(runs / "wind.dat")], "whole": [str(runs / "whole.dat")]}
        synthetic.write(runs / "wind.dat")
        synthetic.write(runs / "whole.dat", gaps=False)
    winds = {
        name: {"solar_wind.file": file, "solar_wind.largest_gap": LARGEST_GAP}
        for name, file in files.items()
    }
    _, speed, density = wind_of(esail.load_scene(SAIL, common | winds["series"]))
    winds["mean"] = {"solar_wind.speed": speed.mean(), "solar_wind.number_density": density.mean()}
    ends = {name: {"integrator.t_end": min(given.days, case.days) * DAY} for name, case in CASES.items()}
    return {
        name: esail.load_scene(SAIL, common | winds[case.wind] | case.overrides | ends[name])
        for name, case in CASES.items()
        if case.wind in winds
    }


def flown(name: str, scene: esail.Scene, runs: Path) -> esail.Solution:
    """The run of a scene by the command `esail run`, from its file if it is complete."""
    stem = runs / name.replace(", ", "-").replace(" ", "-")
    stem.with_suffix(".toml").write_text(to_toml(scene), encoding="utf-8")
    file = stem.with_suffix(".h5")
    command = [sys.executable, "-m", "esail_jax", "run", str(stem.with_suffix(".toml")), "-o", str(file)]
    print(f"{name}: esail {' '.join(command[3:])} --resume", flush=True)
    if subprocess.run([*command, "--resume", "--quiet"], check=False).returncode:
        raise SystemExit(
            f"the run {name!r} is not complete; if it was interrupted, the same command goes on"
        )
    return esail.load(file)


def report(
    every: dict[str, esail.Scene], flights: dict[str, esail.Solution], out: Path, made_up: bool
) -> None:
    """Writes the tables and the figures. made_up: whether the wind is the synthetic one."""
    held, scene = flights["held"], every["held"]
    rows = {name: result_row(name, run, every[name]) for name, run in flights.items()}
    write(out / "results.csv", list(rows.values()))
    write(out / "wind.csv", wind_rows(scene))
    write(out / "predictions.csv", prediction_rows(scene, rows["held"], rows["held, mean wind"]))
    write(out / "month.csv", month_rows({name: flights[name] for name in IN_MONTH}, scene))
    write(out / "apart.csv", [apart_row(name, flights[name], held) for name in COMPARED if name in flights])
    write(out / "messages.csv", messages_rows(out / "runs" / "held.h5", held))
    first, second = synthetic.SHOCKS
    begins = {"shock": first, "stream": synthetic.STREAM, "second shock": second} if made_up else {}
    draw_wind(scene, {name: 3600.0 * x.hour for name, x in begins.items()}, out / "wind.png")
    draw_month(flights, out / "month.png")
    if made_up and held.time[-1] > SECOND_STORM[1]:
        draw_cost_of_gaps(flights, scene, SECOND_STORM, out / "gap.png")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("--wind", nargs="+", metavar="FILE", help="files of a measured wind")
    options.add_argument("--epoch", metavar="DATE", help="start of the month, with --wind")
    options.add_argument("--kernel", type=Path, metavar="FILE", help="kernel with the Earth's place")
    options.add_argument("--days", type=float, default=30.0)
    options.add_argument("--out", type=Path, default=HERE, metavar="DIR")
    given = options.parse_args()
    if given.wind is not None and given.epoch is None:
        options.error("`--epoch` must be given with --wind, but is missing")
    if given.days < 1.0:
        options.error(f"`--days` must be 1 or more, but is {given.days:g}")
    (given.out / "runs").mkdir(parents=True, exist_ok=True)
    every = scenes(given)
    flights = {name: flown(name, scene, given.out / "runs") for name, scene in every.items()}
    report(every, flights, given.out, given.wind is None)


if __name__ == "__main__":
    main()
