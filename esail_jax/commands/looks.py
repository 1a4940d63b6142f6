"""How runs in motion are shown: the options that `esail animate` and `esail view` share, their check, and
what they mean for the contents of run files."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from esail_jax.commands.command_line import UsageError, check_positive, refuse_existing

if TYPE_CHECKING:
    from esail_jax.viewing.motion import Motion


def add_looks(command: argparse.ArgumentParser) -> None:
    """Adds the options of the commands that show runs in motion."""
    command.add_argument(
        "--member", type=int, action="append", default=[], metavar="I", dest="members",
        help="number of the member of an ensemble, from 0",
    )  # fmt: skip
    command.add_argument(
        "--exaggeration", type=float, metavar="K",
        help="factor of the lateral displacements (default: chosen, so that the motion is visible)",
    )  # fmt: skip
    command.add_argument(
        "--axes", choices=("inertial", "spinning"),
        help="axes of a sail: inertial, or those of the hub (default: inertial)",
    )  # fmt: skip
    command.add_argument(
        "--colour", choices=("tension", "voltage", "strain", "none"),
        help="quantity that colours tethers or rods (default: tension)",
    )  # fmt: skip
    command.add_argument("--overwrite", action="store_true", help="replace the file if it exists")


def check_looks(options: argparse.Namespace) -> None:
    """Raises UsageError for an exaggeration that is not positive and finite, and for an output that exists
    already."""
    check_positive(options, "exaggeration")
    refuse_existing(options.output, options.overwrite)


def motions_of(paths: Sequence[Path], options: argparse.Namespace, most: int) -> "list[Motion]":
    """The moving pictures of the files. most: largest number of saved instants in one picture.

    Raises RunFileError, and UsageError for a colour or axes that they do not have."""
    from esail_jax.viewing.motions import read_motions

    motions = read_motions(paths, tuple(options.members), most)
    if len({motion.turning for motion in motions}) > 1:
        raise UsageError("`RUN.h5` must be files of sails or of chains, but there are both")
    known = [*dict.fromkeys(name for motion in motions for name in motion.colours), "none"]
    if options.colour is not None and options.colour not in known:
        raise UsageError(f"`--colour` must be one of {', '.join(known)} here, but is {options.colour!r}")
    if options.axes is not None and not motions[0].turning:
        raise UsageError(f"`--axes` must be left out with a chain, but is {options.axes!r}")
    return motions
