"""The rows of a measured wind as they stand in one file or table, and which of their numbers are none."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from esail_jax.calendar.instants import Instants, in_scale, seconds_between
from esail_jax.errors import SceneError

COLUMNS = ("time", "speed", "number_density")
"""Columns of a CSV file, and keys of [solar_wind] that a file gives."""

WIND_FILE = "solar_wind.file"
"""Key of the name of a file, or of a list of names."""

TIMES = "solar_wind.time"
"""Key of the instants of a wind [s]."""

LARGEST_GAP = "solar_wind.largest_gap"
"""Key of the longest gap that is bridged [s]."""

SI = {"speed": 1e3, "number_density": 1e6}
"""A km/s in m/s, and a number per cubic centimetre in 1/m^3."""

FILLS = {"speed": (9999.0, 99999.9), "number_density": (999.9, 999.99)}
"""The fill values of OMNI's hourly and minute files, in km/s and 1/cm^3: all nines of a word's format."""


class Rows(NamedTuple):
    """The rows of one file or table.

    source: what it is called in a message; form: what sort of file it is; time: seconds of the run [s],
    or instants of the calendar, which increase; speed: [m/s]; number_density: [1/m^3], both NaN where
    there is no number; line: of the file, or index of the table; cadence: time [s] between rows of a file
    without missing lines, None if it has no fixed one; missing: what stands in place of a number, by row;
    unit: what `line` counts."""

    source: str
    form: str
    time: Float[np.ndarray, " row"] | Instants
    speed: Float[np.ndarray, " row"]
    number_density: Float[np.ndarray, " row"]
    line: Int[np.ndarray, " row"]
    cadence: float | None
    missing: dict[int, str]
    unit: str = "line"

    def where(self, row: int) -> str:
        """The place of a row in words: `line 5 of 'wind.csv'`."""
        return f"{self.unit} {self.line[row]} of {self.source}"


def is_fill(key: str, numbers: Float[np.ndarray, " row"]) -> Bool[np.ndarray, " row"]:
    """Tells which numbers of a column are fill values of OMNI, as they stand there or in units of SI. A
    wind of such a speed [m/s] or density [1/m^3] does not exist at the planets."""
    found = np.zeros(numbers.shape, bool)
    for fill in FILLS[key]:
        for value in (fill, fill * SI[key]):
            found |= np.isclose(numbers, value, rtol=1e-12, atol=0.0)
    return found


def seconds_since(epoch: Instants, at: Instants, name: str = TIMES) -> Float[np.ndarray, "*time"]:
    """The seconds [s] from an epoch to instants, in the scale of the epoch: SI seconds for an epoch in UTC,
    seconds of TDB for one in TDB. name: what the instants are called in an error.

    Raises SceneError for instants before 1972 in the other scale."""
    return seconds_between(epoch, in_scale(at, epoch.scale, name))


def first_of(at: Instants) -> Instants:
    """The first of several instants."""
    return Instants(np.asarray(at.day[0]), np.asarray(at.second[0]), at.scale)


def check_increasing(rows: Rows) -> Rows:
    """The rows themselves. Raises SceneError, which names the first row that is not later than the one
    before."""
    time = rows.time
    if isinstance(time, Instants):
        time = seconds_since(first_of(time), time)
    wrong = np.flatnonzero(np.diff(time) <= 0.0)
    if len(wrong):
        row = int(wrong[0]) + 1
        got = f"{rows.where(row)} is not later than {rows.unit} {rows.line[row - 1]}"
        raise SceneError(TIMES, "increase", got)
    return rows
