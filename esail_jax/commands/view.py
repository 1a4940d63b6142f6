"""`esail view`: a page for a browser that shows runs in motion."""

import argparse
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, add_command, refuse_existing
from esail_jax.commands.looks import add_looks, looks_of


def add(commands: Any) -> None:
    """Adds `esail view`."""
    view = add_command(
        commands,
        "view",
        "write a page for a browser that shows runs in motion, side by side, without network",
    )
    view.add_argument(
        "runs", type=Path, nargs="+", metavar="RUN.h5", help="run files, or ensemble.h5 with --member"
    )
    view.add_argument("-o", "--output", required=True, type=Path, metavar="FILE.html", help="page to write")
    add_looks(view)


def run(options: argparse.Namespace) -> ExitCode:
    """Writes a page that shows runs in motion and prints its path. Raises InputError."""
    refuse_existing(options.output, options.overwrite)
    from esail_jax.viewing.showing import view

    view(options.runs, options.output, **looks_of(options))
    print(options.output)
    return ExitCode.DONE
