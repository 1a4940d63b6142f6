"""The parser of the command line, and the arguments that several commands have in common."""

import argparse
import sys
from collections.abc import Sequence
from typing import Any

from esail_jax.commands.options import UsageError


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    given: Sequence[str] = ()

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parses arguments, None for those of the process."""
        self.given = sys.argv[1:] if args is None else args
        return super().parse_args(args, namespace)

    def error(self, message: str):
        blanks = setting_with_blanks(self.given)
        if message.startswith("unrecognized arguments") and blanks:
            raise UsageError(f"`--set` must be table.key=VALUE without blanks around `=`, but is {blanks}")
        raise UsageError(f"{self.prog}: {message} (`{self.prog} --help` shows what there is)")


def setting_with_blanks(given: Sequence[str]) -> str:
    """Returns the first setting of a command line that has blanks around its `=`, otherwise an empty
    text."""
    for k, word in enumerate(given):
        setting, following = [*given[k + 1 : k + 2], ""][0], given[k + 2 : k + 4]
        if word != "--set" or not following:
            continue
        if "=" not in setting and following[0].startswith("="):
            return " ".join([setting, *following[: 2 if following[0] == "=" else 1]])
        if setting.endswith("=") and not following[0].startswith("-"):
            return f"{setting} {following[0]}"
    return ""


class ShowVersion(argparse.Action):
    """The action of `--version`, which reads the version only where it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib import metadata

        print(f"esail_jax {metadata.version('esail_jax')}")
        parser.exit()


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
