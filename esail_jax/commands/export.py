"""`esail export`: a run for other programs, as a table or as a message of flight dynamics."""

import argparse
import math
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, UsageError, add_command, refuse_existing

TABLE, NETCDF, ORBIT, ATTITUDE = ".csv", ".nc", ".oem", ".aem"

PART = ("observables", "first", "last", "every")
HEAD = ("object", "mission", "time_system")

FORMATS = {TABLE: ("calendar", *PART), NETCDF: PART, ORBIT: HEAD, ATTITUDE: HEAD}
"""Endings of the files that `esail export` writes, and the options that each one has."""


def add(commands: Any) -> None:
    """Adds `esail export`."""
    export = add_command(
        commands, "export", "write a run as a table, or as an orbit or an attitude, for other programs"
    )
    export.add_argument("run", type=Path, metavar="RUN.h5", help="run file")
    export.add_argument(
        "-o", "--output", required=True, type=Path, metavar="FILE",
        help="file to write: .csv (comma-separated values), .nc (netCDF; needs xarray), .oem or .aem "
        "(messages of the CCSDS with the orbit or the attitude of the hub; of runs with an epoch)",
    )  # fmt: skip
    export.add_argument(
        "--calendar", action="store_true", help="write the date of every instant, too (.csv)"
    )
    export.add_argument(
        "--observables", metavar="A,B[1]",
        help="observables to write, or places of them, counted from 1 (.csv, .nc); all if left out",
    )  # fmt: skip
    export.add_argument(
        "--from", dest="first", metavar="T", help="first instant [s], or a date (.csv, .nc)"
    )
    export.add_argument("--to", dest="last", metavar="T", help="last instant [s], or a date (.csv, .nc)")
    export.add_argument(
        "--every", type=float, metavar="DT", help="least time [s] between two rows (.csv, .nc)"
    )
    export.add_argument(
        "--object",
        metavar="NAME",
        help="name of the spacecraft (.oem, .aem); that of the run file if left out",
    )
    export.add_argument(
        "--mission", metavar="ID",
        help="international designator of the spacecraft (.oem, .aem); its name if left out",
    )  # fmt: skip
    export.add_argument(
        "--time-system",
        choices=("UTC", "TDB"),
        help="time scale of the dates (.oem, .aem); UTC if left out",
    )
    export.add_argument("--overwrite", action="store_true", help="replace the file if it exists")


def check(options: argparse.Namespace) -> None:
    """Raises UsageError for an output of another format than those of `esail export`, for an option that
    the format has not, and for an output that exists already."""
    suffix = options.output.suffix.lower()
    if suffix not in FORMATS:
        *most, last = FORMATS
        raise UsageError(f"`-o` must end in {', '.join(most)} or {last}, but ends in {suffix!r}")
    for name in dict.fromkeys(name for names in FORMATS.values() for name in names):
        if getattr(options, name) not in (None, False) and name not in FORMATS[suffix]:
            option = {"first": "from", "last": "to"}.get(name, name.replace("_", "-"))
            raise UsageError(f"`--{option}` must be left out with {suffix}, but is given")
    if options.every is not None and not 0.0 < options.every < math.inf:
        raise UsageError(f"`--every` must be positive, but is {options.every:g}")
    refuse_existing(options.output, options.overwrite)


def run(options: argparse.Namespace) -> ExitCode:
    """Writes a run file in another format, and prints the path and, of a message, a sentence on what it
    holds between its rows. Raises InputError."""
    check(options)
    from esail_jax.atomic_file import atomic_file
    from esail_jax.files.export import check_netcdf

    if options.output.suffix.lower() == NETCDF:
        check_netcdf()
    with atomic_file(options.output) as part:
        said = write(options, part)
    print("\n".join(filter(None, (str(options.output), said))))
    return ExitCode.DONE


def write(options: argparse.Namespace, path: Path) -> str:
    """Writes a run file to a path in the format of the output, and returns what is to be said of it. Raises
    InputError."""
    from esail_jax.files import export, messages
    from esail_jax.files.selection import Selection, columns_of

    observables = None if options.observables is None else columns_of(options.observables)
    selection = Selection(observables, options.first, options.last, options.every)
    suffix = options.output.suffix.lower()
    if suffix == TABLE:
        export.write_csv(options.run, path, options.calendar, selection)
        return ""
    if suffix == NETCDF:
        export.write_netcdf(options.run, path, selection)
        return ""
    named = messages.Named(options.object, options.mission, options.time_system or "UTC")
    form = messages.write_oem if suffix == ORBIT else messages.write_aem
    return form(options.run, path, named)
