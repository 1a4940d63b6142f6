"""What is exported of a run or an ensemble: some of its observables, and some of its instants."""

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from esail_jax.calendar.instants import EPOCH, in_scale, read_instant, seconds_between
from esail_jax.errors import SceneError, nearest
from esail_jax.files.opening import ArgumentError
from esail_jax.files.reading import Results

SNAP = 1e-9
"""Part of a time by which an instant may miss it: instants are rounded in binary."""

NAMED = re.compile(r"(\w+(?:\.\w+)?)(?:\[(\d+(?:,\d+)*)\])?")


class Column(NamedTuple):
    """An observable, or one place of it. place: from 1 along each axis after time; None for all places."""

    name: str
    place: tuple[int, ...] | None


class Selection(NamedTuple):
    """What is written. observables: None for all; first, last: instants [s], or dates of a run with an
    epoch, None for the ends of the run; every: least time [s] between two rows, None for all rows."""

    observables: tuple[Column, ...] | None = None
    first: float | str | np.datetime64 | None = None
    last: float | str | np.datetime64 | None = None
    every: float | None = None


ALL = Selection()
"""A whole run."""


def columns_of(names: str | Sequence[str]) -> tuple[Column, ...]:
    """The columns that a text such as `coning_angle[2],kinetic_energy` names, or several such texts. Raises
    ArgumentError."""
    columns = []
    for text in [names] if isinstance(names, str) else names:
        for part in re.split(r",(?![^\[]*\])", text):
            found = NAMED.fullmatch(part.strip())
            if found is None:
                must = "be names of observables with commas between them, such as coning_angle[2],voltage"
                raise ArgumentError("observables", must, f"has {part.strip()!r}")
            place = None if found[2] is None else tuple(map(int, found[2].split(",")))
            columns.append(Column(found[1], place))
    return tuple(columns)


def chosen_columns(results: Results, selection: Selection) -> list[Column]:
    """The columns that are written, one for each place of an observable. Raises ArgumentError for those
    that the results have not."""
    seen, asked = results.observables, selection.observables
    first = 1 if results.members is None else 2
    columns = []
    for column in [Column(name, None) for name in seen] if asked is None else asked:
        if column.name not in seen:
            got = f"has {column.name!r}{nearest(column.name, list(seen))}"
            kind = "run" if results.members is None else "ensemble"
            raise ArgumentError("observables", f"be observables of the {kind}", got)
        shape = seen[column.name].shape[first:]
        places = [tuple(i + 1 for i in place) for place in np.ndindex(shape)]
        if column.place is not None and column.place not in places:
            sizes = " x ".join(map(str, shape))
            must = (
                f"name one of the {sizes} places of {column.name}" if shape else "name no place of a number"
            )
            raise ArgumentError("observables", must, f"has {list(column.place)}")
        columns += [Column(column.name, x) for x in places if column.place in (None, x)]
    return columns


def chosen_rows(results: Results, selection: Selection) -> np.ndarray:
    """The indices of the rows that are written. Raises ArgumentError if there are none."""
    time, every = results.time, selection.every
    if every is not None and not 0.0 < every < np.inf:
        raise ArgumentError("every", "be positive", f"is {every:g}")
    first = -np.inf if selection.first is None else seconds_of(results, "first", selection.first)
    last = np.inf if selection.last is None else seconds_of(results, "last", selection.last)
    if first > last:
        got = f"they are {first:g} and {last:g} s"
        raise ArgumentError("first", "not be later than the last instant that is asked for", got)
    margin = SNAP * (1.0 + np.abs(time))
    rows = np.flatnonzero((time >= first - margin) & (time <= last + margin))
    if len(rows) == 0:
        ends = f"from {time[0]:g} to {time[-1]:g} s" if len(time) else "none"
        key = "first" if selection.first is not None else "last"
        raise ArgumentError(key, "leave instants of the run", f"there are {ends}")
    if every is None:
        return rows
    kept = [rows[0]]
    for row in rows[1:]:
        if time[row] >= time[kept[-1]] + every - margin[row]:
            kept.append(row)
    return np.array(kept)


def seconds_of(results: Results, key: str, instant: float | str | np.datetime64) -> float:
    """The seconds of the run [s] of a number, or of a date of a run with an epoch. key: the argument that
    errors name. Raises ArgumentError."""
    try:
        number = float(str(instant))  # a `datetime64` may be a number, too: of nanoseconds
    except ValueError:
        pass
    else:
        if math.isnan(number):
            raise ArgumentError(key, "be a number of seconds, or a date", "is nan")
        return number
    if results.scene.initial.epoch is None:
        must = "be a number of seconds, or a date of a run with an epoch"
        raise ArgumentError(key, must, f"is {instant!r}")
    epoch = read_instant(results.epoch, EPOCH)
    try:
        return float(seconds_between(epoch, in_scale(read_instant(str(instant), key), epoch.scale, key)))
    except SceneError as error:
        raise ArgumentError(key, error.must, error.got) from error
