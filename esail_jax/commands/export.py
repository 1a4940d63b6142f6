"""`esail export`: the observables of a run as a table for other programs."""

import argparse
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, UsageError, add_command, refuse_existing

TABLES = (".csv", ".nc")
"""Endings of the files that `esail export` writes."""


def add(commands: Any) -> None:
    """Adds `esail export`."""
    export = add_command(commands, "export", "write the observables of a run as a table for other programs")
    export.add_argument("run", type=Path, metavar="RUN.h5", help="run file")
    export.add_argument(
        "-o", "--output", required=True, type=Path, metavar="FILE",
        help="file to write: .csv (comma-separated values) or .nc (netCDF; needs xarray)",
    )  # fmt: skip
    export.add_argument(
        "--calendar", action="store_true",
        help="write the date of every instant, too, for a run with an epoch (CSV)",
    )  # fmt: skip
    export.add_argument("--overwrite", action="store_true", help="replace the file if it exists")


def check(options: argparse.Namespace) -> None:
    """Raises UsageError for an output of another format than those of `esail export`, and for one that
    exists already."""
    suffix = options.output.suffix.lower()
    if suffix not in TABLES:
        raise UsageError(f"`-o` must end in {' or '.join(TABLES)}, but ends in {suffix!r}")
    if options.calendar and is_netcdf(options.output):
        raise UsageError("`--calendar` must be left out with .nc, which has dates anyway, but is given")
    refuse_existing(options.output, options.overwrite)


def is_netcdf(path: Path) -> bool:
    """Tells by its ending whether a file is one of netCDF."""
    return path.suffix.lower() == ".nc"


def run(options: argparse.Namespace) -> ExitCode:
    """Writes the observables of a run file to a file of another format and prints its path. Raises
    InputError."""
    check(options)
    from esail_jax.atomic_file import atomic_file
    from esail_jax.files.export import check_netcdf, write_csv, write_netcdf

    netcdf = is_netcdf(options.output)
    if netcdf:
        check_netcdf()
    with atomic_file(options.output) as part:
        if netcdf:
            write_netcdf(options.run, part)
        else:
            write_csv(options.run, part, options.calendar)
    print(options.output)
    return ExitCode.DONE
