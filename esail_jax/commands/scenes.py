"""`esail scenes`: lists the built-in scenes."""

import argparse
from typing import Any

from esail_jax.commands.command_line import ExitCode, add_command


def add(commands: Any) -> None:
    """Adds `esail scenes`."""
    add_command(commands, "scenes", "list the built-in scenes")


def run(options: argparse.Namespace) -> ExitCode:
    """Prints every built-in scene with its description."""
    from esail_jax.scenes.loading import builtin_names, description

    for name in builtin_names():
        print(f"{name:18s} {description(name)}")
    return ExitCode.DONE
