"""The scene keys in which several scenes differ."""

from collections.abc import Sequence
from typing import Any

from esail_jax.scenes.rules import describe
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.tables import given

ABSENT = "-"
"""Text for a key that a scene does not have."""


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
    """Returns a value as a text of at most about sixty characters."""
    return ABSENT if value is None else describe(value).removeprefix("is ")
