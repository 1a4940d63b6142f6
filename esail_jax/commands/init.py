"""`esail init`."""

import sys
from pathlib import Path

from esail_jax.atomic_file import atomic_file
from esail_jax.commands.options import refuse_existing
from esail_jax.errors import nearest
from esail_jax.scenes.loading import builtin_names, builtin_text
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.toml_text import commented


def write_scene(name: str, path: Path | None) -> None:
    """Writes a built-in scene with comments to a new file, or prints it if no path is given. Raises
    SceneError and UsageError."""
    text = builtin_text(name)
    if text is None:
        raise SceneError(
            "NAME",
            f"be a built-in scene ({', '.join(builtin_names())})",
            f"is {name!r}{nearest(name, builtin_names())}",
        )
    if path is None:
        sys.stdout.write(commented(text))
        return
    refuse_existing(path)
    with atomic_file(path) as part:
        part.write_text(commented(text), encoding="utf-8")
