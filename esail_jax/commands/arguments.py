"""The parts of the command line that several commands have in common."""

import argparse
from typing import Any


def add_command(commands: Any, name: str, text: str) -> argparse.ArgumentParser:
    """A parser of one command. text: its help."""
    return commands.add_parser(
        name, help=text, description=f"{text[0].upper()}{text[1:]}.", allow_abbrev=False
    )


def add_scene(command: argparse.ArgumentParser) -> None:
    """Adds the arguments of every command that simulates a given scene."""
    command.add_argument("scene", help="name of a built-in scene, or path of a TOML file")
    command.add_argument("--t-end", metavar="SECONDS", help="end time [s] instead of the scene's")
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="table.key=VALUE",
        dest="settings",
        help="value of a scene key instead of the scene's, in TOML; may be given several times",
    )


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
