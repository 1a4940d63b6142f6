"""Measured observables: telemetry of one run, as a table with the columns of `esail export`.

    time [s],spin_rate[1] [rad/s],coning_angle[2] [rad]
    0.0,0.004,0.001
    60.0,,0.0012

An empty cell is missing, and so is `nan`. Rows may stand at any instants of the run.
"""

import csv
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from esail_jax.array_types import Float
from esail_jax.calendar.instants import EPOCH, in_scale, read_instant, seconds_between
from esail_jax.errors import nearest
from esail_jax.files.selection import Column
from esail_jax.observables import described
from esail_jax.scenes.rules import SceneError, numbers_of
from esail_jax.scenes.scene import Scene

DATA, NOISE = "data", "noise"
"""The arguments with measurements and their noise, in messages."""

HEADER = re.compile(r"(?P<name>\w+)(?:\[(?P<place>\d+(?:,\d+)*)\])?(?: ?\[(?P<unit>[^\]]*)\])?")

TIME, DATE = "time", "date"


class Telemetry(NamedTuple):
    """Measurements of one run. name: what messages call them; time: [s], (row); columns: the observable and
    the place of each column; values: (row, column), NaN where nothing was measured."""

    name: str
    time: Float[np.ndarray, " row"]
    columns: tuple[Column, ...]
    values: Float[np.ndarray, "row column"]

    @property
    def names(self) -> tuple[str, ...]:
        """The observables that are measured."""
        return tuple(dict.fromkeys(column.name for column in self.columns))


def telemetry_of(
    data: Any, scene: Scene, shapes: Mapping[str, tuple[int, ...]], name: str = DATA
) -> Telemetry:
    """Measurements in the form of a path of a CSV file, of a table such as a DataFrame of pandas or a
    mapping of headers to columns, or of a mapping of observables to arrays (row, ...) with `time`.

    scene: of the run, whose observables have these shapes. Raises SceneError, with one line that names the
    column or the line of what is wrong."""
    if isinstance(data, str | os.PathLike):
        name, columns = repr(str(data)), columns_of_file(Path(data))
    elif hasattr(data, "keys"):
        columns = {str(key): data[key] for key in data.keys()}
    else:
        must = "be a path, a DataFrame or a mapping of arrays"
        raise SceneError(DATA, must, f"is of type {type(data).__name__}")
    time, dates, found = None, None, dict[Column, Any]()
    for header, cells in columns.items():
        parts = HEADER.fullmatch(header.strip())
        if parts is None:
            raise SceneError(DATA, "have columns such as coning_angle[1] [rad]", f"{name} has {header!r}")
        if parts["name"] == TIME:
            time = seconds_of(cells, header, parts["unit"], name)
            continue
        if parts["name"] == DATE:
            dates = cells, parts["unit"] or "UTC"
            continue
        column = Column(parts["name"], placed(parts["place"]))
        check_column(column, parts["unit"], header, shapes, name)
        for one, numbers in spread(column, cells, header, shapes, name):
            if one in found:
                raise SceneError(DATA, "have every column once", f"{name} has {header!r} twice")
            found[one] = numbers
    if time is None and dates is not None:
        time = seconds_of_dates(*dates, scene)
    if time is None or not found:
        lacks = "no column time [s]" if time is None else "no column with an observable"
        raise SceneError(DATA, "have times and measurements", f"{name} has {lacks}")
    check_times(time, scene, name)
    for one, numbers in found.items():
        if len(numbers) != len(time):
            got = f"{one.name} of {name} has {len(numbers)}"
            raise SceneError(DATA, f"have {len(time)} rows in every column", got)
    values = np.stack(list(found.values()), axis=1)
    if not np.isfinite(values).any():
        raise SceneError(DATA, "have numbers", f"all cells of {name} are empty")
    return Telemetry(name, time, tuple(found), values)


def columns_of_file(path: Path) -> dict[str, Any]:
    """The columns of a CSV file by their headers: numbers, NaN in empty cells, or texts of dates. Raises
    SceneError."""
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            rows = [(k, row) for k, row in enumerate(csv.reader(file), 1) if any(x.strip() for x in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "is no text of comma-separated values"
        raise SceneError(DATA, "be a CSV file", f"{str(path)!r} cannot be read: {reason}") from None
    if len(rows) < 2:
        raise SceneError(
            DATA, "be a CSV file with a header and rows", f"{str(path)!r} has {len(rows)} lines"
        )
    (_, header), *body = rows
    if len(set(header)) < len(header):
        double = next(x for x in header if header.count(x) > 1)
        raise SceneError(DATA, "have every column once", f"{str(path)!r} has {double!r} twice")
    for line, row in body:
        if len(row) != len(header):
            got = f"line {line} of {str(path)!r} has {len(row)}"
            raise SceneError(DATA, f"have {len(header)} cells in every line", got)
    columns: dict[str, Any] = {}
    for k, name in enumerate(header):
        if name.strip().startswith(DATE):
            columns[name] = [row[k].strip() for _, row in body]
        else:
            columns[name] = np.array([number(row[k], name, line, path) for line, row in body])
    return columns


def number(cell: str, header: str, line: int, path: Path) -> float:
    """The number in a cell, NaN if it is empty. Raises SceneError for other texts."""
    text = cell.strip()
    try:
        return float(text) if text else float("nan")
    except ValueError:
        got = f"line {line} of {str(path)!r} has {text!r} in the column {header!r}"
        raise SceneError(DATA, "have numbers or empty cells", got) from None


def seconds_of(cells: Any, header: str, unit: str | None, name: str) -> Float[np.ndarray, " row"]:
    """The seconds of the run [s] of a column of times. Raises SceneError."""
    if unit not in (None, "s"):
        raise SceneError(DATA, "have times in seconds", f"{name} has the column {header!r}")
    numbers = numbers_of(header, cells)
    if numbers is None or numbers.ndim != 1 or not np.isfinite(numbers).all():
        raise SceneError(DATA, "have a finite time in every row", f"{name} has others")
    return numbers


def seconds_of_dates(dates: Any, scale: str, scene: Scene) -> Float[np.ndarray, " row"]:
    """The seconds of the run [s] of a column of dates in a time scale. Raises SceneError."""
    epoch = scene.initial.epoch
    if epoch is None:
        raise SceneError(EPOCH, "be given with dates in the data", "is missing")
    zero = read_instant(epoch, EPOCH)
    instants = [read_instant(f"{str(cell).removesuffix('Z')} {scale}", DATA) for cell in dates]
    return np.array([float(seconds_between(zero, in_scale(at, zero.scale, DATA))) for at in instants])


def placed(text: str | None) -> tuple[int, ...] | None:
    """The place in a header, from 1."""
    return None if text is None else tuple(map(int, text.split(",")))


def check_column(
    column: Column, unit: str | None, header: str, shapes: Mapping[str, tuple[int, ...]], name: str
) -> None:
    """Raises SceneError for a column of another observable, place or unit than the run has."""
    if column.name not in shapes:
        got = f"{name} has the column {header!r}{nearest(column.name, shapes)}"
        raise SceneError(DATA, "have columns of observables of the run", got)
    right = described(column.name).unit
    if unit is not None and unit != right:
        raise SceneError(DATA, f"have {column.name} in {right}", f"{name} has the column {header!r}")
    shape = shapes[column.name]
    places = [tuple(i + 1 for i in place) for place in np.ndindex(shape)]
    if column.place is not None and column.place not in places:
        sizes = " x ".join(map(str, shape)) or "no"
        raise SceneError(DATA, f"have {sizes} places of {column.name}", f"{name} has {header!r}")


def spread(
    column: Column, cells: Any, header: str, shapes: Mapping[str, tuple[int, ...]], name: str
) -> list[tuple[Column, Float[np.ndarray, " row"]]]:
    """The columns of a column, or of an array (row, ...) of all places of an observable."""
    numbers = numbers_of(header, cells)
    shape = shapes[column.name]
    if numbers is None or numbers.ndim < 1 or np.isinf(numbers).any():
        raise SceneError(
            DATA, "have numbers, or none where nothing was measured", f"{header} of {name} has others"
        )
    if numbers.ndim == 1 and (column.place is not None or not shape):
        return [(Column(column.name, column.place or ()), numbers)]
    if column.place is not None or numbers.shape[1:] != shape:
        wanted = f"have rows of the shape {shape} in {column.name}, or name a place"
        raise SceneError(DATA, wanted, f"{header} of {name} has the shape {numbers.shape[1:]}")
    return [
        (Column(column.name, tuple(i + 1 for i in at)), numbers[(slice(None), *at)])
        for at in np.ndindex(shape)
    ]


def check_times(time: Float[np.ndarray, " row"], scene: Scene, name: str) -> None:
    """Raises SceneError for times outside of the run."""
    end = float(scene.integrator.t_end)
    outside = np.flatnonzero((time < 0.0) | (time > end * (1.0 + 1e-12)))
    if len(outside):
        got = f"row {outside[0] + 1} of {name} is at {time[outside[0]]:g} s"
        raise SceneError(DATA, f"lie within the run, 0 to {end:g} s (`integrator.t_end`)", got)


# ---- noise -----------------------------------------------------------------------------------------


def deviations_of(
    noise: Mapping[str, Any], data: Sequence[Telemetry]
) -> list[Float[np.ndarray, " column"]]:
    """The standard deviation of every column of the data, in the unit of its observable.

    noise: by observable, or by place of one (`spin_rate[1]`), which goes before. Raises SceneError for a
    column without noise, for noise of what is not measured, and for numbers that are not positive."""
    table = {}
    for text, value in noise.items():
        parts = HEADER.fullmatch(text.strip())
        number = numbers_of(f"{NOISE}[{text}]", value)
        if parts is None or parts["unit"]:
            raise SceneError(
                NOISE, "be given by observable, such as spin_rate or spin_rate[1]", f"has {text!r}"
            )
        if number is None or number.ndim or not 0.0 < number < np.inf:
            raise SceneError(f"{NOISE}[{text}]", "be positive and finite", f"is {value!r}")
        table[Column(parts["name"], placed(parts["place"]))] = float(number)
    used, found = set(), []
    for one in data:
        column_noise = []
        for column in one.columns:
            key = column if column in table else Column(column.name, None)
            if key not in table:
                label = label_of(column)
                got = f"has none for {label} of {one.name}"
                raise SceneError(NOISE, "have a standard deviation for every column of the data", got)
            used.add(key)
            column_noise.append(table[key])
        found.append(np.array(column_noise))
    for key in table:
        if key not in used:
            raise SceneError(
                NOISE, "be that of columns of the data", f"has {label_of(key)}, which no column needs"
            )
    return found


def label_of(column: Column) -> str:
    """A column by its name and place: `spin_rate[1]`."""
    return column.name + (f"[{','.join(map(str, column.place))}]" if column.place else "")
