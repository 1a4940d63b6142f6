"""Panels, the parts of a figure, and their assembly.

A panel is drawn on one `ax`. Figures are made without pyplot, hence without windows and global state.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from esail_jax.observables.saved_rows import leading_finite
from esail_jax.plotting.data import Mark, orbital_period, power_spectrum, release_marks, spin_period
from esail_jax.plotting.modal_lines import ModalLine, draw_modal_lines
from esail_jax.plotting.style import BLUE

LEAST_WIDTH = 7.0
"""Smallest width of a figure [inch], for its title and legends."""

NAMES_SIZE = 6.0
"""Size of the names of modes in a legend [point]."""

FREQUENCY_LABEL = r"frequency $f$ [Hz]"


@dataclasses.dataclass(frozen=True)
class Curve:
    """One line of a panel. values: (time); times: their instants [s], None for those of the panel's run."""

    values: np.ndarray | None
    label: str | None = None
    colour: Any = BLUE
    dashes: str = "-"
    width: float = 1.0
    times: np.ndarray | None = None


@dataclasses.dataclass(frozen=True)
class Panel:
    """Contents of one `ax`. Panels with the same xlabel share their x axis."""

    xlabel: str
    ylabel: str
    draw: Callable[[Axes], None]


def time_unit(run: Any) -> tuple[float, str]:
    """The unit of the time axis [s] and the axis label: spin periods of a sail, orbits of a chain,
    or seconds without spin or orbit."""
    if run.scene.chain is None:
        period, label = spin_period(run), r"time $t/T_s$ [-]"
    else:
        period, label = orbital_period(run), r"time $t$ [orbits]"
    return (1.0, r"time $t$ [s]") if period is None else (period, label)


def history(run: Any, ylabel: str, *curves: Curve) -> Panel | None:
    """A panel with curves of one run against time, and the instants at which tethers are released;
    None if no curve has data."""
    own = [dataclasses.replace(c, times=run.time) if c.times is None else c for c in curves]
    return against_time(*time_unit(run), ylabel, own, marks=release_marks(run))


def against_time(
    unit: float,
    xlabel: str,
    ylabel: str,
    curves: Sequence[Curve],
    logarithmic: bool = False,
    marks: Sequence[Mark] = (),
) -> Panel | None:
    """A panel with curves, each with its own instants, against time; None if no curve has data.

    unit: unit of the time axis [s]; logarithmic: whether the other axis is; marks: instants that
    thin vertical lines mark."""
    shown = [c for c in curves if c.values is not None and np.isfinite(c.values).any()]
    if not shown:
        return None

    def draw(ax: Axes) -> None:
        for curve in shown:
            ax.plot(
                np.asarray(curve.times) / unit,
                curve.values,
                curve.dashes,
                color=curve.colour,
                linewidth=curve.width,
                marker="." if np.isfinite(curve.values).sum() == 1 else "",
                label=curve.label,
            )
        draw_marks(ax, marks, unit)
        if logarithmic:
            ax.set_yscale("log")
        else:
            ax.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
        labels = [x.label for x in shown if x.label] + [x.label for x in marks if x.label]
        if labels:
            legend_above(ax, len(labels))

    return Panel(xlabel, ylabel, draw)


def draw_marks(ax: Axes, marks: Sequence[Mark], unit: float) -> None:
    """Draws a thin vertical line at every marked instant. unit: unit of the time axis [s]."""
    for mark in marks:
        ax.axvline(mark.time / unit, color=mark.colour, linewidth=0.6, label=mark.label)


def components(run: Any, vectors: np.ndarray | None, symbol: str, unit: str) -> list[Panel | None]:
    """One panel per component of vectors (time, 3). AXIS in the symbol stands for x, y or z."""
    if vectors is None:
        return [None] * 3
    return [
        history(run, f"${symbol.replace('AXIS', axis)}$ [{unit}]", Curve(vectors[:, k]))
        for k, axis in enumerate("xyz")
    ]


def spectrum(
    run: Any, ylabel: str, values: np.ndarray | None, lines: Sequence[ModalLine] = ()
) -> Panel | None:
    """A panel with the power spectral density of a signal (time), the spin frequency and the modes
    of the sail; None if the spectrum does not exist."""
    result = None if values is None else power_spectrum(np.asarray(run.time), values)
    if result is None:
        return None
    frequency, density = result
    period = spin_period(run)

    def draw(ax: Axes) -> None:
        ax.loglog(frequency, density, linewidth=1.0, color=BLUE)
        if np.floor(np.log10(frequency[0])) < np.floor(np.log10(frequency[-1])):
            # A power of ten has a label. Those of the numbers between would cover each other.
            ax.xaxis.set_minor_formatter(NullFormatter())
        if period is not None and frequency[0] <= 1.0 / period <= frequency[-1]:
            ax.axvline(1.0 / period, color="black", linestyle="--", linewidth=0.8, label="spin")
        draw_modal_lines(ax, lines, frequency[0], frequency[-1])
        entries = len(ax.get_legend_handles_labels()[1])
        if entries:
            legend_above(ax, min(2, entries), fontsize="small" if entries == 1 else NAMES_SIZE)

    return Panel(FREQUENCY_LABEL, ylabel, draw)


def legend_above(
    ax: Axes, columns: int, handles: list[Line2D] | None = None, fontsize: str | float = "small"
) -> None:
    """Adds a legend above the axes, where it hides no curve. handles: its lines; None: all with a label."""
    ax.legend(
        handles=handles,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns,
        frameon=False,
        borderaxespad=0.1,
        fontsize=fontsize,
        handlelength=1.5,
    )


def tether_colours(count: int) -> np.ndarray:
    """One colour per tether (tether, 3): cyclic, as the tethers are, and not close to white. The
    scale, dark to light and back through blue and red, is one that colour-blind readers can tell apart."""
    return 0.9 * colormaps["twilight_shifted"](np.arange(count) / count)[:, :3]


def unwrapped_degrees(angle: np.ndarray | None) -> np.ndarray | None:
    """Continuous angles [deg] from angles [rad] with jumps by full turns."""
    if angle is None:
        return None
    known = leading_finite(angle)
    result = np.full(angle.shape, np.nan)
    result[:known] = np.degrees(np.unwrap(angle[:known], axis=0))
    return result


def assemble(title: str, rows: Sequence[Sequence[Panel | None]], symbols: str = "") -> Figure:
    """A figure with a grid of panels. All rows must have the same length.

    symbols: second line of the title, which explains the symbols of the labels. A missing panel leaves its
    place empty; rows and columns without any panel are left out.
    """
    rows = [row for row in rows if any(row)]
    columns = [column for column in zip(*rows, strict=True) if any(column)]
    figure = Figure(
        figsize=(max(LEAST_WIDTH, 4.2 * len(columns) + 0.8), 1.9 * len(rows) + 1.4),
        layout="constrained",
    )
    figure.suptitle(f"{title}\n{symbols}" if symbols else title, fontsize="medium" if symbols else None)
    for k, column in enumerate(columns):
        add_column(figure, column, k, len(columns))
    figure.align_ylabels()
    return figure


def add_column(figure: Figure, column: Sequence[Panel | None], k: int, columns: int) -> None:
    """Adds one column of panels. Panels with the same xlabel share the x axis, which the lowest one
    labels."""
    leader: dict[str, Any] = {}
    lowest = {panel.xlabel: i for i, panel in enumerate(column) if panel}
    for i, panel in enumerate(column):
        if panel is None:
            continue
        place = i * columns + k + 1
        ax = figure.add_subplot(len(column), columns, place, sharex=leader.get(panel.xlabel))
        leader.setdefault(panel.xlabel, ax)
        panel.draw(ax)
        ax.set_ylabel(panel.ylabel)
        ax.grid(alpha=0.3)
        bottom = lowest[panel.xlabel] == i
        ax.tick_params(axis="x", which="both", labelbottom=bottom)
        if bottom:
            ax.set_xlabel(panel.xlabel)
