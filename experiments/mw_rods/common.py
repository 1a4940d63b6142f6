"""Functions that the parts of run.py share: directions, references, signals of runs, tables."""

import csv
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

import esail_jax as esail

HERE = Path(__file__).parent
REFERENCES = HERE / "references"
GRAVITY = 9.81  # [m/s^2]
AXES = {"x": [1.0, 0.0, 0.0], "y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]}
DIRECTIONS = {
    f"{sign}{axis.upper()}": [(GRAVITY if sign == "+" else -GRAVITY) * u for u in AXES[axis]]
    for axis in AXES
    for sign in "+-"
}
"""Name of a direction and gravity [m/s^2] along it."""

DEFAULT = "default (dopri8, 1e-9)"
METHODS = {
    "dopri5, step 1e-4 s": {"integrator.method": "dopri5", "integrator.step": 1e-4},
    "dopri5, tolerance 1e-3": {"integrator.method": "dopri5", "integrator.tolerance": 1e-3},
    "dopri5, tolerance 1e-6": {"integrator.method": "dopri5", "integrator.tolerance": 1e-6},
    DEFAULT: {},
}


def reference_name(direction: str, experiment: int = 1) -> str:
    """The name of the file with the tip's path for gravity along `direction`, for example `+X`."""
    return f"exp{experiment}_{'plus' if direction[0] == '+' else 'minus'}_{direction[1].lower()}"


def table_of(name: str) -> np.ndarray:
    """The rows of references/<name>.csv, (row, column)."""
    return np.loadtxt(REFERENCES / f"{name}.csv", delimiter=",")


def reference_error(name: str) -> float:
    """The final distance [m] between the reference and the next best solution, from the file's
    header."""
    with open(REFERENCES / f"{name}.csv", encoding="utf-8") as file:
        lines = [line for line in file if line.startswith("#") and "Gauss, step" in line]
    return float(re.findall(r": \S+, (\S+)$", next(line for line in lines if "kept" not in line))[0])


def tip(solution: esail.Solution) -> np.ndarray:
    """The path of the free end [m], (time, 3)."""
    return np.asarray(solution["joint_position"])[:, -1]


def distance(solution: esail.Solution, reference: np.ndarray) -> np.ndarray:
    """The distance [m] between the tip and its reference (t, x, y, z), at the reference's
    instants."""
    every = round((len(solution.time) - 1) / (len(reference) - 1))
    if not np.allclose(solution.time[::every], reference[:, 0], atol=1e-9):
        raise ValueError("the saved instants of the run and of its reference differ")
    return np.linalg.norm(tip(solution)[::every] - reference[:, 1:4], axis=1)


def energies(solution: esail.Solution) -> dict[str, np.ndarray]:
    """kinetic, elastic, potential (zero at the anchor's height) and total energy [J]."""
    parts = {name: np.asarray(solution[f"{name}_energy"]) for name in ("kinetic", "elastic", "potential")}
    return parts | {"total": sum(parts.values())}


def relative_error(solution: esail.Solution) -> np.ndarray:
    """(E - E_0) / E_0, Eq. 31 of the paper; NaN if E_0 is zero."""
    total = energies(solution)["total"]
    scale = max(np.abs(part).max() for part in energies(solution).values())
    start = total[0] if abs(total[0]) > 1e-12 * scale else np.nan
    return (total - total[0]) / start


def write(name: str, rows: Iterable[dict]) -> None:
    """Writes a table beside this file and prints it. Floating-point numbers have four digits."""

    def text(value):
        return f"{value:.4g}" if isinstance(value, float) else value

    rows = [{key: text(value) for key, value in row.items()} for row in rows]
    with open(HERE / name, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(f"\n{name}")
    for row in rows:
        print("   ", *row.values(), sep="  ", flush=True)


def read(name: str) -> list[dict]:
    """Reads a table beside this file."""
    with open(HERE / name, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
