"""`esail bench`: error against run time of the methods of integration on this machine."""

import argparse
import sys
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, add_command, scene_of


def add(commands: Any) -> None:
    """Adds `esail bench`."""
    bench = add_command(
        commands, "bench", "measure error and run time of the methods of integration on this machine"
    )
    bench.add_argument(
        "--scene", default="baseline", metavar="SCENE",
        help="name of a built-in scene, or path of a TOML file (default: %(default)s)",
    )  # fmt: skip
    bench.add_argument("--t-end", metavar="SECONDS", help="end time [s] instead of the scene's")
    bench.add_argument("--json", type=Path, metavar="FILE", help="also write the results as JSON lines")
    bench.set_defaults(settings=[])


def run(options: argparse.Namespace) -> ExitCode:
    """Prints the table row by row, and writes the JSON lines to a file if one is given. It uses no cache of
    compiled programs, because it measures the compile time."""
    scene = scene_of(options)
    from esail_jax.commands.benchmark import NoReference, run_bench
    from esail_jax.compilation.stored import STORE

    STORE.switch_off()
    try:
        run_bench(scene, options.json)
    except NoReference as error:
        print(error, file=sys.stderr)
        return ExitCode.FAILED
    return ExitCode.DONE
