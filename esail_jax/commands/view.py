"""`esail view`: a page for a browser that shows runs in motion."""

import argparse
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, UsageError, add_command
from esail_jax.commands.looks import add_looks, check_looks, motions_of

PAGES = (".html", ".htm")
"""Endings of the files that `esail view` writes."""


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


def check(options: argparse.Namespace) -> None:
    """Raises UsageError for options of `esail view` that are out of range, and for an output that exists
    already."""
    suffix = options.output.suffix.lower()
    if suffix not in PAGES:
        raise UsageError(f"`-o` must end in {' or '.join(PAGES)}, but ends in {suffix!r}")
    check_looks(options)


def run(options: argparse.Namespace) -> ExitCode:
    """Writes a page that shows runs in motion and prints its path. Raises InputError."""
    check(options)
    from esail_jax.atomic_file import atomic_file
    from esail_jax.viewing.page import MOST_INSTANTS, page_of

    motions = motions_of(options.runs, options, MOST_INSTANTS)
    looks = {"exaggeration": options.exaggeration, "colour": options.colour}
    text = page_of(motions, axes=options.axes or "inertial", **looks)
    with atomic_file(options.output) as part:
        part.write_text(text, encoding="utf-8")
    print(options.output)
    return ExitCode.DONE
