"""`esail modes`: the table of a sail's modes, as text, as a JSON file and as figures."""

import argparse
import json
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, UsageError, add_command, add_scene, scene_of


def add(commands: Any) -> None:
    """Adds `esail modes`."""
    modes = add_command(
        commands, "modes", "frequencies, damping and names of a sail's modes about its spinning equilibrium"
    )
    add_scene(modes)
    modes.add_argument("--json", type=Path, metavar="FILE", help="also write all modes as a JSON list")
    modes.add_argument("-o", "--output", type=Path, metavar="DIR", help="folder for figures of the shapes")
    modes.add_argument(
        "--count", type=int, metavar="N",
        help="number of modes, those of the lowest frequencies; a line of the table may "
        "hold several (default: all; of large sails with unequal "
        "tethers the lowest 100)",
    )  # fmt: skip
    modes.add_argument(
        "--floquet", action="store_true",
        help="also find the periodic orbit at the sailing angle and its multipliers (minutes)",
    )  # fmt: skip


def check(options: argparse.Namespace) -> None:
    """Raises UsageError for options of `esail modes` that are out of range, or a result that would
    be overwritten."""
    if options.count is not None and options.count < 1:
        raise UsageError(f"`--count` must be positive, but is {options.count}")
    if options.json is not None and options.json.exists() and options.json.stat().st_size:
        raise UsageError(f"`--json` must be a new or an empty file, but {options.json} has content")


def run(options: argparse.Namespace) -> ExitCode:
    """Prints the modes of a scene, and writes all of them to a file and the figures to a folder if these
    are given. Raises SceneError, SimulationError, OSError."""
    check(options)
    scene = scene_of(options)
    from esail_jax.atomic_file import atomic_file
    from esail_jax.modal.sail_modes import modes

    table = modes(scene, count=options.count, floquet=options.floquet)
    print(table)
    if options.json is not None:
        lines = ",\n".join(json.dumps(record) for record in table.records())
        with atomic_file(options.json) as new:
            new.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
        print(options.json)
    if options.output is not None:
        from esail_jax.plotting.modes import plot_modes

        for path in plot_modes(table, options.output):
            print(path)
    return ExitCode.DONE
