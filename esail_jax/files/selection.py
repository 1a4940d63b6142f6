"""What `esail export` writes of a run: some of its observables, and some of its instants."""

import re
from typing import NamedTuple

import h5py
import numpy as np

from esail_jax.calendar.instants import EPOCH, in_scale, read_instant, seconds_between
from esail_jax.errors import SceneError, nearest
from esail_jax.files.opening import ArgumentError

SNAP = 1e-9
"""Part of a time by which an instant may miss it: instants are rounded in binary."""

NAMED = re.compile(r"(\w+)(?:\[(\d+(?:,\d+)*)\])?")


class Column(NamedTuple):
    """An observable, or one place of it. place: from 1 along each axis after time; None for all places."""

    name: str
    place: tuple[int, ...] | None


class Selection(NamedTuple):
    """What is written. observables: None for all; first, last: instants [s], or dates of a run with an
    epoch, None for the ends of the run; every: least time [s] between two rows, None for all rows."""

    observables: tuple[Column, ...] | None = None
    first: str | None = None
    last: str | None = None
    every: float | None = None


ALL = Selection()
"""A whole run."""


def columns_of(text: str) -> tuple[Column, ...]:
    """The columns that a text names, such as `coning_angle[2],kinetic_energy`. Raises ArgumentError."""
    columns = []
    for part in re.split(r",(?![^\[]*\])", text):
        found = NAMED.fullmatch(part.strip())
        if found is None:
            must = "be names of observables with commas between them, such as coning_angle[2],voltage"
            raise ArgumentError("--observables", must, f"has {part.strip()!r}")
        place = None if found[2] is None else tuple(map(int, found[2].split(",")))
        columns.append(Column(found[1], place))
    return tuple(columns)


def chosen_columns(file: h5py.File, selection: Selection) -> list[Column]:
    """The columns that are written of an open run file, one for each place. Raises ArgumentError for those
    that the file has not."""
    seen = file["observables"]
    asked = (
        [Column(name, None) for name in seen] if selection.observables is None else selection.observables
    )
    columns = []
    for column in asked:
        if column.name not in seen:
            got = f"has {column.name!r}{nearest(column.name, list(seen))}"
            raise ArgumentError("--observables", "be observables of the run", got)
        shape = seen[column.name].shape[1:]
        places = [tuple(i + 1 for i in place) for place in np.ndindex(shape)]
        if column.place is not None and column.place not in places:
            sizes = " x ".join(map(str, shape))
            must = (
                f"name one of the {sizes} places of {column.name}" if shape else "name no place of a number"
            )
            raise ArgumentError("--observables", must, f"has {list(column.place)}")
        columns += [Column(column.name, x) for x in places if column.place in (None, x)]
    return columns


def chosen_rows(file: h5py.File, selection: Selection) -> np.ndarray:
    """The indices of the rows that are written of an open run file. Raises ArgumentError if there are
    none."""
    time = file["time"][()]
    first = -np.inf if selection.first is None else seconds_of(file, "--from", selection.first)
    last = np.inf if selection.last is None else seconds_of(file, "--to", selection.last)
    margin = SNAP * (1.0 + np.abs(time))
    rows = np.flatnonzero((time >= first - margin) & (time <= last + margin))
    if len(rows) == 0:
        ends = f"from {time[0]:g} to {time[-1]:g} s" if len(time) else "none"
        key = "--from" if selection.first is not None else "--to"
        raise ArgumentError(key, "leave instants of the run", f"there are {ends}")
    if selection.every is None:
        return rows
    kept = [rows[0]]
    for row in rows[1:]:
        if time[row] >= time[kept[-1]] + selection.every - margin[row]:
            kept.append(row)
    return np.array(kept)


def seconds_of(file: h5py.File, option: str, text: str) -> float:
    """The seconds of the run [s] of a number, or of a date of a run with an epoch. Raises ArgumentError."""
    try:
        return float(text)
    except ValueError:
        pass
    if "epoch" not in file.attrs:
        must = "be a number of seconds, or a date of a run with an epoch"
        raise ArgumentError(option, must, f"is {text!r}")
    epoch = read_instant(str(file.attrs["epoch"]), EPOCH)
    try:
        return float(seconds_between(epoch, in_scale(read_instant(text, option), epoch.scale, option)))
    except SceneError as error:
        raise ArgumentError(option, error.must, error.got) from error
