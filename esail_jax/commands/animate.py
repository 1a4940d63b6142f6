"""`esail animate`."""

import argparse

from esail_jax.atomic_file import atomic_file
from esail_jax.commands.looks import motions_of
from esail_jax.viewing.animation import animate, check_movie
from esail_jax.viewing.drawing import Style


def write_animation(options: argparse.Namespace) -> None:
    """Writes the animation of a run and prints its path. Raises InputError."""
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
