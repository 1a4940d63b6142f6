"""The table of a wind that a run needs: the rows of all files in one order of time, without gaps.

A gap is what lies between two rows with both numbers if rows without a number, or missing lines of a file
with a fixed cadence, stand between them. Its length is the time between these two rows, over which the
wind would change along a straight line: one missing hour is a gap of two hours."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from esail_jax.calendar.instants import EPOCH, Instants, after, in_scale, written
from esail_jax.errors import SceneError
from esail_jax.wind_files.rows import LARGEST_GAP, WIND_FILE, Rows, seconds_since

LATE = 1.5
"""Cadences after which a line is missing."""


class Gap(NamedTuple):
    """A gap. first, last: the instants [s] of its first and last row, which have no numbers; length: the
    time [s] between the rows before and behind; why: what is there, in words."""

    first: float
    last: float
    length: float
    why: str


class Joined(NamedTuple):
    """The rows of several files in the order of their times.

    parts: rows by file, in this order; time: [s]; part: the file of a row, and row: which of its rows it
    is; good: whether it has both numbers; epoch: of t = 0, None if no file has dates."""

    parts: tuple[Rows, ...]
    time: Float[np.ndarray, " row"]
    part: Int[np.ndarray, " row"]
    row: Int[np.ndarray, " row"]
    good: Bool[np.ndarray, " row"]
    epoch: Instants | None

    def column(self, name: str) -> Float[np.ndarray, " row"]:
        """The numbers of all rows, speed or number_density."""
        return np.concatenate([getattr(part, name) for part in self.parts])

    def rows(self, index: int) -> tuple[Rows, int]:
        """The file of a row, and which of its rows it is."""
        return self.parts[self.part[index]], int(self.row[index])

    def at(self, time: float) -> str:
        """An instant in words: its date in UTC, or the seconds of the run."""
        return f"{time:.12g} s" if self.epoch is None else date_of(self.epoch, time)

    @property
    def dated(self) -> bool:
        """Whether a file has times of the calendar."""
        return any(isinstance(part.time, Instants) for part in self.parts)


def date_of(epoch: Instants, time: float) -> str:
    """The date, in UTC and to the second, of an instant [s] after an epoch."""
    (text,) = written(in_scale(after(epoch, np.array([time])), "UTC"), 0)
    return text


def joined(parts: Sequence[Rows], epoch: Instants | None) -> Joined:
    """The rows of all files. epoch: the date of t = 0, if it is known.

    Raises SceneError for dates without an epoch, and for files whose times overlap."""
    times = [seconds_of(part, epoch) for part in parts]
    order = sorted(range(len(parts)), key=lambda i: float(times[i][0]))
    parts, times = tuple(parts[i] for i in order), [times[i] for i in order]
    good = [np.isfinite(part.speed) & np.isfinite(part.number_density) for part in parts]
    number = np.repeat(np.arange(len(parts)), [len(time) for time in times])
    row = np.concatenate([np.arange(len(time)) for time in times])
    found = Joined(parts, np.concatenate(times), number, row, np.concatenate(good), epoch)
    for first, second, end, start in zip(parts, parts[1:], times, times[1:], strict=False):
        if start[0] <= end[-1]:
            got = f"{first.source} reaches to {found.at(end[-1])} and {second.source} begins at "
            raise SceneError(WIND_FILE, "name files whose times do not overlap", got + found.at(start[0]))
    return found


def seconds_of(rows: Rows, epoch: Instants | None) -> Float[np.ndarray, " row"]:
    """The times of rows as seconds of the run [s]. Raises SceneError for dates without an epoch."""
    if not isinstance(rows.time, Instants):
        return rows.time
    if epoch is None:
        raise SceneError(EPOCH, "be given with a wind file of calendar times", "is missing")
    return seconds_since(epoch, rows.time)


def gaps_of(wind: Joined, kept: Int[np.ndarray, " kept"]) -> list[Gap]:
    """The gaps between rows with both numbers, in order. kept: these rows, by their index among all."""
    cadences = np.array([np.nan if part.cadence is None else part.cadence for part in wind.parts])
    cadence = cadences[wind.part[kept]]
    step = np.fmax(cadence[:-1], cadence[1:])
    length = np.diff(wind.time[kept])
    gaps = []
    for i in np.flatnonzero((np.diff(kept) > 1) | (length > LATE * step)).tolist():
        before, behind = int(kept[i]), int(kept[i + 1])
        # Next to a file without a cadence the first or last row, or an end of the gap.
        inside = wind.time[before + 1 : behind] if behind > before + 1 else wind.time[[before, behind]]
        first = wind.time[before] + cadence[i] if np.isfinite(cadence[i]) else inside[0]
        last = wind.time[behind] - cadence[i + 1] if np.isfinite(cadence[i + 1]) else inside[-1]
        gaps.append(Gap(float(first), float(last), float(length[i]), reason(wind, before, behind)))
    return gaps


def reason(wind: Joined, before: int, behind: int) -> str:
    """What is between two rows of a wind, in words."""
    if behind > before + 1:
        part, row = wind.rows(before + 1)
        return f"{part.where(row)}: {part.missing[row]}"
    part, row = wind.rows(before)
    return f"nothing after {part.where(row)}"


def table_of_run(
    parts: Sequence[Rows],
    epoch: Instants | None = None,
    end: float | None = None,
    largest_gap: float | None = None,
    key: str = LARGEST_GAP,
) -> dict[str, Float[np.ndarray, " row"]]:
    """The columns `time` [s], `speed` [m/s] and `number_density` [1/m^3] of the rows with both numbers.

    Of files with dates, and of rows some of which lack a number, those are kept that the run needs: from
    the last one at or before t = 0 to the first one at or behind its end. epoch: the date of t = 0; end:
    that of the run [s], None for all rows; largest_gap: of those that are bridged [s], None for none;
    key: what it is called in a message.

    Raises SceneError for dates without an epoch, for files whose times overlap, for files with dates that
    do not reach over the run, and for a gap that is too long."""
    wind = joined(parts, epoch)
    kept = np.flatnonzero(wind.good)
    if end is not None and (wind.dated or not wind.good.all()):
        kept = within(wind, kept, end)
    for gap in gaps_of(wind, kept):
        if largest_gap is None or gap.length > largest_gap:
            must = f"be at least {gap.length:.12g} (s) to bridge the gap from {wind.at(gap.first)} to "
            got = "is missing" if largest_gap is None else f"is {largest_gap:.12g}"
            raise SceneError(key, f"{must}{wind.at(gap.last)} ({gap.why})", got)
    columns = {name: wind.column(name)[kept] for name in ("speed", "number_density")}
    return {"time": wind.time[kept], **columns}


def within(wind: Joined, kept: Int[np.ndarray, " row"], end: float) -> Int[np.ndarray, " kept"]:
    """Those of the rows with both numbers that a run from 0 to its end [s] needs. Raises SceneError if they
    do not reach over it."""
    time = wind.time[kept]
    if len(time) == 0 or time[0] > 0.0 or time[-1] < end:
        must = f"have numbers from {wind.at(0.0)} (t = 0) to {wind.at(end)} (`integrator.t_end`)"
        got = f"has them from {wind.at(time[0])} to {wind.at(time[-1])}" if len(time) else "has none"
        raise SceneError(WIND_FILE, must, got)
    first = int(np.searchsorted(time, 0.0, side="right")) - 1
    return kept[first : int(np.searchsorted(time, end, side="left")) + 1]
