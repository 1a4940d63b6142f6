"""Measures the errors of runs with default settings on every built-in scene, relative to each range.

    python experiments/work_precision/defaults.py [scene ...]      # a line per scene, and defaults.csv

The reference is the most accurate method at a tolerance near rounding. Its uncertainty is the difference
from a run at ten times that tolerance (`esail_jax/commands/benchmark.py`).
"""

import csv
import sys
from pathlib import Path

import esail_jax as esail
from esail_jax.commands import benchmark as bench
from esail_jax.scenes.loading import builtin_names
from esail_jax.scenes.method_choice import with_method

TABLE = Path(__file__).with_name("defaults.csv")
COLUMNS = ("scene", "method", "steps", "compared", "worst", "error", "doubt")


def row_of(name: str) -> tuple:
    """scene, method, steps, number of compared observables, the worst of them, its error, and the
    uncertainty of the reference for it."""
    scene = esail.load_scene(name)
    reference, _ = bench.reference_line(scene)
    run = esail.simulate(scene)
    found = bench.errors(bench.rows_of(run), reference.rows, reference.names)
    worst, method = bench.worst(found), with_method(scene).integrator.method
    error, doubt = (f"{x[worst]:.1e}" for x in (found, reference.doubt))
    return name, method, run.steps, len(found), worst, error, doubt


def main(names: list[str]) -> None:
    """Runs all scenes, prints and writes defaults.csv."""
    with open(TABLE, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for name in names:
            row = row_of(name)
            table.writerow(row)
            print(*row, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or builtin_names())
