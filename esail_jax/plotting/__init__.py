"""Figures of a run: of a sail after [PGV] Fig. 6-10, of a rod chain after [MW] Fig. 2-4.

A run is a solution or a loaded run file. `plot` draws one observable or all figures; every function of
`FIGURES` and `CHAIN_FIGURES` returns one matplotlib figure. Data that the run does not have are left out.
`compare` draws several runs on the same axes.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from esail_jax.ensembles.ensemble import Ensemble
from esail_jax.plotting.chain import (
    chain_deployment,
    chain_energies,
    chain_libration,
    chain_shapes,
    chain_tension,
    chain_tip,
)
from esail_jax.plotting.comparison import compare, write_comparison
from esail_jax.plotting.dates import dated_figures, epoch_of
from esail_jax.plotting.ensemble import draw_quantiles, figures_of_ensemble
from esail_jax.plotting.figure_files import Told, write_figures
from esail_jax.plotting.panels import time_unit
from esail_jax.plotting.picture import sail_picture
from esail_jax.plotting.sail import attitude, energies, sail_forces
from esail_jax.plotting.single import draw_observable
from esail_jax.plotting.tether import all_tethers, deployment, tether_forces, tether_motion, voltages

FIGURES = (
    tether_motion,
    tether_forces,
    energies,
    sail_forces,
    attitude,
    all_tethers,
    deployment,
    voltages,
    sail_picture,
)
"""Figures of a sail's run."""

CHAIN_FIGURES = (
    chain_shapes,
    chain_tip,
    chain_libration,
    chain_tension,
    chain_deployment,
    chain_energies,
)
"""Figures of a rod chain's run."""

__all__ = [
    "CHAIN_FIGURES",
    "FIGURES",
    "all_tethers",
    "attitude",
    "chain_deployment",
    "chain_energies",
    "chain_libration",
    "chain_shapes",
    "chain_tension",
    "chain_tip",
    "compare",
    "deployment",
    "energies",
    "figures_of",
    "overview",
    "plot",
    "plot_all",
    "sail_forces",
    "sail_picture",
    "tether_forces",
    "tether_motion",
    "voltages",
    "write_comparison",
]


def figures_of(run: Any) -> tuple[Callable[[Any], Figure], ...]:
    """The functions that make the figures of this kind of run."""
    return FIGURES if run.scene.chain is None else CHAIN_FIGURES


def overview(run: Any, modes: Any = None, calendar: bool = False) -> Iterator[tuple[str, Figure]]:
    """Makes the figures that the run has data for, one after the other, each with its name. modes: an
    `esail_jax.ModeTable` for the lines in the spectra, None for none; calendar: whether time is shown as
    dates. Raises ArgumentError for dates of a run without an epoch."""
    made = (
        (make.__name__, make(run, modes=modes) if make is tether_motion else make(run))
        for make in figures_of(run)
    )
    shown = ((name, figure) for name, figure in made if figure.axes)
    return dated_figures(shown, epoch_of([run.scene]), *time_unit(run)) if calendar else shown


def plot(
    solution: Any,
    name: str | None = None,
    *,
    ax: Axes | None = None,
    modes: Any = None,
    calendar: bool = False,
) -> Axes | dict[str, Figure]:
    """Draws a solution, a run loaded from a file, or an ensemble.

    `plot(solution, "coning_angle")` draws this observable against time into the matplotlib axes `ax`, or
    into a new pyplot figure if `ax` is None, and returns the axes. Name, symbol and unit are those of the
    list of observables. Time is in spin periods (of a chain: in orbits), or in seconds if there are none;
    with `calendar` it is the date, for a run with an epoch, as matplotlib counts dates.

    `plot(solution)` makes the overview figures, which the command `esail plot` writes, and returns them by
    name. Figures and panels for which the run has no data are left out. modes: modes of the sail, as
    `esail_jax.modes(solution.scene)` returns them, which are lines with their names in the spectra.

    `plot(ensemble, "coning_angle")` draws the quantiles over the members that reached their end as a fan,
    and `plot(ensemble)` makes the figures that the command `esail plot` writes.

    Raises ValueError if the run has no observable of this name, if `ax` is given without a name, if
    `calendar` is for a run without an epoch, or if the solution was computed under a trace, inside
    `jax.jit` for example, and therefore has no scene.
    """
    if solution.scene is None:
        raise ValueError("`solution` must have a scene, but was computed under a trace")
    if name is not None:
        draw = draw_quantiles if isinstance(solution, Ensemble) else draw_observable
        return draw(solution, name, ax, calendar)
    if ax is not None:
        raise ValueError("`name` must be given with `ax`, but is None")
    if isinstance(solution, Ensemble):
        return dict(figures_of_ensemble(solution, calendar))
    return dict(overview(solution, modes, calendar))


def plot_all(
    run: Any,
    directory: str | Path,
    modes: Any = None,
    tell: Told = None,
    kind: str = "png",
    calendar: bool = False,
) -> list[Path]:
    """Writes every figure that the run has data for as DIRECTORY/<name>.<kind>; returns the paths. modes:
    and calendar: as for `plot`; tell: a function that is called with every path as soon as the file is
    written; kind: png, pdf or svg.

    The directory is created if it does not exist. Raises OSError if that or the writing fails.
    """
    return write_figures(overview(run, modes, calendar), directory, tell, kind)
