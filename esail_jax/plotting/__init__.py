"""Figures of a run, after [PGV] Fig. 6-10, of a rod chain after [MW] Fig. 2-4. A run is a solution or
a loaded run file.

Every function returns a matplotlib figure; what the run lacks is left out of it.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from esail_jax.plotting.chain import chain_energies, chain_libration, chain_shapes, chain_tension, chain_tip
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
"""Of a sail's run."""

CHAIN_FIGURES = (
    chain_shapes,
    chain_tip,
    chain_libration,
    chain_tension,
    chain_energies,
)
"""Of a rod chain's run."""

DOTS_PER_INCH = 150

__all__ = [
    "CHAIN_FIGURES",
    "FIGURES",
    "all_tethers",
    "attitude",
    "chain_energies",
    "chain_libration",
    "chain_shapes",
    "chain_tension",
    "chain_tip",
    "energies",
    "figures_of",
    "plot_all",
    "sail_forces",
    "sail_picture",
    "tether_forces",
    "tether_motion",
]


def figures_of(run: Any) -> tuple[Callable[[Any], Figure], ...]:
    """The functions that make the figures of this kind of run."""
    return FIGURES if run.scene.chain is None else CHAIN_FIGURES


def plot_all(run: Any, directory: str | Path) -> list[Path]:
    """Write every figure that the run has data for as DIRECTORY/<function>.png; returns the paths.

    The directory is made if it is not there. Raises OSError if that or the writing fails.
    """
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    paths = []
    for make in figures_of(run):
        figure = make(run)
        if figure.axes:
            paths.append(directory / f"{make.__name__}.png")
            figure.savefig(paths[-1], dpi=DOTS_PER_INCH)
    return paths
