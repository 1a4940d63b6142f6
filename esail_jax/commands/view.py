"""`esail view`."""

import argparse

from esail_jax.atomic_file import atomic_file
from esail_jax.commands.looks import motions_of
from esail_jax.viewing.page import MOST_INSTANTS, page_of


def write_page(options: argparse.Namespace) -> None:
    """Writes a page that shows runs in motion and prints its path. Raises InputError."""
    motions = motions_of(options.runs, options, MOST_INSTANTS)
    looks = {"exaggeration": options.exaggeration, "colour": options.colour}
    text = page_of(motions, axes=options.axes or "inertial", **looks)
    with atomic_file(options.output) as part:
        part.write_text(text, encoding="utf-8")
    print(options.output)
