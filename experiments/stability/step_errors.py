"""Compares estimated and true errors of fixed steps of generalized-alpha.

    python experiments/stability/step_errors.py                  # all groups; rewrites step_errors.csv
    python experiments/stability/step_errors.py base truss       # groups of cases.py

The true error is the largest difference from collocation over all saved instants, relative to the range.
"""

import csv
import signal
import sys
from pathlib import Path

import numpy as np
from cases import GROUPS, Case
from measure import AT_LEAST, GUARD, OutOfTimeError, joined, largest, out_of_time, scene_of, spread
from starts import start_of

import esail_jax as esail
from esail_jax.observables.balance import balance_warning
from esail_jax.observables.run_warning import STEP_ERRORS, WARN_ABOVE

PATH = Path(__file__).with_name("step_errors.csv")
SIGNALS = dict(zip(("tip_position_I", "reaction_B"), STEP_ERRORS, strict=True))
COLUMNS = (
    "group",
    "case",
    "balance_warns",
    "tips",
    "tips_estimate",
    "forces",
    "forces_estimate",
    "verdict",
)

RIGHT, OFF = 1e-3, 1e-2
"""Errors relative to the range: below RIGHT a warning is false, from OFF on a missing warning is an
error."""


def rows_of(case: Case, variant: str) -> tuple[dict, dict] | None:
    """Observables and numerics of a run, None if it fails or is too slow."""
    scene = scene_of(case, variant)
    run = esail.run(scene, start=start_of(scene, case.start))
    signal.signal(signal.SIGPROF, out_of_time)
    signal.setitimer(signal.ITIMER_PROF, GUARD)
    try:
        chunks = [chunk for chunk in run if len(chunk.time)]
    except (esail.SimulationError, OutOfTimeError):
        return None
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return joined(chunks, "observables"), joined(chunks, "numerics")


def compared(case: Case) -> dict | None:
    """Estimates and, if collocation succeeds, true errors of a case; None if generalized-alpha
    fails."""
    run, true = (rows_of(case, method) for method in ("generalized-alpha", "collocation"))
    if run is None:
        return None
    rows, numerics = run
    row = {"case": case.name, "balance_warns": bool(balance_warning(rows))}
    for (name, estimate), column in zip(SIGNALS.items(), ("tips", "forces"), strict=True):
        row[f"{column}_estimate"] = float(numerics[estimate][-1])
        if true is not None:
            size = max(spread(true[0][name]), AT_LEAST * largest(true[0][name]))
            row[column] = largest(rows[name] - true[0][name]) / size if size > 0.0 else 0.0
    return row | {"verdict": verdict(row)}


def verdict(row: dict) -> str:
    """Tells whether the warning is right, missed or false."""
    warned = not max(row["tips_estimate"], row["forces_estimate"]) <= WARN_ABOVE
    if "tips" not in row:
        return "warned, truth unknown" if warned else "truth unknown"
    off = np.maximum(row["tips"], row["forces"])
    if off >= OFF:
        return "warned" if warned else "missed"
    return ("false" if off < RIGHT else "warned, between") if warned else "silent"


def main() -> None:
    """Measures the chosen groups and writes step_errors.csv."""
    rows = []
    for group in sys.argv[1:] or GROUPS:
        for case in GROUPS[group]:
            row = compared(case)
            if row is not None:
                rows.append({"group": group, **row})
                print(rows[-1], flush=True)
    with PATH.open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, restval="", lineterminator="\n")
        table.writeheader()
        for row in rows:
            table.writerow({k: f"{v:.2g}" if isinstance(v, float) else v for k, v in row.items()})


if __name__ == "__main__":
    main()
