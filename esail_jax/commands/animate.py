"""`esail animate`: a run as a moving picture."""

import argparse
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, UsageError, add_command, check_positive
from esail_jax.commands.looks import add_looks, check_looks, motions_of

MOVIES = (".webp", ".gif", ".mp4")
"""Endings of the files that `esail animate` writes."""


SIDES = range(64, 4097)
"""Widths and heights [pixel] that `esail animate` draws."""


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
        "--size", default="560x480", metavar="WIDTHxHEIGHT", help="in pixels (default: %(default)s)"
    )


def check(options: argparse.Namespace) -> None:
    """Raises UsageError for options of `esail animate` that are out of range, and for an output that exists
    already. Replaces `size` by width and height [pixel]."""
    suffix = options.output.suffix.lower()
    if suffix not in MOVIES:
        raise UsageError(
            f"`-o` must end in {', '.join(MOVIES[:-1])} or {MOVIES[-1]}, but ends in {suffix!r}"
        )
    for name in ("fps", "seconds"):
        check_positive(options, name)
    if len(options.members) > 1:
        raise UsageError(f"`--member` must be given once, but is {len(options.members)} times")
    sides = options.size.lower().split("x")
    if len(sides) != 2 or not all(side.isdecimal() and int(side) in SIDES for side in sides):
        allowed = f"{SIDES[0]} to {SIDES[-1]}"
        raise UsageError(f"`--size` must be WIDTHxHEIGHT, each {allowed}, but is {options.size!r}")
    options.size = tuple(map(int, sides))
    check_looks(options)


def run(options: argparse.Namespace) -> ExitCode:
    """Writes the animation of a run and prints its path. Raises InputError."""
    check(options)
    from esail_jax.atomic_file import atomic_file
    from esail_jax.viewing.animation import animate, check_movie
    from esail_jax.viewing.drawing import Style

    suffix = options.output.suffix.lower()
    if suffix == ".mp4":
        check_movie()
    most = max(1, round(options.fps * options.seconds))
    (motion,) = motions_of([options.run], options, most)
    style = Style(
        motion.exaggeration if options.exaggeration is None else options.exaggeration,
        options.axes or "inertial",
        options.colour or next(iter(motion.colours), "none"),
        *options.size,
    )
    with atomic_file(options.output) as part:
        animate(motion, style, part, len(motion.time) / options.seconds, suffix)
    print(options.output)
    return ExitCode.DONE
