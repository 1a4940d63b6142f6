"""`esail export`: a run or an ensemble for other programs, as a table, arrays, or a message of flight
dynamics."""

import argparse
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, add_command, refuse_existing


def add(commands: Any) -> None:
    """Adds `esail export`."""
    export = add_command(
        commands,
        "export",
        "write a run or an ensemble for other programs: as a table, as arrays, as an orbit or an attitude",
    )
    export.add_argument(
        "run", type=Path, metavar="RUN.h5", help="run file, or the folder or the file of an ensemble"
    )
    export.add_argument(
        "-o", "--output", required=True, type=Path, metavar="FILE",
        help="file to write: .csv (comma-separated values; of an ensemble a long table with the number "
        "of the member), .nc (netCDF; needs xarray), .zarr (a Zarr store; needs xarray and zarr), .oem or "
        ".aem (messages of the CCSDS with the orbit or the attitude of the hub; of runs with an epoch)",
    )  # fmt: skip
    export.add_argument(
        "--calendar", action="store_true", help="write the date of every instant, too (.csv)"
    )
    export.add_argument(
        "--observables", metavar="A,B[1]",
        help="observables to write, or places of them, counted from 1 (.csv; whole ones: .nc, .zarr); all "
        "if left out",
    )  # fmt: skip
    export.add_argument(
        "--from", dest="first", metavar="T", help="first instant [s], or a date (.csv, .nc, .zarr)"
    )
    export.add_argument(
        "--to", dest="last", metavar="T", help="last instant [s], or a date (.csv, .nc, .zarr)"
    )
    export.add_argument(
        "--every", type=float, metavar="DT", help="least time [s] between two rows (.csv, .nc, .zarr)"
    )
    export.add_argument(
        "--object",
        dest="object_name",
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


def run(options: argparse.Namespace) -> ExitCode:
    """Writes a run or an ensemble in another format, and prints the path and, of a message, a sentence on
    what it holds between its rows. Raises InputError."""
    from esail_jax.files.export import ARGUMENTS, check_format, write

    given = {name: getattr(options, name) for name in ARGUMENTS}
    check_format(options.output, given)
    refuse_existing(options.output, options.overwrite)
    said = write(options.run, options.output, given)
    print("\n".join(filter(None, (str(options.output), said))))
    return ExitCode.DONE
