"""Solar wind from a CSV file: `solar_wind.file` in a scene's text stands for three keys of [solar_wind].

The file has a head line with the columns `time` [s], `speed` [m/s] and `number_density` [1/m^3], in any
order, and a line for every instant. The scene then holds the numbers themselves, so that a run file is
complete without it."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

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
    """Reads the columns of a file. Raises SceneError."""
    if not isinstance(name, str):
        raise SceneError(KEY, MUST, rules.describe(name))
    try:
        with open(folder / name, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except (OSError, ValueError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "is not text"
        raise SceneError(KEY, MUST, f"{name!r} cannot be read: {reason}") from None
    head = set(rows[0]) if rows else set()
    if head != set(COLUMNS):
        raise SceneError(KEY, MUST, f"{name!r} has {', '.join(map(str, head)) or 'no lines'}")
    try:
        return {key: [float(row[key]) for row in rows] for key in COLUMNS}
    except (TypeError, ValueError):
        raise SceneError(KEY, MUST + " of numbers", f"{name!r} has others") from None
