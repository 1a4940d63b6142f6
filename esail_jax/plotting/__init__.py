"""Figures of a run, after [PGV] Fig. 6-10. A run is a solution or a loaded run file.

Every function returns a matplotlib figure; what the run lacks is left out of it.
"""

from pathlib import Path
from typing import Any

from esail_jax.plotting.picture import sail_picture
from esail_jax.plotting.sail import attitude, energies, sail_forces
from esail_jax.plotting.tether import all_tethers, tether_forces, tether_motion

FIGURES = (
    tether_motion,
    tether_forces,
    energies,
    sail_forces,
    attitude,
    all_tethers,
    sail_picture,
)

DOTS_PER_INCH = 150

__all__ = [
    "FIGURES",
    "all_tethers",
    "attitude",
    "energies",
    "plot_all",
    "sail_forces",
    "sail_picture",
    "tether_forces",
    "tether_motion",
]


def plot_all(run: Any, directory: str | Path) -> list[Path]:
    """Write every figure that the run has data for as DIRECTORY/<function>.png; returns the paths.

    The directory is made if it is not there. Raises OSError if that or the writing fails.
    """
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    paths = []
    for make in FIGURES:
        figure = make(run)
        if figure.axes:
            paths.append(directory / f"{make.__name__}.png")
            figure.savefig(paths[-1], dpi=DOTS_PER_INCH)
    return paths
