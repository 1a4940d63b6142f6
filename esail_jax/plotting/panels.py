"""Panels and how they become a figure.

A panel is drawn on one `ax`. Figures are made without pyplot: no window, no global state.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import hsv_to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from esail_jax.observables.saved_rows import leading_finite
from esail_jax.plotting.data import orbital_period, power_spectrum, spin_period

LEAST_WIDTH = 7.0
"""Of a figure [inch]: room for its title and the legends."""

FREQUENCY_LABEL = r"frequency $f$ [Hz]"


@dataclasses.dataclass(frozen=True)
class Curve:
    """One line of a panel. values: (time); times [s] where they are not those of the run."""

    values: np.ndarray | None
    label: str | None = None
    colour: Any = "tab:blue"
    dashes: str = "-"
    width: float = 1.0
    times: np.ndarray | None = None


@dataclasses.dataclass(frozen=True)
class Panel:
    """What is drawn on one `ax`; panels with the same xlabel share the x axis."""

    xlabel: str
    ylabel: str
    draw: Callable[[Axes], None]


def time_unit(run: Any) -> tuple[float, str]:
    """Seconds per unit of the time axis, and its label: spin periods of a sail, orbits of a chain,
    seconds without either."""
    if run.scene.chain is None:
        period, label = spin_period(run), r"time $t/T_s$ [-]"
    else:
        period, label = orbital_period(run), r"time $t$ [orbits]"
    return (1.0, r"time $t$ [s]") if period is None else (period, label)


def history(run: Any, ylabel: str, *curves: Curve) -> Panel | None:
    """Curves against time; None if none of them has data."""
    shown = [c for c in curves if c.values is not None and np.isfinite(c.values).any()]
    if not shown:
        return None
    unit, xlabel = time_unit(run)

    def draw(ax: Axes) -> None:
        for curve in shown:
            times = run.time if curve.times is None else curve.times
            ax.plot(
                np.asarray(times) / unit,
                curve.values,
                curve.dashes,
                color=curve.colour,
                linewidth=curve.width,
                marker="." if np.isfinite(curve.values).sum() == 1 else "",
                label=curve.label,
            )
        ax.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
        if any(curve.label for curve in shown):
            legend_above(ax, len(shown))

    return Panel(xlabel, ylabel, draw)


def components(run: Any, vectors: np.ndarray | None, symbol: str, unit: str) -> list[Panel | None]:
    """Histories of x, y and z of vectors (time, 3); AXIS in the symbol stands for the letter."""
    if vectors is None:
        return [None] * 3
    return [
        history(run, f"${symbol.replace('AXIS', axis)}$ [{unit}]", Curve(vectors[:, k]))
        for k, axis in enumerate("xyz")
    ]


def spectrum(run: Any, ylabel: str, values: np.ndarray | None) -> Panel | None:
    """Power spectral density of one signal (time), with the spin frequency; None without one."""
    result = None if values is None else power_spectrum(np.asarray(run.time), values)
    if result is None:
        return None
    frequency, density = result
    period = spin_period(run)

    def draw(ax: Axes) -> None:
        ax.loglog(frequency, density, linewidth=1.0, color="tab:blue")
        if period is not None and frequency[0] <= 1.0 / period <= frequency[-1]:
            ax.axvline(1.0 / period, color="black", linestyle="--", linewidth=0.8, label="spin")
            legend_above(ax, 1)

    return Panel(FREQUENCY_LABEL, ylabel, draw)


def legend_above(ax: Axes, columns: int, handles: list[Line2D] | None = None) -> None:
    """Adds a legend above the axes, where it hides no curve. handles: its lines; None: all with a label."""
    ax.legend(
        handles=handles,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns,
        frameon=False,
        borderaxespad=0.1,
        fontsize="small",
        handlelength=1.5,
    )


def tether_colours(count: int) -> np.ndarray:
    """One colour per tether (tether, 3), cyclic as the tethers are and nowhere close to white."""
    hue = np.arange(count) / count
    return hsv_to_rgb(np.stack([hue, np.full(count, 0.9), np.full(count, 0.8)], axis=1))


def unwrapped_degrees(angle: np.ndarray | None) -> np.ndarray | None:
    """Continuous angles [deg] from those [rad] that jump by full turns."""
    if angle is None:
        return None
    known = leading_finite(angle)
    result = np.full(angle.shape, np.nan)
    result[:known] = np.degrees(np.unwrap(angle[:known], axis=0))
    return result


def assemble(title: str, rows: Sequence[Sequence[Panel | None]]) -> Figure:
    """A figure with a grid of panels; all rows have the same length.

    A missing panel leaves its place empty; a row or a column without any panel is left out.
    """
    rows = [row for row in rows if any(row)]
    columns = [column for column in zip(*rows, strict=True) if any(column)]
    figure = Figure(
        figsize=(max(LEAST_WIDTH, 4.2 * len(columns) + 0.8), 1.9 * len(rows) + 1.4),
        layout="constrained",
    )
    figure.suptitle(title)
    for k, column in enumerate(columns):
        add_column(figure, column, k, len(columns))
    figure.align_ylabels()
    return figure


def add_column(figure: Figure, column: Sequence[Panel | None], k: int, columns: int) -> None:
    """Panels under each other. Those of one kind share the x axis, and the lowest has its label."""
    leader, lowest = {}, {panel.xlabel: i for i, panel in enumerate(column) if panel}
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
        ax.tick_params(labelbottom=bottom)
        if bottom:
            ax.set_xlabel(panel.xlabel)
