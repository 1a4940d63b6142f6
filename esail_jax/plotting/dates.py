"""Dates in place of the time of a run on the axes of figures. They know no leap seconds.

In the figures of a whole run everything stays where it is, in seconds, minutes, spin periods or orbits:
only the ticks are placed at round dates, and say them. One observable is drawn at its dates."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num, num2date
from matplotlib.figure import Figure
from matplotlib.ticker import Formatter, Locator

from esail_jax.calendar.instants import DAY, Instants, without_leap_seconds, written
from esail_jax.files.opening import ArgumentError

MOST_TICKS = 8
"""Most ticks of an axis, whose labels shall not touch each other."""

LEAST_TICKS = 3
"""Ticks that a unit must have to be the one of the ticks. With more, matplotlib finds no step for axes of
3.5 to 5 minutes, hours, days or years, and warns: 3.5 minutes are 7 steps of 30 s, the longest it knows."""


class Calendar(NamedTuple):
    """The dates of an axis, in numbers of matplotlib [days]. start: the date of its zero; days: the unit of
    the axis [days]; scale: of the dates."""

    start: float
    days: float
    scale: str

    @classmethod
    def at(cls, zero: Instants, unit: float = 1.0) -> "Calendar":
        """That of an axis with this zero. unit: that of the axis [s]."""
        return cls(float(date2num(np.datetime64(written(zero, 6)[0]))), unit / DAY, zero.scale)

    @classmethod
    def of(cls, epoch: str, unit: float = 1.0) -> "Calendar":
        """That of a run. epoch: the date of t = 0; unit: that of the axis [s]."""
        return cls.at(without_leap_seconds(epoch), unit)

    def date(self, x: Any) -> Any:
        """The date of a place on the axis."""
        return self.start + self.days * np.asarray(x)

    def place(self, date: Any) -> Any:
        """The place on the axis of a date."""
        return (np.asarray(date) - self.start) / self.days

    @property
    def native(self) -> "Calendar":
        """That of an axis on which everything is drawn at its date, as matplotlib itself does: other data
        with dates may be drawn beside it."""
        return Calendar(0.0, 1.0, self.scale)


class Ticks(Locator):
    """Ticks of an axis at round dates."""

    def __init__(self, calendar: Calendar):
        self.calendar = calendar

    def __call__(self) -> Any:
        return self.tick_values(*self.axis.get_view_interval())

    def tick_values(self, vmin: float, vmax: float) -> Any:
        ends = [num2date(float(self.calendar.date(x))) for x in sorted((vmin, vmax))]
        locator = AutoDateLocator(minticks=LEAST_TICKS, maxticks=MOST_TICKS)
        return self.calendar.place(locator.tick_values(*ends))


class Labels(Formatter):
    """Labels of an axis: dates as short as they can be, with the rest of the date at its end."""

    def __init__(self, calendar: Calendar):
        self.calendar = calendar
        self.dates = ConciseDateFormatter(AutoDateLocator(maxticks=MOST_TICKS))

    def __call__(self, x: float, pos: int | None = None) -> str:
        return str(self.dates(float(self.calendar.date(x)), pos))

    def format_ticks(self, values: Any) -> list[str]:
        return list(self.dates.format_ticks(list(self.calendar.date(values))))

    def get_offset(self) -> str:
        return str(self.dates.get_offset())


def show_dates(ax: Axes, calendar: Calendar) -> None:
    """Lets the axis of time of an `ax`, and of those that share it, show dates."""
    ax.xaxis.set_major_locator(Ticks(calendar))
    ax.xaxis.set_major_formatter(Labels(calendar))
    ax.set_xlabel(f"date [{calendar.scale}]")


def dated_figures(
    figures: Iterable[tuple[str, Figure]], epoch: str, unit: float, label: str
) -> Iterator[tuple[str, Figure]]:
    """The figures, with dates on every axis that has this label. unit: that of these axes [s]."""
    calendar = Calendar.of(epoch, unit)
    for name, figure in figures:
        for ax in figure.axes:
            if ax.get_xlabel() == label:
                show_dates(ax, calendar)
        yield name, figure


def epoch_of(scenes: Iterable[Any]) -> str:
    """The date of t = 0 of scenes. Raises ArgumentError if they have none, or not the same."""
    epochs = {scene.initial.epoch for scene in scenes}
    if None in epochs:
        raise ArgumentError("calendar", "be left out for a run without `initial.epoch`", "is given")
    if len(epochs) > 1:
        raise ArgumentError("calendar", "be left out for runs with several epochs", "is given")
    return str(epochs.pop())
