"""`esail plot`, and the figure of `esail design`."""

from pathlib import Path
from typing import Any

import numpy as np

from esail_jax.errors import SimulationError
from esail_jax.files.opening import holds_ensemble
from esail_jax.files.run_file import load
from esail_jax.modal.sail_modes import modes
from esail_jax.observables.saved_rows import leading_finite
from esail_jax.plotting import plot_all
from esail_jax.plotting.data import LEAST_SAMPLES
from esail_jax.plotting.design import design_figure
from esail_jax.scenes.rules import SceneError
from esail_jax.simulation.solution import Solution


def draw_file(path: Path, folder: Path) -> None:
    """Draws the figures of a run file or of the file of an ensemble, and prints their paths. Raises
    RunFileError."""
    if holds_ensemble(path):
        from esail_jax.ensembles import load_ensemble
        from esail_jax.plotting.ensemble import plot_ensemble

        paths = plot_ensemble(load_ensemble(path), folder)
    else:
        run = load(path)
        paths = plot_all(run, folder, modes_of(run))
    for figure in paths:
        print(figure)


def modes_of(run: Any) -> Any:
    """Returns the modes of the sail of a run, for the lines in its spectra; None if its scene has none, or
    if the run is too short for a spectrum."""
    if run.scene.chain is not None or leading_finite(run.time) < LEAST_SAMPLES:
        return None
    try:
        return modes(run.scene, converge=False)
    except (SceneError, SimulationError):
        return None


def draw_design(before: Solution, after: Solution, objective: np.ndarray, folder: Path) -> None:
    """Draws design.png from what `run_design` returns."""
    design_figure(before, after, objective).savefig(folder / "design.png", dpi=110)
