"""One run of one case, measured; a worker process does the runs of one structure, one line of JSON each."""

import dataclasses
import json
import signal
import sys
import time

import numpy as np
from cases import GROUPS, SMALL, Case
from starts import with_start

import esail_jax as esail
from esail_jax.observables.run_warning import run_warning
from esail_jax.scenes.rules import SceneError
from esail_jax.simulation.march import march_of
from esail_jax.simulation.prepare import prepare
from esail_jax.simulation.results import join

GUARD = 20.0
"""Processor seconds after which a run is stopped, compiling excluded: what else the machine does changes
nothing."""

FIXED_STEP = 0.1  # generalized-alpha's default [s]

AT_LEAST = 1e-4
"""Of its size is what something is said to range over: at rest only rounding would be left to compare."""

VARIANTS = {
    "generalized-alpha": ("generalized-alpha", 1.0),
    "collocation": ("collocation", 1.0),
    "generalized-alpha, finer": ("generalized-alpha", 0.25),
    "collocation, finer": ("collocation", 0.25),
}
"""Method, and part of the step. With a tolerance instead: a thousandth of the default."""


class OutOfTimeError(Exception):
    """The guard's."""


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
    """Outcome and numbers of a run."""
    row = {"case": case.name, "method": variant}
    try:
        prepared = with_start(prepare(scene_of(case, variant)), case.start)
    except SceneError as error:
        return row | {"outcome": "refused", "message": " ".join(str(error).split())}
    march, pieces, message, outcome = march_of(prepared), [], "", "ran"
    began = time.process_time()
    signal.signal(signal.SIGPROF, out_of_time)
    signal.setitimer(signal.ITIMER_PROF, GUARD)
    try:
        for piece in march.pieces():
            pieces.append(piece)
    except esail.SimulationError as error:
        outcome, message = "gave up", " ".join(str(error).split())
    except OutOfTimeError:
        outcome, message = "too slow", where(march)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    row |= {"outcome": outcome, "message": message, "run_s": time.process_time() - began}
    row |= {"steps": march.steps, "repairs": march.repairs}
    pieces = [piece for piece in pieces if len(piece.time)]
    return row | (numbers(pieces) if pieces else {})


def out_of_time(*_) -> None:
    raise OutOfTimeError


def where(march) -> str:
    """How far a run of collocation got, and with which step; of others the time."""
    progress = getattr(march.carry, "progress", None)
    if progress is None:
        return ""
    return (
        f"at t = {float(progress.now.time):.4g} s after {float(progress.taken):.0f} steps and "
        f"{float(progress.rejected):.0f} rejections, step {float(progress.h):.3g} s"
    )


def numbers(pieces: list) -> dict:
    """Energy balance, constraints, steps and the end of what was seen."""
    rows, numerics = join([piece.rows for piece in pieces]), join([piece.numerics for piece in pieces])
    times = np.concatenate([piece.time for piece in pieces])
    energy = rows["kinetic_energy"] + rows["elastic_energy"]
    good = np.isfinite(energy)
    exchanged = (energy - energy[0], rows["external_work"], rows["dissipated_energy"])
    weights = numerics.get("steps", np.ones(len(times)))
    tips, reactions = rows["tip_position_I"], rows["reaction_B"]
    return {
        "reached_s": float(times[good][-1]) if good.any() else 0.0,
        "finite": bool(np.isfinite(rows["energy_balance_error"]).all()),
        "energy_J": largest(energy),
        "exchanged_J": max(largest(x) for x in exchanged),
        "elastic_J": largest(rows["elastic_energy"]),
        "balance_J": largest(rows["energy_balance_error"]),
        "warning": run_warning(rows, numerics),
        "constraint_m": largest(numerics["constraint_violation"]),
        "iterations": float((weights * numerics["iterations_per_step"]).sum() / max(weights.sum(), 1)),
        "rejected": float(numerics.get("rejected_steps", np.zeros(1)).sum()),
        "strain": largest(rows["max_axial_strain"]),
        "tips": tips[-1].tolist(),
        "tips_range": max(spread(tips), AT_LEAST * largest(tips)),
        "reactions": reactions[-1].tolist(),
        "reactions_range": max(spread(reactions), AT_LEAST * largest(reactions)),
    }


def largest(x: np.ndarray) -> float:
    """Of the finite ones."""
    return float(np.nanmax(np.abs(x), initial=0.0))


def spread(x: np.ndarray) -> float:
    """Largest range of a component."""
    return float(np.nanmax(np.nanmax(x, 0) - np.nanmin(x, 0), initial=0.0))


def main() -> None:
    """Jobs come as lines of JSON, [case, variant]; each is answered by its row."""
    cases = {case.name: case for case in GROUPS[sys.argv[1]]}
    for line in sys.stdin:
        name, variant = json.loads(line)
        print(json.dumps(measured(cases[name], variant)), flush=True)


if __name__ == "__main__":
    main()
