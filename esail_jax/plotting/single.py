"""One observable of a run on one `ax`, labelled from the list of observables."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps, pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from esail_jax.observables import described, hint_at, known_names
from esail_jax.observables.entry import Observable
from esail_jax.plotting.data import release_marks
from esail_jax.plotting.dates import Calendar, epoch_of, show_dates
from esail_jax.plotting.panels import draw_marks, legend_above, tether_colours, time_unit
from esail_jax.plotting.style import BLUE, ORANGE, RED

MOST_NAMED = 12
"""Largest number of tethers, rods or joints that the legend names one by one."""

DASHES = ("-", "--", ":")
"""Line styles of the components of a vector that every tether or joint has."""

COMPONENT_COLOURS = (BLUE, ORANGE, RED)

GREEK = "alpha beta gamma delta theta lambda phi psi omega Gamma Theta Phi Psi".split()
"""Greek letters that occur in symbols by name."""


def entry_of(run: Any, name: str) -> Observable:
    """The entry of an observable in the list for this kind of run.

    Raises ValueError for a name that the run does not have."""
    of_chain = run.scene.chain is not None
    known = {name: described(name, of_chain) for name in known_names(of_chain) if name in run.observables}
    if name not in known:
        hint = hint_at(name, known, of_chain)
        names = "" if hint else f" ({', '.join(known)})"
        raise ValueError(f"`name` must be an observable of the run{names}, but is {name!r}{hint}")
    return known[name]


def mathtext(symbol: str) -> str:
    """A symbol of the list for matplotlib's typesetting, with Greek letters and whole indices."""
    text = re.sub(r"([_^])([A-Za-z0-9]+(?:,[A-Za-z0-9]+)*)", r"\1{\2}", symbol)
    text = re.sub(r"\beps(?![a-z])", r"\\epsilon", text)
    for letter in GREEK:
        text = re.sub(rf"(?<![A-Za-z\\]){letter}(?![a-z])", rf"\\{letter}", text)
    return f"${text}$"


def draw_together(run: Any, names: Sequence[str], calendar: bool = False) -> Figure:
    """A figure with one panel for every observable, one above the other, which share the time axis. Raises
    ValueError for a name that the run does not have."""
    figure = Figure(figsize=(8.0, 1.0 + 2.2 * len(names)), layout="constrained")
    axes = figure.subplots(len(names), sharex=True, squeeze=False)[:, 0]
    for ax, name in zip(axes, names, strict=True):
        draw_observable(run, name, ax, calendar)
        ax.label_outer()
    figure.align_ylabels()
    return figure


def draw_observable(run: Any, name: str, ax: Axes | None = None, calendar: bool = False) -> Axes:
    """Draws an observable (time, ...) against time into `ax`, or into a new pyplot figure if None.
    calendar: whether the time is a date; the dates of an axis know no leap seconds.

    Colours stand for the first axis after time, line styles for the second. Raises ValueError for a name
    that the run does not have or that has more axes, and for dates of a run without an epoch."""
    entry = entry_of(run, name)
    if len(entry.axes) > 2:
        got = f"{name} has {len(entry.axes)} ({', '.join(entry.axes)})"
        raise ValueError(f"`name` must be an observable with at most two axes after time, but {got}")
    if ax is None:
        _, ax = pyplot.subplots(layout="constrained")
    values = np.asarray(run[name])
    dates = Calendar.of(epoch_of([run.scene])) if calendar else None
    unit, xlabel = time_unit(run)

    def place(seconds: Any) -> Any:
        return np.asarray(seconds) / unit if dates is None else dates.date(seconds)

    times = place(run.time)
    marker = "." if len(times) == 1 else ""
    first, second = (*values.shape[1:], 1, 1)[:2]
    curves = values.reshape(len(times), first, second)
    colours = colours_of(entry.axes, first)
    for k in range(first):
        for j in range(second):
            ax.plot(times, curves[:, k, j], DASHES[j], color=colours[k], linewidth=1.0, marker=marker)
    marks = release_marks(run)
    draw_marks(ax, [mark._replace(time=place(mark.time)) for mark in marks], 1.0)
    ax.set_xlabel(xlabel)
    if dates is not None:
        show_dates(ax, dates.native)
    ax.set_ylabel(label_of(entry))
    ax.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
    ax.grid(alpha=0.3)
    handles = legend_of(entry, first, colours)
    handles += [Line2D([], [], color=x.colour, linewidth=0.6, label=x.label) for x in marks if x.label]
    if handles:
        legend_above(ax, min(4, len(handles)), handles=handles)
    return ax


def label_of(entry: Observable) -> str:
    """The name of an observable in words, its symbol and its unit, for an axis."""
    words = re.sub(r"_([A-Z])$", r"_in_\1", entry.name).replace("_", " ")  # thrust_O: components in O
    return f"{words}, {mathtext(entry.symbol)} [{entry.unit}]"


def colours_of(axes: tuple[str, ...], count: int) -> Sequence[Any]:
    """One colour per entry of the first axis after time."""
    if not axes or axes[0] not in ("tether", "rod", "joint"):
        return COMPONENT_COLOURS
    if axes[0] == "tether":
        return list(tether_colours(count))
    return list(colormaps["viridis"](np.linspace(0.0, 0.92, count)))


def legend_of(entry: Observable, count: int, colours: Sequence[Any]) -> list[Line2D]:
    """Lines for the legend: colours for the first axis, styles for the second."""
    handles = []
    if entry.axes and 1 < count <= MOST_NAMED:
        names = labels_of(entry, entry.axes[0], count)
        handles = [Line2D([], [], color=colours[k], label=name) for k, name in enumerate(names)]
    if len(entry.axes) > 1:
        names = labels_of(entry, entry.axes[1], len(DASHES))
        styles = zip(DASHES, names, strict=True)
        handles += [Line2D([], [], color="black", linestyle=dash, label=name) for dash, name in styles]
    return handles


def labels_of(entry: Observable, axis: str, count: int) -> list[str]:
    """The names of an axis' entries: x, y and z, angles by their symbols, others by number."""
    if axis == "xyz":
        return list("xyz")
    if axis == "angle":
        return [mathtext(symbol) for symbol in entry.symbol.split(", ")]
    return [f"{axis} {k + 1}" for k in range(count)]
