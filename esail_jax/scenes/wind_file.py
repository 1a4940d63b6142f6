"""Solar wind from a CSV file: `solar_wind.file` in a scene's text stands for three keys of [solar_wind].

The file has a head line with the columns `time` [s], `speed` [m/s] and `number_density` [1/m^3], in any
order, and a line for every instant. The scene then holds the numbers themselves, so that a run file is
complete without it."""

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from esail_jax.scenes import rules
from esail_jax.scenes.rules import SceneError

COLUMNS = ("time", "speed", "number_density")
"""Columns of the file, and keys of [solar_wind] that they give."""

KEY = "solar_wind.file"
"""Key of the file's name."""

MUST = f"be a CSV file with the columns {', '.join(COLUMNS)}"
"""What the value of this key must be, as a message words it."""


def with_wind_file(
    tables: Mapping[str, Any], overrides: Mapping[str, Any], folder: Path
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Tables and overrides with the file's numbers in place of its name. The name in an override replaces
    that in the tables. folder: where a relative name in the tables starts; in an override it starts from
    the working folder.

    Raises SceneError."""
    tables, overrides = dict(tables), dict(overrides)
    wind = tables.get("solar_wind")
    if isinstance(wind, Mapping) and "file" in wind:
        name = wind["file"]
        others = {key: value for key, value in wind.items() if key != "file"}
        given_twice = [key for key in COLUMNS if key in others]
        if given_twice:
            raise SceneError(f"solar_wind.{given_twice[0]}", f"be left out with `{KEY}`", "is given")
        found = {} if KEY in overrides else read_columns(name, folder)
        tables["solar_wind"] = others | found
    if KEY in overrides:
        found = read_columns(overrides.pop(KEY), Path())
        overrides |= {f"solar_wind.{key}": value for key, value in found.items()}
    return tables, overrides


def read_columns(name: Any, folder: Path) -> dict[str, list[float]]:
    """Reads the columns of a file. Empty lines are left out. Raises SceneError, which names the line of a
    row that does not have a number for each column, or whose number breaks the rule of its key."""
    if not isinstance(name, str):
        raise SceneError(KEY, MUST, rules.describe(name))
    try:
        with open(folder / name, newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(row)]
    except (OSError, ValueError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "is not text"
        raise SceneError(KEY, MUST, f"{name!r} cannot be read: {reason}") from None
    head = rows[0][1] if rows else []
    if sorted(head) != sorted(COLUMNS):
        raise SceneError(KEY, MUST, f"{name!r} has {', '.join(head) or 'no lines'}")
    if len(rows) == 1:
        raise SceneError(KEY, MUST, f"{name!r} has no line of numbers")
    found: dict[str, list[float]] = {key: [] for key in COLUMNS}
    for line, row in rows[1:]:
        if len(row) != len(head):
            must = f"have {len(head)} numbers in every line"
            raise SceneError(KEY, must, f"line {line} of {name!r} has {len(row)}")
        for key, cell in zip(head, row, strict=True):
            found[key].append(number_of(cell))
            must = broken(key, found[key])
            if must:
                raise SceneError(f"solar_wind.{key}", must, f"line {line} of {name!r} has {cell!r}")
    return found


def number_of(cell: str) -> float:
    """Returns the number in a cell, NaN if there is none."""
    try:
        return float(cell)
    except ValueError:
        return math.nan


def broken(key: str, numbers: list[float]) -> str | None:
    """Returns what the last number of a column must be and is not, None if it is right."""
    last = numbers[-1]
    if not math.isfinite(last):
        return "be finite"
    if key == "time":
        return "increase" if len(numbers) > 1 and last <= numbers[-2] else None
    rule = rules.positive if key == "speed" else rules.non_negative
    return None if rule.accepts(np.asarray(last)) else rule.must
