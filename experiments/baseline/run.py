"""Simulates three spin periods of the baseline sail at 10 deg, facing the Sun, and without voltage.

    python experiments/baseline/run.py

Writes table.csv (smallest and largest value of every observable) and figures/alpha-10/*.png beside
this file, and prints measures of the accuracy of the runs.
"""

import argparse
import csv
from pathlib import Path

import numpy as np

import esail_jax as esail
from esail_jax import plotting
from esail_jax.compilation import store
from esail_jax.observables.sail import OBSERVABLES

HERE = Path(__file__).parent

CASES = {"alpha-10": "baseline", "alpha-0": "sun-facing", "voltage-off": "voltage-off"}
"""Name of a case and its built-in scene."""

DRAWN = ("alpha-10",)
"""Cases whose figures are in the repository."""

DOTS_PER_INCH = 80

UNITS = {entry.name: entry.unit for entry in OBSERVABLES}


def range_rows(case: str, solution: esail.Solution) -> list[list]:
    """Returns rows (case, observable, component, unit, smallest, largest), over time and all tethers."""
    rows = []
    for name in solution.observables:
        values = np.asarray(solution[name])
        components = [("", values)]
        if values.shape[-1:] == (3,) and name != "rotation_IB":
            components = [(str(k), values[..., k]) for k in range(3)]
        for component, part in components:
            rows.append([case, name, component, UNITS[name], f"{part.min():.6g}", f"{part.max():.6g}"])
    return rows


def summary(solution: esail.Solution) -> dict[str, float]:
    """Returns the numbers of one column of the README's second table."""
    energy = solution["kinetic_energy"] + solution["elastic_energy"]
    spin = solution["angular_velocity_B"][:, 0]
    stats = solution.stats
    return {
        "steps": solution.steps,
        "iterations per step": np.nanmean(solution.numerics["iterations_per_step"][1:]),
        "run time [s]": stats["wall_time"],
        "compile time [s]": stats["compile_time"],
        "largest constraint violation [m]": solution.numerics["constraint_violation"].max(),
        "largest energy balance error [J]": abs(solution["energy_balance_error"]).max(),
        "largest relative energy change [-]": abs(energy / energy[0] - 1.0).max(),
        "relative spin-rate change at the end [-]": spin[-1] / spin[0] - 1.0,
    }


def draw(solution: esail.Solution, directory: Path) -> None:
    """Writes the figures of `plotting.plot_all`, small enough for the repository."""
    directory.mkdir(parents=True, exist_ok=True)
    for make in plotting.FIGURES:
        make(solution).savefig(directory / f"{make.__name__}.png", dpi=DOTS_PER_INCH)


def main(t_end: float | None) -> None:
    """Runs all cases, writes the table and the figures, prints the summary."""
    overrides = {"integrator.method": "generalized-alpha"}  # the paper's method
    store.switch_off()  # compile times are measured
    if t_end is not None:
        overrides["integrator.t_end"] = t_end
    rows, lines = [], {}
    for case, scene in CASES.items():
        solution = esail.simulate(scene, overrides)
        rows += range_rows(case, solution)
        lines[case] = summary(solution)
        if case in DRAWN:
            draw(solution, HERE / "figures" / case)
    with open(HERE / "table.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["case", "observable", "component", "unit", "min", "max"])
        writer.writerows(rows)
    print(f"{'':42s}" + "".join(f"{case:>14s}" for case in lines))
    for name in lines["alpha-10"]:
        print(f"{name:42s}" + "".join(f"{line[name]:14.5g}" for line in lines.values()))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--t-end", type=float, help="end time of shorter runs [s]")
    main(parser.parse_args().t_end)
