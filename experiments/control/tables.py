"""Writing of the tables of this folder."""

import csv
from pathlib import Path


def write(name, header, rows):
    """Writes a table beside this file."""
    with Path(__file__).with_name(name).open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows([[f"{x:.6g}" if isinstance(x, float) else x for x in row] for row in rows])
