"""`Request`: a scene that is asked for, before it is made (`overrides.py`)."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple


class Request(NamedTuple):
    """A scene that is asked for.

    tables: of the file, or of the scene that is changed; overrides: other values, by key; folder: where
    relative names of files in the tables start; voltage_law, terms: those of the user."""

    tables: Mapping[str, Any]
    overrides: Mapping[str, Any]
    folder: Path
    voltage_law: Any = None
    terms: Any = ()


def given_value(request: Request, key: str) -> Any:
    """The value that a request gives for a key: that of the overrides, otherwise that of the tables, None
    if neither has it."""
    if key in request.overrides:
        return request.overrides[key]
    table, _, name = key.partition(".")
    content = request.tables.get(table)
    return content.get(name) if isinstance(content, Mapping) else None


def without(request: Request, keys: tuple[str, ...]) -> Request:
    """The request without some keys, in tables and overrides."""
    overrides = {key: value for key, value in request.overrides.items() if key not in keys}
    tables = {
        table: {name: x for name, x in content.items() if f"{table}.{name}" not in keys}
        if isinstance(content, Mapping)
        else content
        for table, content in request.tables.items()
    }
    return request._replace(tables=tables, overrides=overrides)
