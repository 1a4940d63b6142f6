"""`esail plot`, and the figure of `esail design`."""

from pathlib import Path

import numpy as np

from esail_jax.files.opening import holds_ensemble
from esail_jax.files.run_file import load
from esail_jax.plotting import plot_all
from esail_jax.plotting.design import design_figure
from esail_jax.simulation.solution import Solution


def draw_file(path: Path, folder: Path) -> None:
    """Draws the figures of a run file or of the file of an ensemble, and prints their paths. Raises
    RunFileError."""
    if holds_ensemble(path):
        from esail_jax.ensembles import load_ensemble
        from esail_jax.plotting.ensemble import plot_ensemble

        paths = plot_ensemble(load_ensemble(path), folder)
    else:
        paths = plot_all(load(path), folder)
    for figure in paths:
        print(figure)


def draw_design(before: Solution, after: Solution, objective: np.ndarray, folder: Path) -> None:
    """Draws design.png from what `run_design` returns."""
    design_figure(before, after, objective).savefig(folder / "design.png", dpi=110)
