"""The scene keys in which several scenes differ."""

from collections.abc import Sequence
from typing import Any

from esail_jax.scenes.rules import describe
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.tables import given

ABSENT = "-"
"""Text for a key that a scene does not have."""

LONGEST = 60
"""Largest number of characters of a value."""

LARGE = 1e7
"""Whole numbers from here on are written with an exponent."""


def differing_keys(scenes: Sequence[Scene]) -> dict[str, tuple[str, ...]]:
    """Returns the keys whose values are not the same in all scenes, each with its value in every scene as a
    short text. Keys have the order of the scenes' tables."""
    values = [values_by_key(scene) for scene in scenes]
    keys = dict.fromkeys(key for one in values for key in one)
    differ = (key for key in keys if any(one.get(key) != values[0].get(key) for one in values))
    return {key: tuple(text_of(one.get(key)) for one in values) for key in differ}


def values_by_key(scene: Scene) -> dict[str, Any]:
    """Returns the values that a scene has, by `table.key`."""
    tables = scene.tables.items()
    return {f"{table}.{name}": x for table, content in tables for name, x in given(content).items()}


def text_of(value: Any) -> str:
    """Returns a value as a text of at most about sixty characters: numbers as people write them, lists
    without brackets."""
    if value is None:
        return ABSENT
    value = value.tolist() if hasattr(value, "tolist") else value
    items = value if isinstance(value, (list, tuple)) else [value]
    if not items or not all(isinstance(item, (str, bool, int, float)) for item in items):
        return describe(value).removeprefix("is ")
    text = ", ".join(plain(item) for item in items)
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def plain(item: str | bool | int | float) -> str:
    """Returns an entry of a list, or a single value, as a text: 1000 in place of 1000.0."""
    if isinstance(item, float) and item.is_integer() and abs(item) < LARGE:
        return str(int(item))
    return describe(item).removeprefix("is ").strip("'")
