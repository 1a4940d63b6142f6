"""The TOML text of a scene, as run files hold it."""

from typing import Any

import numpy as np

from esail_jax.scenes.scene import Scene
from esail_jax.scenes.tables import REPEATED, TABLES, given


def to_toml(scene: Scene) -> str:
    """TOML text from which `parse` makes the same scene again, digit for digit."""
    lines = []
    for table in TABLES:
        content = getattr(scene, table)
        if content is None:
            continue
        values, heading, entries = given(content), f"[{table}]", [given(content)]
        if table in REPEATED:
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
