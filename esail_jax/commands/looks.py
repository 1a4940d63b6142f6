"""How runs in motion are shown: the options that `esail animate` and `esail view` share."""

import argparse
from typing import Any


def add_looks(command: argparse.ArgumentParser) -> None:
    """Adds the options of the commands that show runs in motion."""
    command.add_argument(
        "--member",
        type=int,
        action="append",
        metavar="I",
        help="number of the member of an ensemble, from 0",
    )
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


def looks_of(options: argparse.Namespace) -> dict[str, Any]:
    """The arguments of `view` and `animate` (`viewing/showing.py`) for these options."""
    return {
        name: getattr(options, name) for name in ("member", "exaggeration", "axes", "colour", "overwrite")
    }
