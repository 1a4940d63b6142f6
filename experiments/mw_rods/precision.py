"""Measures error of the tip and run time of explicit methods, generalized-alpha and Exudyn.

run.py calls this module. The error is the largest distance [m] of the tip from the reference over its saved
instants. The run time is the median of three runs (one, if it takes over three seconds) after a first one
that compiles.
"""

import functools

import figures
import numpy as np
from common import DIRECTIONS, REFERENCES, distance, reference_name, table_of, write

import esail_jax as esail
from esail_jax.compilation.stored import STORE

CASES = {
    "exp1 +X": ("hanging-chain", "+X", 0.05),
    "exp1 -Y": ("hanging-chain", "-Y", 0.05),
    "exp2 +X": ("steel-chain", "+X", 0.005),
}
"""Scene, direction of gravity, and interval of the reference [s] of every case."""

TOLERANCES = [10.0**-k for k in range(4, 12)]
FIXED = {"hanging-chain": (3e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4), "steel-chain": (1e-5, 5.6e-6, 5e-6, 2.5e-6)}
IMPLICIT = {
    "hanging-chain": (5e-3, 2.5e-3, 1e-3, 5e-4, 2e-4, 1e-4),
    "steel-chain": (1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5, 2.5e-5),
}
"""Steps [s] of the implicit method; they divide the interval between saved instants."""

SLOW = 3.0  # run time [s] above which a run is not repeated


def settings(scene: str) -> list[tuple[str, float, dict]]:
    """curve, parameter and overrides of every point."""
    tolerances = TOLERANCES if scene == "hanging-chain" else TOLERANCES[::2] + TOLERANCES[-1:]
    found = [
        (name, t, {"integrator.method": name, "integrator.tolerance": t})
        for name in ("tsit5", "dopri5", "dopri8")
        for t in tolerances
    ]
    for step in FIXED[scene]:
        found.append(("dopri5, fixed step", step, {"integrator.method": "dopri5", "integrator.step": step}))
    for step in IMPLICIT[scene]:
        options = {
            "integrator.method": "generalized-alpha",
            "integrator.step": step,
            "integrator.spectral_radius": 0.9,
        }
        found.append(("generalized-alpha", step, options))
    return found


def point(case: str, curve: str, parameter: float, options: dict) -> dict:
    """A row of the table; for a failed run with the message."""
    scene, direction, interval = CASES[case]
    run = functools.partial(
        esail.simulate,
        scene,
        {"gravity.acceleration": DIRECTIONS[direction], "output.interval": interval, **options},
    )
    row = {"case": case, "method": curve, "parameter": f"{parameter:g}"}
    row |= dict.fromkeys(("steps", "error_m", "run_s", "compile_s", "note"), "")
    try:
        first = run()
    except esail.SimulationError as failure:
        return row | {"note": " ".join(str(failure).split())}
    again = [run()]
    if again[0].stats["wall_time"] < SLOW:
        again += [run(), run()]
    rejected = first.stats["rejected_steps"]
    off = distance(first, table_of(reference_name(direction, int(case[3]))))
    return row | {
        "steps": int(first.stats["steps"]),
        "error_m": float(off.max()),
        "run_s": float(np.median([solution.stats["wall_time"] for solution in again])),
        "compile_s": float(first.stats["compile_time"]),
        "note": f"rejected steps: {rejected}" if curve == "generalized-alpha" and rejected else "",
    }


def exudyn() -> list[dict]:
    """Exudyn's rows for the same experiment; errors are relative to its own converged solution."""
    with open(REFERENCES / "exudyn_timing.csv", encoding="utf-8") as file:
        _, *lines = file.read().splitlines()
    rows = {}
    for line in lines:
        model, method, _, error, count, _, seconds = line.split(",")
        name, _, tolerance = method.partition(" ")
        rows[model, method, count] = {
            "case": "exp2 +X",
            "method": f"exudyn {model} {name}",
            "parameter": tolerance,
            "steps": int(count),
            "error_m": float(error),
            "run_s": float(seconds),
            "compile_s": "",
            "note": "error against Exudyn's own limit",
        }
    return list(rows.values())


def main() -> None:
    """Runs all cases; writes the table and its figure."""
    STORE.switch_off()  # compile times are measured
    rows = []
    for case, (scene, *_) in CASES.items():
        rows += [point(case, *setting) for setting in settings(scene)]
        print(case, "done", flush=True)
    rows += exudyn()
    write("work_precision.csv", rows)
    figures.work_precision(rows, list(CASES))
