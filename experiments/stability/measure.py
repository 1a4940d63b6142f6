"""Measures runs of cases. A worker process makes the runs of one structure and prints a line of JSON for
each.
"""

import dataclasses
import json
import signal
import sys
import time

import numpy as np
from cases import GROUPS, SMALL, Case
from starts import start_of

import esail_jax as esail
from esail_jax.observables.run_warning import run_warning
from esail_jax.scenes.rules import SceneError

GUARD = 20.0
"""Processor seconds, without compiling, after which a run is stopped. Processor time does not depend on
other programs on the machine."""

FIXED_STEP = 0.1  # generalized-alpha's default [s]

AT_LEAST = 1e-4
"""A signal's range is taken to be at least this fraction of its magnitude. Otherwise a signal at rest
would be compared with rounding errors."""

VARIANTS = {
    "generalized-alpha": ("generalized-alpha", 1.0),
    "collocation": ("collocation", 1.0),
    "generalized-alpha, finer": ("generalized-alpha", 0.25),
    "collocation, finer": ("collocation", 0.25),
}
"""Name of a variant, its method, and the factor of its step. A finer run with a tolerance uses 1e-12
instead."""


class OutOfTimeError(Exception):
    """Raised in a run that exceeds GUARD."""


def scene_of(case: Case, variant: str) -> esail.Scene:
    """The scene of a case for one of `VARIANTS`."""
    method, part = VARIANTS[variant]
    settings = SMALL | case.settings | {"integrator.method": method}
    if method == "generalized-alpha":
        settings["integrator.step"] = part * (case.step or FIXED_STEP)
        settings["output.interval"] *= part  # so that the compiled program is the same
    elif case.step:
        settings["integrator.step"] = part * case.step
    elif part < 1.0:
        settings["integrator.tolerance"] = 1e-12
    scene = esail.load_scene("baseline")
    tables = dict(vars(scene))
    for key in case.absent:
        table, _, name = key.partition(".")
        tables[table] = dataclasses.replace(tables[table], **{name: None}) if name else None
    return type(scene)(**tables).replace(settings)


def measured(case: Case, variant: str) -> dict:
    """Makes a run and returns its outcome and numbers."""
    row = {"case": case.name, "method": variant}
    try:
        scene = scene_of(case, variant)
        run = esail.run(scene, start=start_of(scene, case.start))
    except SceneError as error:
        return row | {"outcome": "refused", "message": " ".join(str(error).split())}
    chunks, message, outcome = [], "", "ran"
    began = time.process_time()
    signal.signal(signal.SIGPROF, out_of_time)
    signal.setitimer(signal.ITIMER_PROF, GUARD)
    try:
        for chunk in run:
            chunks.append(chunk)
    except esail.SimulationError as error:
        outcome, message = "gave up", " ".join(str(error).split())
    except OutOfTimeError:
        outcome, message = "too slow", where(chunks)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    row |= {"outcome": outcome, "message": message, "run_s": time.process_time() - began}
    chunks = [chunk for chunk in chunks if len(chunk.time)]
    return row | (numbers(chunks) if chunks else {"steps": 0})


def out_of_time(*_) -> None:
    """Raises OutOfTimeError; called by the timer."""
    raise OutOfTimeError


def where(chunks: list) -> str:
    """A sentence with the time, steps and step size that a run has reached."""
    chunks = [chunk for chunk in chunks if len(chunk.time)]
    if not chunks:
        return ""
    numerics = joined(chunks, "numerics")
    return (
        f"at t = {chunks[-1].reached:.4g} s after {numerics['steps'].sum():.0f} steps and "
        f"{numerics['rejected_steps'].sum():.0f} rejections, step {numerics['last_step'][-1]:.3g} s"
    )


def joined(chunks: list, part: str) -> dict[str, np.ndarray]:
    """The observables or the numerics of consecutive chunks in one."""
    parts = [getattr(chunk, part) for chunk in chunks]
    return {name: np.concatenate([x[name] for x in parts]) for name in parts[0]}


def numbers(chunks: list) -> dict:
    """Energy balance, constraint violation, steps and the final signals of a run."""
    rows, numerics = joined(chunks, "observables"), joined(chunks, "numerics")
    times = np.concatenate([chunk.time for chunk in chunks])
    energy = rows["kinetic_energy"] + rows["elastic_energy"]
    good = np.isfinite(energy)
    exchanged = (energy - energy[0], rows["external_work"], rows["dissipated_energy"])
    weights = numerics["steps"]
    tips, reactions = rows["tip_position_I"], rows["reaction_B"]
    return {
        "steps": int(weights.sum()),
        "reached_s": float(times[good][-1]) if good.any() else 0.0,
        "finite": bool(np.isfinite(rows["energy_balance_error"]).all()),
        "energy_J": largest(energy),
        "exchanged_J": max(largest(x) for x in exchanged),
        "elastic_J": largest(rows["elastic_energy"]),
        "balance_J": largest(rows["energy_balance_error"]),
        "warning": run_warning(rows, numerics),
        "constraint_m": largest(numerics["constraint_violation"]),
        "iterations": float((weights * numerics["iterations_per_step"]).sum() / max(weights.sum(), 1)),
        "rejected": float(numerics["rejected_steps"].sum()),
        "strain": largest(rows["max_axial_strain"]),
        "tips": tips[-1].tolist(),
        "tips_range": max(spread(tips), AT_LEAST * largest(tips)),
        "reactions": reactions[-1].tolist(),
        "reactions_range": max(spread(reactions), AT_LEAST * largest(reactions)),
    }


def largest(x: np.ndarray) -> float:
    """The largest magnitude of the finite numbers."""
    return float(np.nanmax(np.abs(x), initial=0.0))


def spread(x: np.ndarray) -> float:
    """The largest range of a component."""
    return float(np.nanmax(np.nanmax(x, 0) - np.nanmin(x, 0), initial=0.0))


def main() -> None:
    """Reads jobs, lines of JSON [case, variant], and prints a row for each."""
    cases = {case.name: case for case in GROUPS[sys.argv[1]]}
    for line in sys.stdin:
        name, variant = json.loads(line)
        print(json.dumps(measured(cases[name], variant)), flush=True)


if __name__ == "__main__":
    main()
