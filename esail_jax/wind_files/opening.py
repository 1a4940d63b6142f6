"""Files of a wind are opened, and recognised by their form, not by their name."""

from pathlib import Path

from esail_jax.errors import SceneError
from esail_jax.wind_files.cdf import is_cdf, read_cdf
from esail_jax.wind_files.csv_rows import MUST, numbered_cells, read_csv, separator_of
from esail_jax.wind_files.omni import is_omni, read_omni
from esail_jax.wind_files.rows import COLUMNS, WIND_FILE, Rows

HEAD = 4096
"""Bytes of a file that show its form."""


def read_rows(name: str, folder: Path) -> Rows:
    """The rows of a file. folder: where a relative name starts. Raises SceneError for a file that cannot be
    read, or is no file of a wind, in one line that names the line that is wrong."""
    path = folder / name
    try:
        with open(path, "rb") as file:
            head = file.read(HEAD)
        if is_cdf(head):
            return read_cdf(path, repr(name))
        with open(path, newline="", encoding="utf-8-sig") as file:
            text = file.read()
    except SceneError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "is not text"
        raise SceneError(WIND_FILE, MUST, f"{name!r} cannot be read: {reason}") from None
    return (read_omni if is_omni(first_line(text)) else read_csv)(text, repr(name))


def first_line(text: str) -> str:
    """The first line of a text that is not blank."""
    return next((line for line in text.split("\n") if line.strip()), "")


def is_wind_file(path: Path) -> bool:
    """Tells whether a path is that of a file of a wind: a CDF file, one whose first line is that of an OMNI
    file or has the names of the columns, or one that ends in .csv, for which reading says what it lacks."""
    try:
        with open(path, "rb") as file:
            head = file.read(HEAD)
    except OSError:
        return False
    line = first_line(head.decode("utf-8-sig", errors="replace"))
    if is_cdf(head) or is_omni(line) or path.suffix.lower() == ".csv":
        return True
    try:
        cells = numbered_cells(line, repr(str(path)), separator_of(line))
    except SceneError:
        return False
    return bool(cells) and sorted(cells[0][1]) == sorted(COLUMNS)
