"""The figure of a measured wind: speed and density against time, with the gaps."""

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from esail_jax.plotting.dates import Calendar, show_dates
from esail_jax.plotting.panels import legend_above
from esail_jax.plotting.style import BLUE, RED
from esail_jax.wind_files.in_run import Gap, Joined, gaps_of

PANELS = (
    ("speed", 1e-3, "speed $u$ [km/s]"),
    ("number_density", 1e-6, "protons $n$ [1/cm$^3$]"),
)
"""Columns of a wind, their factors, and the labels of their axes."""


def draw_wind(wind: Joined, title: str) -> Figure:
    """A figure with the rows of a wind, as a run takes them: straight lines between rows, dashed where they
    bridge a gap, which a run does only if it is asked to. Times are dates if the wind has them."""
    kept = np.flatnonzero(wind.good)
    time, gaps = wind.time[kept], gaps_of(wind, kept)
    dates = None if wind.epoch is None else Calendar.at(wind.epoch)
    place = (lambda seconds: seconds) if dates is None else dates.date
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    axes = figure.subplots(len(PANELS), sharex=True)
    for ax, (name, factor, label) in zip(axes, PANELS, strict=True):
        column = factor * wind.column(name)[kept]
        if gaps:
            ax.plot(place(time), column, "--", color=RED, linewidth=0.8, label="gap")
        times, numbers = with_breaks(time, column, gaps)
        ax.plot(place(times), numbers, color=BLUE, linewidth=0.9)
        ax.set_ylabel(label)
        ax.set_ylim(bottom=0.0)
        ax.grid(alpha=0.3)
    if gaps:
        legend_above(axes[0], 1)
    axes[-1].set_xlabel("time $t$ [s]")
    if dates is not None:
        show_dates(axes[-1], dates.native)
    figure.suptitle(title, fontsize="medium")
    figure.align_ylabels()
    return figure


def with_breaks(
    time: Float[np.ndarray, " row"], column: Float[np.ndarray, " row"], gaps: list[Gap]
) -> tuple[Float[np.ndarray, " point"], Float[np.ndarray, " point"]]:
    """Times and numbers with a NaN in every gap, where a line breaks."""
    places = np.searchsorted(time, [0.5 * (gap.first + gap.last) for gap in gaps])
    return np.insert(time, places, np.nan), np.insert(column, places, np.nan)
