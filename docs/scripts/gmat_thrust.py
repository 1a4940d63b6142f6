"""Writes the thrust of a run as a thrust history file of GMAT.

    python docs/scripts/gmat_thrust.py sail.csv sail.thrust

The table needs `thrust_O`, `heliocentric_position`, `heliocentric_velocity` and a column of dates in UTC.
The file has one segment, "Segment1", with the thrust of the whole sail [N] in EME2000. What is printed are
the lines of GMAT's script that say where the spacecraft starts [km, km/s]."""

import argparse
import datetime
from pathlib import Path

from run_table import Table, read_table

HEAD = """\
BeginThrust {{Segment1}}
Start_Epoch = {start}
Thrust_Vector_Coordinate_System = EarthMJ2000Eq
Thrust_Vector_Interpolation_Method = CubicSpline
Mass_Flow_Rate_Interpolation_Method = None
ModelThrustOnly
"""


def start_date(table: Table) -> str:
    """The date of the first row as GMAT writes it, in UTC."""
    if table.scale != "UTC":
        raise SystemExit(f"The dates must be in UTC, but are in {table.scale}.")
    first = datetime.datetime.fromisoformat(table.dates[0])
    return f"{first:%d %b %Y %H:%M:%S}.{first.microsecond // 1000:03d}"


def thrust_history(table: Table) -> str:
    """The text of the file. Its times are seconds from the first row of the table."""
    thrust = table.in_eme2000("thrust_O")
    rows = [
        f"{time:.6f} {x:.15e} {y:.15e} {z:.15e}"
        for time, (x, y, z) in zip(table.time - table.time[0], thrust, strict=True)
    ]
    return HEAD.format(start=start_date(table)) + "\n".join(rows) + "\nEndThrust {Segment1}\n"


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("table", type=Path, help="table of the run (.csv)")
    options.add_argument("output", type=Path, help="file to write (.thrust)")
    given = options.parse_args()
    run = read_table(given.table)
    given.output.write_text(thrust_history(run), encoding="ascii")
    print(f"Sail.Epoch = '{start_date(run)}';")
    for key, number in zip(("X", "Y", "Z", "VX", "VY", "VZ"), 1e-3 * run.start(), strict=True):
        print(f"Sail.{key} = {number:.16g};")
