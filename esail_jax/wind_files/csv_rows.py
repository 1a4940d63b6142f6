"""CSV files of a wind: the columns `time`, `speed` [m/s] and `number_density` [1/m^3], in any order.

`time` holds seconds of the run [s], or dates of ISO 8601 (`2027-03-01T12:00`), which the epoch of the
scene places. Columns are separated by commas, or by semicolons, and then a comma is the decimal one. A
cell that is empty, that holds `nan`, or that holds a fill value of OMNI (`rows.FILLS`) is no number but a
part of a gap."""

import csv
import io
import math
import re

import numpy as np

from esail_jax.calendar.instants import Instants, read_instant
from esail_jax.errors import SceneError
from esail_jax.wind_files.rows import COLUMNS, TIMES, WIND_FILE, Rows, check_increasing, is_fill

DATE = re.compile(r"\d{4}-\d")
"""How a date begins, and no number."""

MUST = f"be a CSV file with the columns {', '.join(COLUMNS)}, or an OMNI file (hourly, 1 or 5 minutes)"
"""What the value of the key must be, as a message words it."""


def read_csv(text: str, source: str) -> Rows:
    """The rows of the text of a CSV file. Empty lines are left out. source: what the file is called in a
    message. Raises SceneError, which names the line of a row that does not have a cell for each column, or
    whose cell breaks the rule of its key."""
    separator = separator_of(text)
    lines = numbered_cells(text, source, separator)
    number, head = lines[0] if lines else (1, [])
    if sorted(head) != sorted(COLUMNS):
        shown = ", ".join(head)
        shown = f"{shown[:57]}..." if len(shown) > 60 else shown or "no name"
        got = f"line {number} of {source} has {shown}" if lines else f"{source} has no lines"
        raise SceneError(WIND_FILE, MUST, got)
    if len(lines) == 1:
        raise SceneError(WIND_FILE, MUST, f"{source} has no line of numbers")
    cells: dict[str, list[str]] = {key: [] for key in COLUMNS}
    numbers: dict[str, list[float]] = {key: [] for key in COLUMNS}
    for line, row in lines[1:]:
        if len(row) != len(head):
            must = f"have {len(head)} numbers in every line"
            raise SceneError(WIND_FILE, must, f"line {line} of {source} has {len(row)}")
    dated = DATE.match(lines[1][1][head.index("time")]) is not None
    for line, row in lines[1:]:
        for key, cell in zip(head, row, strict=True):
            cells[key].append(cell)
            if key == "time" and dated:
                continue
            found = number_of(cell.replace(",", ".") if separator == ";" else cell)
            unmet = broken(key, cell, found)
            if unmet:
                raise SceneError(f"solar_wind.{key}", unmet, f"line {line} of {source} has {cell!r}")
            numbers[key].append(found)
    at_line = np.array([line for line, _ in lines[1:]])
    time = instants_of(cells["time"], at_line, source) if dated else np.array(numbers["time"])
    values, missing = {}, dict[int, str]()
    for key in ("speed", "number_density"):
        column = np.array(numbers[key])
        fills = is_fill(key, column)
        missing |= {int(row): in_words(key, cells[key][row]) for row in np.flatnonzero(np.isnan(column))}
        missing |= {int(row): f"{key} is the fill value {cells[key][row]}" for row in np.flatnonzero(fills)}
        values[key] = np.where(fills, np.nan, column)
    form = "CSV file with dates" if dated else "CSV file with seconds"
    rows = Rows(source, form, time, values["speed"], values["number_density"], at_line, None, missing)
    return check_increasing(rows)


def separator_of(text: str) -> str:
    """What separates the columns of the first line with names: a semicolon if there is one and no comma."""
    head = next((line for line in text.splitlines() if line.strip()), "")
    return ";" if ";" in head and "," not in head else ","


def numbered_cells(text: str, source: str, separator: str) -> list[tuple[int, list[str]]]:
    """The cells of all lines that are not empty, each with the number of its line. Raises SceneError for a
    text that is no CSV file."""
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
    try:
        return [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(row)]
    except csv.Error as error:
        got = f"{source} cannot be read: {error} in line {reader.line_num}"
        raise SceneError(WIND_FILE, MUST, got) from None


def number_of(cell: str) -> float:
    """The number in a cell, NaN if there is none."""
    try:
        return float(cell)
    except ValueError:
        return math.nan


def is_absent(cell: str) -> bool:
    """Tells whether a cell says that there is no number."""
    return cell.lower() in ("", "nan")


def in_words(key: str, cell: str) -> str:
    """What stands in a cell without a number."""
    return f"{key} is {cell or 'empty'}"


def broken(key: str, cell: str, number: float) -> str | None:
    """What the number of a cell must be and is not, None if it is right or absent."""
    if key != "time" and is_absent(cell):
        return None
    if not math.isfinite(number):
        return "be finite"
    if key == "speed" and number <= 0.0:
        return "be positive"
    return "not be negative" if key == "number_density" and number < 0.0 else None


def instants_of(cells: list[str], line: np.ndarray, source: str) -> Instants:
    """The instants of dates, which must be in one scale. line: of each. Raises SceneError, which names the
    line of a wrong one."""
    found: list[Instants] = []
    for cell, number in zip(cells, line.tolist(), strict=True):
        try:
            found.append(read_instant(cell, TIMES))
        except SceneError as error:
            got = f"line {number} of {source} has {cell!r}"
            raise SceneError(error.key, error.must, got) from None
        if found[-1].scale != found[0].scale:
            got = f"line {number} of {source} has {cell!r} after dates in {found[0].scale}"
            raise SceneError(TIMES, "be in one time scale", got)
    day, second = (np.array([getattr(at, name) for at in found]) for name in ("day", "second"))
    return Instants(day, second, found[0].scale)
