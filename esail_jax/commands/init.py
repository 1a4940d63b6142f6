"""`esail init`: a built-in scene with comments, to start from."""

import argparse
import sys
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, add_command, refuse_existing


def add(commands: Any) -> None:
    """Adds `esail init`."""
    init = add_command(
        commands, "init", "write a built-in scene with a comment on every key, to start from"
    )
    init.add_argument("name", metavar="NAME", help="name of a built-in scene")
    init.add_argument(
        "-o", "--output", type=Path, metavar="FILE.toml", help="file to write (default: standard output)"
    )


def run(options: argparse.Namespace) -> ExitCode:
    """Writes a built-in scene with comments to a new file, or prints it if no path is given. Raises
    SceneError and UsageError."""
    from esail_jax.atomic_file import atomic_file
    from esail_jax.errors import nearest
    from esail_jax.scenes.loading import builtin_names, builtin_text
    from esail_jax.scenes.rules import SceneError
    from esail_jax.scenes.toml_text import commented

    text = builtin_text(options.name)
    if text is None:
        known = builtin_names()
        got = f"is {options.name!r}{nearest(options.name, known)}"
        raise SceneError("NAME", f"be a built-in scene ({', '.join(known)})", got)
    if options.output is None:
        sys.stdout.write(commented(text))
        return ExitCode.DONE
    refuse_existing(options.output)
    with atomic_file(options.output) as part:
        part.write_text(commented(text), encoding="utf-8")
    return ExitCode.DONE
