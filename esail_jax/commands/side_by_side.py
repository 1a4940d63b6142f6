"""A table of several runs, for `esail info`. It is read from the run files, without JAX."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from esail_jax.commands.description import size_of
from esail_jax.files.opening import intact, open_single, to_python
from esail_jax.scenes.key_reference import differing_keys
from esail_jax.scenes.loading import parse
from esail_jax.scenes.scene import Scene

ERRORS = ("energy_balance_error", "energy_error")
"""Observables whose largest value tells the error of a run: [J] of a sail, relative of a free chain."""


def describe_together(paths: Sequence[Path]) -> str:
    """Returns a table with one column per run: how it ended, model, method, speed and energy balance, and
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
    """Returns the cells of one run, by the name of their row, and its scene."""
    with open_single(path) as file, intact(path):
        attributes = {name: to_python(value) for name, value in file.attrs.items()}
        scene = parse(file["scene"][()].decode(), str(path))
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
