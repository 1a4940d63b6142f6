"""`esail info` of a design. It is read from the files, without JAX."""

import ast
from pathlib import Path

import h5py

from esail_jax.commands.side_by_side import describe_together
from esail_jax.files.opening import DESIGN, RUNS_OF_DESIGN, intact


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
