"""The baseline sail at 10 deg, facing the Sun, and without voltage: Fig. 6 to 10 of [PGV].

    python experiments/pgv_baseline/run.py

Runs three spin periods, writes table.csv (smallest and largest value of every observable) and figures/*.png
beside this file, and prints measures of the accuracy of the runs.
"""

import csv
import sys
from pathlib import Path

import numpy as np

import esail_jax as esail
from esail_jax import plotting
from esail_jax.observables.sail import OBSERVABLES

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "pgv_common"))

from figures import FIGURES
from kept_runs import case_run
from layout import save

CASES = ("alpha-10", "alpha-0", "voltage-off")
"""Names of the runs, in the order of the tables."""

MORE = (plotting.all_tethers, plotting.sail_picture)
"""Figures of the run at 10 deg that the paper does not have."""

FLOOR = 1e-8
"""Values below this part of the largest one of an observable, in all runs and components, are written as 0.
They are rounding errors of forces and angles that are zero by symmetry: the largest is 3e-9, of a moment of
the root reactions. Another machine rounds differently, so that their digits mean nothing."""

UNITS = {entry.name: entry.unit for entry in OBSERVABLES}


def largest_values(runs: dict[str, esail.Solution]) -> dict[str, float]:
    """The largest magnitude of every observable in all runs."""
    found: dict[str, float] = {}
    for run in runs.values():
        for name in run.observables:
            found[name] = max(found.get(name, 0.0), float(np.abs(run[name]).max()))
    return found


def range_rows(case: str, solution: esail.Solution, largest: dict[str, float]) -> list[list]:
    """Rows (case, observable, component, unit, smallest, largest), over time and all tethers.
    largest: largest magnitude of every observable."""
    rows = []
    for name in solution.observables:
        values = np.asarray(solution[name])
        components = [("", values)]
        if values.shape[-1:] == (3,) and name != "rotation_IB":
            components = [(str(k), values[..., k]) for k in range(3)]
        for component, part in components:
            ends = [x if abs(x) > FLOOR * largest[name] else 0.0 for x in (part.min(), part.max())]
            rows.append([case, name, component, UNITS[name], *(f"{x:.6g}" for x in ends)])
    return rows


def summary(solution: esail.Solution) -> dict[str, float]:
    """The numbers of one column of the README's second table."""
    energy = solution["kinetic_energy"] + solution["elastic_energy"]
    spin = solution["angular_velocity_B"][:, 0]
    stats = solution.stats
    return {
        "steps": solution.steps,
        "iterations per step": np.nanmean(solution.numerics["iterations_per_step"][1:]),
        "run time [s]": stats["wall_time"],
        "largest constraint violation [m]": solution.numerics["constraint_violation"].max(),
        "largest energy balance error [J]": abs(solution["energy_balance_error"]).max(),
        "largest relative energy change [-]": abs(energy / energy[0] - 1.0).max(),
        "relative spin-rate change at the end [-]": spin[-1] / spin[0] - 1.0,
    }


def main() -> None:
    """Runs all cases, writes the table and the figures, prints the summary."""
    runs = {case: case_run(case) for case in CASES}
    largest = largest_values(runs)
    rows = [row for case, run in runs.items() for row in range_rows(case, run, largest)]
    print(f"writing into {HERE}")
    with open(HERE / "table.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["case", "observable", "component", "unit", "min", "max"])
        writer.writerows(rows)
    print(f"wrote {HERE / 'table.csv'}, {len(rows)} rows")
    for name, make in FIGURES.items():
        save(make(runs), HERE / "figures" / f"{name}.png")
    for make in MORE:
        save(make(runs["alpha-10"]), HERE / "figures" / f"{make.__name__}.png")
    lines = {case: summary(run) for case, run in runs.items()}
    print(f"{'':42s}" + "".join(f"{case:>14s}" for case in lines))
    for name in lines["alpha-10"]:
        print(f"{name:42s}" + "".join(f"{line[name]:14.5g}" for line in lines.values()))


if __name__ == "__main__":
    main()
