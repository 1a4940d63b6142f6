"""`esail cache`: where compiled programs are kept."""

import argparse
from typing import Any

from esail_jax.commands.command_line import ExitCode, add_command

UNITS = {"GiB": 2**30, "MiB": 2**20, "KiB": 2**10}
"""Units of a size, largest first."""


def add(commands: Any) -> None:
    """Adds `esail cache`."""
    cache = add_command(commands, "cache", "show where compiled programs are kept, and their size")
    cache.add_argument("--clear", action="store_true", help="remove them; they are compiled again")


def run(options: argparse.Namespace) -> ExitCode:
    """Prints where compiled programs are kept, their number and size, and removes them with `--clear`."""
    from esail_jax.compilation.stored import STORE

    folder = STORE.location()
    if folder is None:
        print(f"Compiled programs are not kept ({STORE.variable} is off).")
        return ExitCode.DONE
    usage = STORE.usage()
    print(f"folder    {folder}")
    print(f"files     {usage.files}")
    print(f"size      {in_words(usage.size)} (at most {in_words(STORE.most_bytes)})")
    if options.clear:
        print(f"removed   {STORE.clear()}")
    return ExitCode.DONE


def in_words(size: int) -> str:
    """A size with its unit."""
    for unit, value in UNITS.items():
        if size >= value:
            return f"{size / value:.1f} {unit}"
    return f"{size} B"
