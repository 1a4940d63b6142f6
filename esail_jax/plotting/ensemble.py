"""Figures of an ensemble: quantiles of observables against time, distributions of outcomes, and shares of
their variance by input."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from esail_jax.ensembles import Ensemble, outcomes_of, sensitivities
from esail_jax.ensembles.statistics import DEGREES
from esail_jax.plotting.dates import Calendar, dated_figures, epoch_of, show_dates
from esail_jax.plotting.figure_files import Told, write_figures
from esail_jax.plotting.panels import legend_above
from esail_jax.plotting.single import COMPONENT_COLOURS, entry_of, label_of, labels_of
from esail_jax.plotting.style import BLUE, styled

MINUTE = 60.0
"""Unit of the axis of time [s]."""

FANS = (
    ("coning angle [deg]", "coning_angle", DEGREES, None),
    ("lagging angle [deg]", "lagging_angle", DEGREES, None),
    ("sailing angle [deg]", "sailing_angle", DEGREES, None),
    ("spin rate [mrad/s]", "angular_velocity_B", 1e3, 0),
    ("thrust along the wind [mN]", "thrust_O", 1e3, 2),
    ("axial strain [1e-6]", "max_axial_strain", 1e6, None),
    ("smallest tether distance [km]", "smallest_tether_distance", 1e-3, None),
    ("kinetic energy [J]", "kinetic_energy", 1.0, None),
    ("tension [N]", "tension", 1.0, None),
)
"""Label, observable, factor and component of a vector. The tethers or rods of all members form one
sample."""

BANDS = ((0.0, 1.0, 0.12), (0.05, 0.95, 0.22), (0.25, 0.75, 0.35))
"""Lower and upper probability of a band, and its opacity."""


TIME = "t [min]"
"""Label of the axis of time."""


def plot_ensemble(
    ensemble: Ensemble,
    directory: str | Path,
    tell: Told = None,
    kind: str = "png",
    calendar: bool = False,
) -> list[Path]:
    """Writes every figure that the ensemble has data for as DIRECTORY/<name>.<kind>; returns the paths, and
    tells each of them as soon as the file is written. kind: png, pdf or svg; calendar: whether time is
    shown as dates.

    The directory is created if it does not exist. Raises OSError if that or the writing fails."""
    return write_figures(figures_of_ensemble(ensemble, calendar), directory, tell, kind)


def figures_of_ensemble(ensemble: Ensemble, calendar: bool = False) -> Iterator[tuple[str, Figure]]:
    """Makes the figures that the ensemble has data for, one after the other, each with its name. calendar:
    whether time is shown as dates. Raises ArgumentError for dates of a scene without an epoch."""
    makers = {"fans": fans, "distributions": distributions, "drivers": drivers_figure}
    made = ((name, make(ensemble)) for name, make in makers.items())
    shown = ((name, figure) for name, figure in made if figure.axes)
    return dated_figures(shown, epoch_of([ensemble.scene]), MINUTE, TIME) if calendar else shown


def grid_of(count: int, width: float = 4.0, height: float = 2.6) -> tuple[Figure, list[Axes]]:
    """A figure with `count` axes, three in a row."""
    columns = min(count, 3)
    rows = -(-count // 3)
    figure = Figure(figsize=(width * max(columns, 1), height * max(rows, 1)), layout="constrained")
    if not count:
        return figure, []
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for spare in axes[count:]:
        spare.remove()
    return figure, list(axes[:count])


def fans(ensemble: Ensemble) -> Figure:
    """The figure of quantiles over the members against time: bands of all, 90 % and 50 % of them,
    and the median."""
    shown = []
    for label, name, factor, component in FANS:
        if name not in ensemble.observables or not ensemble.complete.any():
            continue
        rows = factor * ensemble[name][ensemble.complete]
        rows = rows if component is None else rows[..., component]
        rows = np.moveaxis(rows, 1, 0).reshape(len(ensemble.time), -1)
        if np.isfinite(rows).all():
            shown.append((label, rows))
    figure, axes = grid_of(len(shown))
    for ax, (label, rows) in zip(axes, shown, strict=True):
        draw_fan(ax, ensemble.time, rows, BLUE)
        ax.set_ylabel(label)
    if axes:
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize="small")
        figure.suptitle(f"{int(ensemble.complete.sum())} of {len(ensemble)} members")
    return figure


def draw_fan(ax: Axes, time: np.ndarray, rows: np.ndarray, colour: Any, name: str = "") -> None:
    """Draws the quantiles of rows (time, sample) against time [s]."""
    minutes = time / MINUTE
    for low, high, dark in BANDS:
        lower, upper = np.quantile(rows, (low, high), axis=1)
        part = "all" if high == 1.0 else f"{100 * (high - low):.0f} %"
        ax.fill_between(minutes, lower, upper, color=colour, alpha=dark, lw=0.0, label=f"{name}{part}")
    ax.plot(minutes, np.median(rows, axis=1), color=colour, lw=1.0, label=f"{name}median")
    ax.set_xlabel(TIME)
    ax.grid(alpha=0.3)


def draw_quantiles(ensemble: Ensemble, name: str, ax: Axes | None = None, calendar: bool = False) -> Axes:
    """Draws the quantiles of an observable over the members that reached their end, against time, into
    `ax`, or into a new pyplot figure if None. Tethers, rods and joints of all members form one sample; x,
    y, z and angles have a fan each. calendar: whether the ticks are dates.

    Raises ValueError for an unknown name, if no member has reached its end, and for dates of a scene
    without an epoch."""
    if ensemble.reduced:
        kept = ", ".join(ensemble.reduced)
        raise ValueError(f"`ensemble` must have histories to be drawn, but has only {kept}")
    entry = entry_of(ensemble, name)
    epoch = epoch_of([ensemble.scene]) if calendar else None
    if not ensemble.complete.any():
        raise ValueError("`ensemble` must have a member that reached its end, but has none")
    if ax is None:
        _, ax = pyplot.subplots(layout="constrained")
    rows = np.moveaxis(ensemble[name][ensemble.complete], 1, 0)
    parts = {"": rows.reshape(len(ensemble.time), -1)}
    if entry.axes and entry.axes[-1] in ("xyz", "angle"):
        labels = labels_of(entry, entry.axes[-1], rows.shape[-1])
        parts = {f"{label}, ": rows[..., k].reshape(len(rows), -1) for k, label in enumerate(labels)}
    for (label, part), colour in zip(parts.items(), COMPONENT_COLOURS, strict=False):
        draw_fan(ax, ensemble.time, part, colour, label)
    ax.set_ylabel(label_of(entry))
    ax.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
    legend_above(ax, 4 if len(parts) == 1 else len(parts))
    if epoch is not None:
        show_dates(ax, Calendar.of(epoch, MINUTE))
    return ax


def distributions(ensemble: Ensemble) -> Figure:
    """The figure of histograms of the outcomes, each one number per member."""
    outcomes = outcomes_of(ensemble)
    figure, axes = grid_of(len(outcomes))
    for ax, outcome in zip(axes, outcomes, strict=True):
        y = outcome.of(ensemble)
        y = y[np.isfinite(y)]
        ax.hist(y, bins=int(np.clip(len(y) ** 0.5, 5, 60)), color=BLUE, alpha=0.7)
        for probability in (0.05, 0.95):
            ax.axvline(np.quantile(y, probability), color="black", ls="--", lw=0.8)
        ax.set_xlabel(f"{outcome.label} [{outcome.unit}]")
        ax.set_ylabel("members")
        ax.grid(alpha=0.3)
    return figure


@styled
def drivers_figure(ensemble: Ensemble) -> Figure:
    """The figure of every outcome's shares of variance by input."""
    outcomes = outcomes_of(ensemble)
    table = [sensitivities(ensemble.inputs, outcome.of(ensemble)) for outcome in outcomes]
    known = [(o, d) for o, d in zip(outcomes, table, strict=True) if np.isfinite(d.explained)]
    if not known:
        return Figure()
    figure = Figure(figsize=(9.0, 0.45 * len(known) + 1.6), layout="constrained")
    ax, left = figure.subplots(), np.zeros(len(known))
    places = np.arange(len(known))
    for key in ensemble.inputs:
        share = np.array([d.share[key] for _, d in known])
        ax.barh(places, share, left=left, label=key)
        left += share
    ax.set_yticks(places, [outcome.label for outcome, _ in known])
    ax.invert_yaxis()
    ax.set_xlabel("share of the variance, by linear regression [-]")
    ax.legend(fontsize=7, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)
    ax.grid(alpha=0.3, axis="x")
    return figure
