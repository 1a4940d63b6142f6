"""What `esail info` and the ends of commands say of runs, ensembles and designs. It is read from the files,
without JAX."""

import ast
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from esail_jax.calendar.instants import dated
from esail_jax.files.opening import (
    DESIGN,
    RUNS_OF_DESIGN,
    intact,
    open_run,
    open_single,
    to_python,
)
from esail_jax.files.reading import known_rows, scene_in
from esail_jax.scenes.key_reference import differing_keys
from esail_jax.scenes.scene import Scene, releases


def describe(path: Path, said: Sequence[str] = ()) -> str:
    """A few lines on a run: model, method, how it ended, speed, energy balance, versions. said: sentences
    of its message that its user has read already."""
    with open_run(path) as file, intact(path):
        attributes = {name: to_python(value) for name, value in file.attrs.items()}
        scene = scene_in(file, path)
        times = file["time"][()]
        if attributes["status"] == "failed":  # the file of a solution has rows of NaN behind the failure
            times = times[
                : known_rows({x: data[()] for x, data in file["observables"].items()}, len(times))
            ]
        terms = ", ".join(file["numerics"].attrs["terms"])
        balance = balance_text(file)
    for sentence in said:
        attributes["message"] = " ".join(attributes["message"].replace(sentence, "").split())
    reached = times[-1] if len(times) else 0.0
    dates = dated(scene.initial.epoch, np.array([0.0, reached]), 0) if scene.initial.epoch else []
    wall = max(attributes["wall_time"], 1e-9)
    steps = attributes["steps"]
    lines = [
        *heading(path, attributes, scene, terms),
        f"  time       {reached:g} of {scene.integrator.t_end:g} s, {len(times)} saved instants",
        f"  dates      {dates[0]} to {dates[1]}, epoch {attributes['epoch']}" if dates else "",
        f"  speed      {steps} steps in {wall:.2f} s ({1e6 * wall / max(steps, 1):.0f} us a step, "
        f"{reached / wall:.0f} x real time), compiling {attributes['compile_time']:.2f} s",
        balance,
        stability_text(attributes),
        release_text(scene, reached),
        f"  device     {attributes['device']}, jax {attributes['version_jax']}, "
        f"Python {attributes['version_python']}, esail_jax {attributes['version_esail_jax']}",
    ]
    return "\n".join(line for line in lines if line)


def stability_text(attributes: Mapping[str, Any]) -> str:
    """A line on the growth of a small perturbation; empty if it was not measured."""
    if "growth_rate" not in attributes:
        return ""
    rate, growth = attributes["growth_rate"], attributes["growth"]
    return f"  stability  a small perturbation grows {growth:.2g}-fold, at {rate:.2g} 1/s at the end"


def release_text(scene: Scene, reached: float) -> str:
    """A line on the tethers that were released up to an instant [s], and what still includes them; empty
    if there are none."""
    tethers = [
        f"tether {number} at {time:g} s"
        for time, numbers in releases(scene).items()
        for number in numbers
        if time <= reached
    ]
    if not tethers:
        return ""
    them = "it" if len(tethers) == 1 else "them"
    return f"  released   {', '.join(tethers)}; thrust, energies and powers still include {them}"


def heading(path: Path, attributes: Mapping[str, Any], scene: Scene, terms: str) -> list[str]:
    """The first lines for runs and ensembles: status, message, model and method."""
    method = ", ".join(attributes[name] for name in ("method", "accuracy") if attributes[name])
    return [
        f"{path}: {attributes['status']}",
        f"  {attributes['message']}" if attributes["message"] else "",
        f"  model      {size_of(scene)}: {terms}",
        f"  method     {method}" + (" (chosen)" if scene.integrator.method is None else ""),
    ]


def size_of(scene: Scene) -> str:
    """Size of the model: numbers of tethers and elements, or of rods."""
    if scene.chain is not None:
        return f"{scene.chain.rods} rods"
    return f"{scene.tethers.count} tethers x {scene.tethers.elements} elements"


def balance_text(file: h5py.File) -> str:
    """A line with the largest energy error and the energy to compare it with; empty if unknown."""
    seen = file["observables"]
    if not seen.keys() >= {"energy_balance_error", "kinetic_energy", "elastic_energy"}:
        if not seen.keys() >= {"energy_error", "kinetic_energy"}:
            return ""
        error, kinetic = seen["energy_error"][()], seen["kinetic_energy"][()]
        good = np.isfinite(error)
        if not good.any():
            return ""
        largest, energy = abs(error[good]).max(), kinetic[good].max()
        return f"  balance    |E - E_0| <= {largest:.2e} of max(|E_0|, T), T up to {energy:.5g} J"
    good = np.isfinite(seen["energy_balance_error"][()])  # rows after a failure are NaN
    if not good.any():
        return ""
    error = abs(seen["energy_balance_error"][()][good]).max()
    energy = (seen["kinetic_energy"][()] + seen["elastic_energy"][()])[good].max()
    text = f"  balance    |dE - W + D| <= {error:.2e} J of {energy:.5g} J"
    if "constraint_violation" in file["numerics"]:
        text += f"; constraints within {file['numerics/constraint_violation'][()][good].max():.1e} m"
    return text


# ---- several runs ------------------------------------------------------------------------------


ERRORS = ("energy_balance_error", "energy_error")
"""Observables whose largest value tells the error of a run: [J] of a sail, relative of a free chain."""


def describe_together(paths: Sequence[Path]) -> str:
    """A table with one column per run: how it ended, model, method, speed and energy balance, and
    the scene keys in which the runs differ. Raises RunFileError for a file that is not that of one run."""
    columns, scenes = zip(*(column_of(path) for path in paths), strict=True)
    rows = [(name, *(column[name] for column in columns)) for name in columns[0]]
    rows += [(key, *values) for key, values in differing_keys(scenes).items()]
    widths = [max(map(len, cells)) for cells in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )


def column_of(path: Path) -> tuple[dict[str, str], Scene]:
    """The cells of one run, by the name of their row, and its scene."""
    with open_single(path) as file, intact(path):
        attributes = {name: to_python(value) for name, value in file.attrs.items()}
        scene = scene_in(file, path)
        times = file["time"][()]
        name = next((name for name in ERRORS if name in file["observables"]), None)
        error = np.abs(file["observables"][name][()]) if name else np.array([])
    error = error[np.isfinite(error)]
    steps, wall = attributes["steps"], attributes["wall_time"]
    method = " ".join(attributes[name] for name in ("method", "accuracy") if attributes[name])
    cells = {
        "run": os.fspath(path),
        "status": attributes["status"],
        "model": size_of(scene),
        "method": method,
        "end [s]": f"{times[-1] if len(times) else 0.0:g}",
        "saved instants": str(len(times)),
        "steps": str(steps),
        "wall time [s]": f"{wall:.3g}",
        "compile time [s]": f"{attributes['compile_time']:.3g}",
        "largest energy error": f"{error.max():.2e}" + " J" * (name == ERRORS[0]) if len(error) else "-",
    }
    return cells, scene


# ---- designs ------------------------------------------------------------------------------------------


def describe_design(folder: Path) -> str:
    """The objective of a design at the start and now, and its two runs side by side once they are there.
    Raises RunFileError."""
    path = folder / DESIGN
    with intact(path), h5py.File(path) as file:
        value, method, weights = file["value"][()], file.attrs["method"], file.attrs["weights"]
    weights = ", ".join(f"{name} {weight:g}" for name, weight in ast.literal_eval(weights))
    starts = value.shape[1]  # the first of them begins with the voltages of the scene
    lines = [
        f"{folder}: design, {len(value) - 1} iterations" + f" from each of {starts} starts" * (starts > 1),
        f"  optimiser  {method}, with the weights {weights}",
        f"  objective  {value[0, 0]:.6g} at the start, {value[-1].min():.6g} now",
    ]
    runs = [folder / name for name in RUNS_OF_DESIGN]
    if all(run.exists() for run in runs):
        return "\n".join(lines) + "\n\n" + describe_together(runs)
    return "\n".join([*lines, "  `esail design` with --resume goes on and writes the runs"])
