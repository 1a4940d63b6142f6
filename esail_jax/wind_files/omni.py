"""The text files of the OMNI data set of NASA's Space Physics Data Facility: near-Earth solar wind as
averages over an hour, a minute or five minutes. Numbers of a line are separated by blanks and counted
from 1.

| file | words of a line | date | flow speed [km/s], fill | proton density [1/cm^3], fill |
|---|---|---|---|---|
| `omni2_YYYY.dat`, hourly | 55, 56 or 57 | 1 year, 2 day of the year, 3 hour | 25, 9999. | 24, 999.9 |
| `omni_minYYYYMM.asc`, a minute | 46 | 1 year, 2 day, 3 hour, 4 minute | 22, 99999.9 | 26, 999.99 |
| `omni_5minYYYYMM.asc`, five minutes | 49 | as before | as before | as before |

Sources: `omni2.text` of the hourly data (omniweb.gsfc.nasa.gov/html/ow_data.html) and `hroformat.txt` of
the minute data (spdf.gsfc.nasa.gov/pub/data/omni/high_res_omni). Dates are in UTC. An hourly value is the
average over the hour that the date names, and the date of a minute value is the start of its average: all
values are placed at the middle of what they are averages of. A density counts protons only; the few per
cent of helium are not added."""

import math
from array import array
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from esail_jax.calendar.instants import FIRST_DAYS, Instants
from esail_jax.errors import SceneError
from esail_jax.wind_files.rows import SI, WIND_FILE, Rows, check_increasing


class Word(NamedTuple):
    """A word of a line. number: from 1; fill: what stands there if nothing was measured."""

    number: int
    fill: float


class Form(NamedTuple):
    """A form of file. words: how many a line may have; date: how many words the date has; cadence: time
    [s] between lines."""

    name: str
    words: tuple[int, ...]
    date: int
    speed: Word
    number_density: Word
    cadence: float


FORMS = (
    Form("hourly OMNI file", (55, 56, 57), 3, Word(25, 9999.0), Word(24, 999.9), 3600.0),
    Form("OMNI file of one minute", (46,), 4, Word(22, 99999.9), Word(26, 999.99), 60.0),
    Form("OMNI file of five minutes", (49,), 4, Word(22, 99999.9), Word(26, 999.99), 300.0),
)
"""The forms of files, which differ in the number of words of a line."""

FEWEST = 20
"""Words from which on a line of numbers belongs to no CSV file."""


def is_number(word: str) -> bool:
    """Tells whether a word is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def is_omni(line: str) -> bool:
    """Tells whether the first line of a text is one of OMNI, though perhaps of a form that is not read:
    many numbers between blanks."""
    words = line.split()
    return len(words) >= FEWEST and all(map(is_number, words))


def read_omni(text: str, source: str) -> Rows:
    """The rows of the text of an OMNI file. Lines without words are left out. source: what the file is
    called in a message. Raises SceneError, which names the line that is wrong."""
    lines = text.split("\n")
    first = next(i for i, line in enumerate(lines) if line.strip())
    form = form_of(lines[first].split(), f"line {first + 1} of {source}")
    wanted = itemgetter(*range(form.date), form.speed.number - 1, form.number_density.number - 1)
    line, values = numbers_of(lines, len(lines[first].split()), wanted, source)
    date, (speed, density) = values[:, : form.date], values[:, form.date :].T
    minute = date[:, 3] if form.date == 4 else np.zeros(len(date))
    day, exists = days_of(date[:, 0], date[:, 1])
    exists &= (date == np.floor(date)).all(axis=1) & (date[:, 2] >= 0.0) & (date[:, 2] <= 23.0)
    exists &= (minute >= 0.0) & (minute <= 59.0)
    for wrong, must, part in (
        (~exists, "have dates that exist", slice(form.date)),
        (speed <= 0.0, "have positive speeds", slice(-2, -1)),
        (density < 0.0, "have densities that are not negative", slice(-1, None)),
    ):
        for number in line[wrong][:1].tolist():
            words = " ".join(wanted(lines[number - 1].split())[part])
            raise SceneError(WIND_FILE, must, f"line {number} of {source} has {words!r}")
    missing = dict[int, str]()
    for key, column, word in (
        ("speed", speed, form.speed),
        ("number_density", density, form.number_density),
    ):
        absent = column == word.fill
        missing |= dict.fromkeys(np.flatnonzero(absent).tolist(), f"{key} is the fill value {word.fill}")
        column[:] = np.where(absent, np.nan, SI[key] * column)
    second = 3600.0 * date[:, 2] + 60.0 * minute + 0.5 * form.cadence
    time = Instants(day, second, "UTC")
    return check_increasing(Rows(source, form.name, time, speed, density, line, form.cadence, missing))


def numbers_of(
    lines: list[str], count: int, wanted: itemgetter, source: str
) -> tuple[Int[np.ndarray, " row"], Float[np.ndarray, "row word"]]:
    """The numbers of the lines that have words, counted from 1, and the values of the wanted words. count:
    of words in every line. Raises SceneError, which names the first line with other words."""
    numbers, at = array("d"), array("q")
    for number, line in enumerate(lines, 1):
        words = line.split()
        if not words:
            continue
        where = f"line {number} of {source} has"
        if len(words) != count:
            raise SceneError(WIND_FILE, f"have {count} words in every line", f"{where} {len(words)}")
        chosen = wanted(words)
        try:
            values = [float(word) for word in chosen]
        except ValueError:
            values = [math.nan]
        if not all(map(math.isfinite, values)):
            must = "have numbers for date, speed and density"
            raise SceneError(WIND_FILE, must, f"{where} {' '.join(chosen)!r}")
        numbers.extend(values)
        at.append(number)
    return np.array(at, np.int64), np.array(numbers).reshape(len(at), -1)


def form_of(words: list[str], where: str) -> Form:
    """The form of a file by the words of its first line. where: the line, as a message names it. Raises
    SceneError for another number of words than any form has."""
    for form in FORMS:
        if len(words) in form.words:
            return form
    must = "have 55 to 57 words in a line (hourly OMNI file), 46 (of one minute) or 49 (of five minutes)"
    raise SceneError(WIND_FILE, must, f"{where} has {len(words)}")


def days_of(
    year: Float[np.ndarray, " row"], day: Float[np.ndarray, " row"]
) -> tuple[np.ndarray, Bool[np.ndarray, " row"]]:
    """The Modified Julian Dates of days of years, and which of them exist."""
    possible = (year >= 1900.0) & (year <= 2200.0) & (day >= 1.0) & (day <= 366.0)
    years = (np.where(possible, year, 2000.0).astype(int) - 1970).astype("datetime64[Y]")
    days = years.astype("datetime64[D]") + (np.where(possible, day, 1.0).astype(int) - 1)
    return (days - FIRST_DAYS).astype(int), possible & (days.astype("datetime64[Y]") == years)
