"""Scenes from files, the built-in ones among them, and the door by which every scene comes to be run."""

import os
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from esail_jax.errors import nearest
from esail_jax.scenes.integration import check_size
from esail_jax.scenes.overrides import Request, check_overrides
from esail_jax.scenes.own_terms import check_has_terms
from esail_jax.scenes.rules import SceneError, describe
from esail_jax.scenes.scene import Scene, scene_of
from esail_jax.scenes.voltage import check_has_law

DIRECTORY = resources.files("esail_jax.scenes") / "builtin"
"""Folder of the built-in scenes, TOML files. The first line of each is a comment that describes it."""


def builtin_names() -> list[str]:
    """Names of the built-in scenes, sorted."""
    return sorted(
        path.name.removesuffix(".toml") for path in DIRECTORY.iterdir() if path.name.endswith(".toml")
    )


def builtin_text(name: str) -> str | None:
    """TOML text of a built-in scene; None if no scene has this name."""
    path = DIRECTORY / f"{name}.toml"
    return path.read_text(encoding="utf-8") if name in builtin_names() else None


def description(name: str) -> str:
    """Description of a built-in scene: the first line of its file."""
    return builtin_text(name).splitlines()[0].removeprefix("# ")


def parse(text: str, source: str, overrides: Mapping[str, Any] | None = None) -> Scene:
    """A scene from TOML text and overrides by key. source: path of the text, which names it in errors.
    Raises SceneError."""
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also numbers of thousands of digits
        raise SceneError(source, "be a TOML file", f"is not: {error}") from None
    return scene_of(Request(tables, overrides or {}, Path(source).parent))


def unread(source: str | os.PathLike, error: Exception) -> str:
    """Says why a scene could not be read, and what its user may have meant."""
    if isinstance(error, FileNotFoundError):
        hint = nearest(str(source), builtin_names()) or " (`esail scenes` lists the built-in scenes)"
        return f"cannot be read: {error.strerror}{hint}"
    if isinstance(error, UnicodeDecodeError) and str(source).endswith(".h5"):
        return "cannot be read: is not text but a file of results"
    return f"cannot be read: {getattr(error, 'strerror', None) or 'is not text'}"


def read_scene(source: str | os.PathLike, overrides: Mapping[str, Any] | None) -> Scene:
    """A built-in scene by name or a TOML file by path, with overrides by key. Raises SceneError."""
    text = builtin_text(str(source))
    if text is None:
        try:
            with open(source, encoding="utf-8-sig") as file:  # some editors write a byte-order mark
                text = file.read()
        except (OSError, ValueError) as error:
            raise SceneError(
                str(source), "be a built-in scene or a TOML file", unread(source, error)
            ) from None
    return parse(text, str(source), overrides)


def load_scene(source: str | os.PathLike | Scene, overrides: Mapping[str, Any] | None = None) -> Scene:
    """A built-in scene by name, a TOML file by path, or a `Scene` itself, with overrides by key, which may
    also give what a file lacks. Raises SceneError, also for a scene that this machine cannot compute, and
    for one that names a law in Python but does not have it. It is the door by which every scene comes to be
    computed."""
    if overrides is not None:
        check_overrides("overrides", overrides, "`voltage_law=law`")
    if not isinstance(source, Scene | str | os.PathLike):
        must = "be a `Scene`, the name of a built-in scene, or the path of a TOML file"
        raise SceneError("scene", must, describe(source))
    scene = source.replace(overrides or {}) if isinstance(source, Scene) else read_scene(source, overrides)
    check_size(scene)
    if scene.chain is None and scene.voltage is not None:
        check_has_law(scene.voltage.law, scene.voltage_law)
    if scene.terms:
        from esail_jax.scenes.trial_of_terms import try_terms  # imports JAX

        check_has_terms(scene)
        try_terms(scene)
    return scene
