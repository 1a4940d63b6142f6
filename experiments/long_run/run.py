"""A year of the baseline sail: run time, memory, size of the file, and what the result is worth.

    python experiments/long_run/run.py

Writes growth.csv (errors over 300 spin periods), year.csv (the year, in parts of 1000 spin periods),
memory_default.csv, memory_loose.csv and figures/year.png beside this file. The two year-long runs (one
core, about a quarter of an hour each) are kept in `runs/`; delete this folder to repeat them.
"""

import csv
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "pgv_common"))

from layout import BLUE, VERMILION, Line, Panel, draw, save

import esail_jax as esail

RUNS = HERE / "runs"

YEAR = 3.15e7
"""Simulated time [s]."""

HOUR = 3600.0
"""Time between saved instants [s]."""

SPIN_PERIOD = 2.0 * np.pi / 4e-3
"""Spin period T_s of the baseline [s]."""

TOLERANCES = {"default": 5e-10, "loose": 1e-8}
"""Tolerances of the two year-long runs."""

TRIED, TIGHT = (5e-10, 1e-8, 1e-7), 1e-11
"""Tolerances that are compared over 300 spin periods with a tight one."""

MARKS = (3, 10, 30, 100, 300)
"""Spin periods after which errors are reported."""

PART = 1000.0
"""Length of the parts of the year [spin periods]."""

POLL = 60.0
"""Time between two readings of a run's memory [s]."""


# ---- errors over 300 spin periods -----------------------------------------------------------------


def rotation_angles(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The angle [deg] between two rotations at every instant. It is measured by the matrices'
    difference, because the cosine of a small angle is one to rounding."""
    distance = np.linalg.norm(one - other, axis=(1, 2)) / np.sqrt(8.0)
    return np.degrees(2.0 * np.arcsin(np.clip(distance, 0.0, 1.0)))


def differences(found, exact) -> dict[str, np.ndarray]:
    """The differences of two runs at every instant, largest over the tethers."""

    def tips(run):
        return np.asarray(run["tip_position_I"]) - np.asarray(run["hub_position_I"])[:, None]

    def largest(name):
        return np.degrees(np.abs(np.asarray(found[name]) - exact[name]).max(1))

    return {
        "attitude [deg]": rotation_angles(
            np.asarray(found["rotation_IB"]), np.asarray(exact["rotation_IB"])
        ),
        "tips from the hub [m]": np.linalg.norm(tips(found) - tips(exact), axis=2).max(1),
        "hub [m]": np.linalg.norm(np.asarray(found["hub_position_I"]) - exact["hub_position_I"], axis=1),
        "lagging [deg]": largest("lagging_angle"),
        "coning [deg]": largest("coning_angle"),
    }


def growth_rows() -> list[dict]:
    """The largest differences from the run with the tight tolerance, up to every mark."""
    end = {"integrator.t_end": MARKS[-1] * SPIN_PERIOD, "output.interval": HOUR}
    solutions = {
        tolerance: esail.simulate("baseline", overrides=end | {"integrator.tolerance": tolerance})
        for tolerance in (TIGHT, *TRIED)
    }
    turns, rows = solutions[TIGHT].time / SPIN_PERIOD, []
    for tolerance in TRIED:
        found = solutions[tolerance]
        balance = np.abs(found["energy_balance_error"])
        every = differences(found, solutions[TIGHT]) | {"energy balance [J]": balance}
        for mark in MARKS:
            until = turns <= mark + 1e-6
            rows.append(
                {"tolerance": tolerance, "spin periods": round(turns[until][-1], 1)}
                | {name: f"{values[until].max():.2e}" for name, values in every.items()}
            )
    return rows


# ---- the year -------------------------------------------------------------------------------------


def watched(tolerance: float, file: Path, log_file: Path) -> None:
    """Runs the year by the command `esail run` on one core, and writes a log with a line of processor time
    [s], memory now and at most [MB] and size of the file [MB] every POLL seconds."""
    command = [sys.executable, "-m", "esail_jax", "run", "baseline", "--t-end", str(YEAR), "--quiet"]
    command += ["--set", f"output.interval={HOUR}", "--set", f"integrator.tolerance={tolerance}"]
    child = subprocess.Popen([*command, "-o", str(file)])
    os.sched_setaffinity(child.pid, {min(os.sched_getaffinity(0))})
    ticks = os.sysconf("SC_CLK_TCK")
    with log_file.open("w", encoding="utf-8") as log:
        print("processor_s,memory_MB,peak_MB,file_MB", file=log)
        while child.poll() is None:
            time.sleep(POLL)
            try:
                spent = Path(f"/proc/{child.pid}/stat").read_text().rsplit(")", 1)[1].split()
                status = Path(f"/proc/{child.pid}/status").read_text().split("\n")
            except OSError:
                break
            memory = {line.split(":")[0]: line.split()[1] for line in status if line.startswith("Vm")}
            if memory:
                seconds = (int(spent[11]) + int(spent[12])) / ticks
                now, most = (int(memory[name]) * 1.024e-3 for name in ("VmRSS", "VmHWM"))
                sizes = (round(x, 1) for x in (now, most, size_of(file) / 1e6))
                print(round(seconds), *sizes, sep=",", file=log, flush=True)
    if child.wait():
        raise SystemExit(f"the run with tolerance {tolerance:g} failed")


def size_of(file: Path) -> int:
    """The size of a file [bytes], 0 if it is not there."""
    return file.stat().st_size if file.exists() else 0


def parts(time: np.ndarray) -> list[slice]:
    """The instants of every part of the year. A remainder belongs to the last part."""
    turns = time / SPIN_PERIOD
    count = max(round(turns[-1] / PART), 1)
    ends = [*np.searchsorted(turns, PART * np.arange(1, count)), len(turns)]
    return [slice(a, b) for a, b in zip([0, *ends[:-1]], ends, strict=True)]


def year_rows(runs: dict) -> list[dict]:
    """A row for every run and part of the year, and what the runs differ by in it."""
    rows = []
    apart = differences(runs["loose"], runs["default"])
    for name, run in runs.items():
        rates = 1e3 * np.asarray(run["angular_velocity_B"])
        lagging = np.degrees(np.abs(run["lagging_angle"])).max(1)
        coning = np.degrees(run["coning_angle"]).mean(1)
        thrust = np.linalg.norm(run["thrust_O"], axis=1)
        for part in parts(run.time):
            ends = run.time[part][[0, -1]] / SPIN_PERIOD
            row = {
                "tolerance": TOLERANCES[name],
                "from": round(ends[0]),
                "to": round(ends[1]),
                "steps per spin period": round(run.numerics["steps"][part].sum() / np.ptp(ends)),
                "iterations per step": round(
                    float(np.mean(run.numerics["iterations_per_step"][part][1:])), 2
                ),
                "spin, mean [mrad/s]": round(float(rates[part, 0].mean()), 5),
                "spin, range [mrad/s]": round(float(np.ptp(rates[part, 0])), 4),
                "other rates, largest [mrad/s]": round(float(np.hypot(*rates[part, 1:].T).max()), 4),
                "lagging, largest [deg]": round(float(lagging[part].max()), 3),
                "coning, mean [deg]": round(float(coning[part].mean()), 5),
                "thrust, mean [mN]": round(float(1e3 * thrust[part].mean()), 5),
                "dissipated power, mean [W]": f"{np.mean(run['dissipated_power'][part]):.3e}",
                "hub from the origin [m]": f"{np.linalg.norm(run['hub_position_I'][part][-1]):.2e}",
                "energy balance [J]": f"{np.abs(run['energy_balance_error'][part]).max():.1e}",
                "constraints [m]": f"{np.max(run.numerics['constraint_violation'][part]):.1e}",
            }
            rows.append(row | {f"apart: {key}": f"{x[part].max():.1e}" for key, x in apart.items()})
    return rows


def picture(runs: dict):
    """The figure: what the sail does in a year, and what limits the method."""
    colours = {"default": BLUE, "loose": VERMILION}

    def lines(signal, width=0.5):
        found = []
        for name, run in runs.items():
            turns, label = run.time / SPIN_PERIOD, f"tolerance {TOLERANCES[name]:g}"
            found.append(Line(turns / 1e3, signal(run), label, colours[name], width=width))
        return found

    def by_part(signal):
        def of(run):
            made = np.full(len(run.time), np.nan)
            for part in parts(run.time):
                made[part] = signal(run, part)
            return made

        return of

    def steps(run, part):
        return run.numerics["steps"][part].sum() / (np.ptp(run.time[part]) / SPIN_PERIOD)

    def spin_range(run, part):
        return np.ptp(1e3 * run["angular_velocity_B"][part, 0])

    apart = differences(runs["loose"], runs["default"])
    turns, x = runs["default"].time / SPIN_PERIOD / 1e3, "$t/T_s$ [1000]"
    rows = [
        [
            Panel("a", "spin rate, range [mrad/s]", lines(by_part(spin_range), 1.5), x),
            Panel(
                "b",
                "largest lagging [deg]",
                lines(lambda r: np.degrees(np.abs(r["lagging_angle"])).max(1)),
                x,
            ),
        ],
        [
            Panel("c", "steps per spin period", lines(by_part(steps), 1.5), x, log="y"),
            Panel(
                "d",
                "difference of the runs",
                [
                    Line(turns, apart["attitude [deg]"], "attitude [deg]", "#009E73", width=0.5),
                    Line(turns, apart["tips from the hub [m]"], "tips [m]", "#CC79A7", width=0.5),
                ],
                x,
                log="y",
            ),
        ],
    ]
    return draw("Baseline over a year", rows)


def write(name: str, rows: list[dict]) -> None:
    """Writes a table beside this file and prints it."""
    with (HERE / name).open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, rows[0])
        table.writeheader()
        table.writerows(rows)
    print(name)
    for row in rows:
        print("  ", ", ".join(f"{key} {value}" for key, value in row.items()))


def main() -> None:
    """Makes the tables and the figure, and the runs that are not there yet."""
    RUNS.mkdir(exist_ok=True)
    write("growth.csv", growth_rows())
    for name, tolerance in TOLERANCES.items():
        if not (RUNS / f"{name}.h5").exists():
            watched(tolerance, RUNS / f"{name}.h5", HERE / f"memory_{name}.csv")
    runs = {name: esail.load(RUNS / f"{name}.h5") for name in TOLERANCES}
    write("year.csv", year_rows(runs))
    save(picture(runs), HERE / "figures/year.png")


if __name__ == "__main__":
    main()
