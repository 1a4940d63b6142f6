"""`esail animate`: a run as a moving picture."""

import argparse
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, add_command, refuse_existing
from esail_jax.commands.looks import add_looks, looks_of


def add(commands: Any) -> None:
    """Adds `esail animate`."""
    animate = add_command(commands, "animate", "draw a run as a moving picture")
    animate.add_argument("run", type=Path, metavar="RUN.h5", help="run file, or ensemble.h5 with --member")
    animate.add_argument(
        "-o",
        "--output",
        required=True,
        type=Path,
        metavar="FILE",
        help="file to write: .webp, .gif or .mp4",
    )
    add_looks(animate)
    animate.add_argument(
        "--seconds", type=float, default=6.0, help="duration of the whole run (default: %(default)g)"
    )
    animate.add_argument(
        "--fps", type=float, default=15.0, help="pictures per second, at most (default: %(default)g)"
    )
    animate.add_argument(
        "--size",
        default="560x480",
        metavar="WIDTHxHEIGHT",
        help="in pixels, even ones for .mp4 (default: %(default)s)",
    )


def run(options: argparse.Namespace) -> ExitCode:
    """Writes the animation of a run and prints its path. Raises InputError."""
    refuse_existing(options.output, options.overwrite)
    from esail_jax.viewing.showing import animate

    how = {name: getattr(options, name) for name in ("seconds", "fps", "size")}
    animate(options.run, options.output, **how, **looks_of(options))
    print(options.output)
    return ExitCode.DONE
