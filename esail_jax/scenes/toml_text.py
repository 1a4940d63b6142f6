"""The TOML text of a scene: as run files hold it, and as a file to start from, the text of a built-in scene
with a comment on every key and with the keys that it leaves out.

The comments are made from the declarations of the keys (`key_reference.py`)."""

import re
import textwrap
import tomllib
from typing import Any

import numpy as np

from esail_jax.scenes.key_reference import KeyDescription, describe_keys
from esail_jax.scenes.parts import given, model_of, parts_of
from esail_jax.scenes.scene import Scene


def to_toml(scene: Scene) -> str:
    """TOML text from which `parse` makes the same scene again, digit for digit."""
    lines = []
    for table, part in parts_of(scene.model).items():
        if not scene.has(table):
            continue
        values = given(getattr(scene, table))
        heading, entries = f"[{table}]", [values]
        if part.repeated:
            heading = f"[[{table}]]"
            entries = [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True)]
        for entry in entries:
            lines += [heading, *(f"{k} = {toml_value(v)}" for k, v in entry.items()), ""]
    return "\n".join(lines)


def toml_value(value: Any) -> str:
    """A value in TOML notation, with every digit."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, int):
        return str(value)
    array = np.asarray(value, float)
    if array.ndim == 0:
        return repr(float(array))
    return "[" + ", ".join(toml_value(x) for x in array) + "]"


HEADING = re.compile(r"\[\[?(\w+)\]\]?\s*$")
"""A line that begins a table."""


ENTRY = re.compile(r"(?P<name>\w+) = (?P<value>[^#]*[^#\s])\s*(?:# (?P<note>.*))?$")
"""A line that gives a key."""


COLUMN = 34
"""Column in which the comments on keys begin."""


WIDTH = 108
"""Largest length of a line of comment that stands alone."""


HOW_TO_READ = (
    "Every key has a comment with its unit and meaning. Lines that begin with `# key =` are keys that this "
    "scene leaves out, with the default that holds; remove the `#` to give another value. Without a value "
    "after `=` the key has no default."
)


LEFT_OUT = (
    "Tables that this scene leaves out. To use one, remove the `#` of its heading and of the keys that you "
    "give. Keys that must be given in such a table say so."
)


def commented(text: str) -> str:
    """The TOML text of a built-in scene with comments. It stands for exactly the same scene: values
    keep their notation, and everything that is added is a comment."""
    tables = tomllib.loads(text)
    model = model_of(tables)
    parts = parts_of(model)
    known = [key for key in describe_keys() if model in key.models]
    title, *lines = text.rstrip().splitlines()
    result = [title, *block(HOW_TO_READ)]
    table, given = "", dict[str, bool]()
    for line in [*lines, ""]:
        heading, entry = HEADING.match(line), ENTRY.match(line)
        if heading:
            table, given = heading[1], {}
            result += block(about(parts[table].table))
            result.append(line)
        elif entry and table:
            given[entry["name"]] = True
            key = next(key for key in known if (key.table, key.name) == (table, entry["name"]))
            without = "" if key.default is None else f"If left out: {toml_value(key.default)}."
            result.append(beside(f"{key.name} = {entry['value']}", key, entry["note"] or "", without))
        else:
            if table and given and not line:
                absent = [key for key in known if key.table == table and key.name not in given]
                result += [beside(without_value(key), key) for key in absent]
                given = {}
            result.append(line)
    others = {name: part for name, part in parts.items() if name not in tables}
    result += block(LEFT_OUT)
    for name, part in others.items():
        heading_of = f"# [[{name}]]" if part.repeated else f"# [{name}]"
        result += ["", *block(about(part.table)), heading_of]
        # Two more blanks than a key of a table that is there: these keys alone belong to no table.
        result += [f"#   {line[2:]}" for line in (left_out(key) for key in known if key.table == name)]
    return "\n".join(result) + "\n"


def about(table: type) -> str:
    """The first paragraph of a table's description, in one line."""
    return " ".join(table.__doc__.split("\n\n")[0].split())


def block(text: str) -> list[str]:
    """A text as lines of comment."""
    return textwrap.wrap(text, WIDTH, initial_indent="# ", subsequent_indent="# ")


def without_value(key: KeyDescription) -> str:
    """The line of a key that is left out, with its default if it has one."""
    value = "" if key.default is None else f" {toml_value(key.default)}"
    return f"# {key.name} ={value}"


def left_out(key: KeyDescription) -> str:
    """The line of a key in a table that is left out."""
    return beside(without_value(key), key, must="Must be given." if key.required else "")


def beside(entry: str, key: KeyDescription, note: str = "", must: str = "") -> str:
    """A line with its comment: the unit and meaning of the key, and the remark of the scene's own
    file. must: sentence on whether it must be given, or on what holds without it."""
    unit = "" if key.unit == "-" else f"{key.unit}: "
    parts = [f"{unit}{key.doc}"]
    if key.type.startswith("one of"):
        parts.append(f"{key.type.capitalize()}.")
    if key.type.startswith("number, or list with one number per"):
        parts.append(f"One for all, or a list with one per {key.type.split()[-1]}.")
    if must:
        parts.append(must)
    remark = note.removeprefix(key.unit).lstrip(":, ")
    if remark:
        parts.append(f"Here: {remark}.")
    return f"{entry:{COLUMN - 1}s} # {' '.join(parts)}"
