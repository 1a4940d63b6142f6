"""Instants of the calendar in two time scales, and the SI seconds between them.

UTC is the time of clocks: its days have 86,400 s, but for those that end with a leap second. TDB is the
time of ephemerides of the solar system; it runs with terrestrial time TT = TAI + 32.184 s, apart from
periodic terms below 2 ms, here those of U.S. Naval Observatory Circular 179 (2005), Eq. 2.6, right to 10
microseconds from 1600 to 2200. The leap seconds are those of IERS Bulletin C 70; none is announced after
2017, and none is assumed.

An instant is a day, as Modified Julian Date, and the seconds of that day: seconds of an epoch of today in
one number would be rounded to a tenth of a microsecond."""

import re
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from esail_jax.errors import SceneError

Scale = Literal["UTC", "TDB"]

EPOCH = "initial.epoch"
"""Key of the date of t = 0."""

DAY = 86400.0
"""Seconds of a day without a leap second."""

LEAP_SECONDS = (
    (41317, 10), (41499, 11), (41683, 12), (42048, 13), (42413, 14), (42778, 15), (43144, 16), (43509, 17),
    (43874, 18), (44239, 19), (44786, 20), (45151, 21), (45516, 22), (46247, 23), (47161, 24), (47892, 25),
    (48257, 26), (48804, 27), (49169, 28), (49534, 29), (50083, 30), (50630, 31), (51179, 32), (53736, 33),
    (54832, 34), (56109, 35), (57204, 36), (57754, 37),
)  # fmt: skip
"""Days [MJD] from whose start on TAI - UTC has the given value [s]."""

TT_MINUS_TAI = 32.184
J2000 = 51544.5
"""2000-01-01T12:00:00 [MJD]."""

TDB_TERMS = (
    (0.001657, 628.3076, 6.2401), (0.000022, 575.3385, 4.2970), (0.000014, 1256.6152, 6.1969),
    (0.000005, 606.9777, 4.0212), (0.000005, 52.9691, 0.4444), (0.000002, 21.3299, 5.5431),
)  # fmt: skip
"""Amplitude [s], rate [rad per century] and phase [rad] of the periodic terms of TDB - TT."""

GROWING = 0.000010, 628.3076, 4.2490
"""The term whose amplitude grows with the centuries since J2000."""

FIRST_DAYS = np.datetime64("1858-11-17", "D")
"""The day zero of the Modified Julian Date."""

PATTERN = re.compile(
    r"(?P<year>\d{4})-(?:(?P<month>\d{2})-(?P<day>\d{2})|(?P<ordinal>\d{3}))"
    r"(?:[T ](?P<hour>\d{2}):(?P<minute>\d{2})(?::(?P<second>\d{2}(?:\.\d*)?))?)?"
    r"(?:Z| ?(?P<scale>UTC|TDB))?"
)


MUST = 'be a date such as "2027-03-01T12:00:00" or "2027-03-01T12:00:00 TDB"'


class Instants(NamedTuple):
    """One instant or several. day: Modified Julian Date; second: of that day [s]; scale: of both."""

    day: Int[np.ndarray, "*time"]
    second: Float[np.ndarray, "*time"]
    scale: Scale


def leap_seconds(day: Int[np.ndarray, "*time"]) -> Int[np.ndarray, "*time"]:
    """TAI - UTC [s] on days [MJD]; before 1972, when UTC had other seconds, that of its first day."""
    days, values = np.array(LEAP_SECONDS).T
    return np.asarray(values[np.maximum(np.searchsorted(days, day, side="right") - 1, 0)])


def normalised(day: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Day and second of day, of days of 86,400 s."""
    whole = np.asarray(np.floor(second / DAY))
    return np.asarray(day + whole.astype(int)), np.asarray(second - DAY * whole)


def read_instant(text: str, name: str) -> Instants:
    """The instant of a date in the form of ISO 8601, with the month and the day or with the day of the
    year: `2027-03-01T12:00:00`, `2027-060T12:00`, `2027-03-01`. It is in UTC, unless it ends with TDB.
    name: what the date is called in an error.

    Raises SceneError for another form, and for a date that does not exist."""
    found = PATTERN.fullmatch(text.strip())
    if found is None:
        raise SceneError(name, MUST, f"is {text!r}")
    scale: Scale = "TDB" if found["scale"] == "TDB" else "UTC"
    day = day_of(found)
    if day is None:
        raise SceneError(name, "be a date that exists", f"is {text!r}")
    hour, minute, second = int(found["hour"] or 0), int(found["minute"] or 0), float(found["second"] or 0.0)
    last = hour == 23 and minute == 59 and scale == "UTC" and has_leap_second(day)
    if hour > 23 or minute > 59 or second >= (61.0 if last else 60.0):
        raise SceneError(name, "be an instant that exists", f"is {text!r}")
    return Instants(np.array(day), np.array(3600.0 * hour + 60.0 * minute + second), scale)


def day_of(found: re.Match[str]) -> int | None:
    """The day [MJD] of the parts of a date; None for one that does not exist."""
    year = np.datetime64(found["year"], "Y")
    if found["ordinal"]:
        date = year.astype("datetime64[D]") + int(found["ordinal"]) - 1
        return None if date.astype("datetime64[Y]") != year else int((date - FIRST_DAYS).astype(int))
    try:
        date = np.datetime64(f"{found['year']}-{found['month']}-{found['day']}", "D")
    except ValueError:
        return None
    return int((date - FIRST_DAYS).astype(int))


def has_leap_second(day: int) -> bool:
    """Tells whether a day of UTC [MJD] ends with a leap second."""
    return any(day + 1 == start for start, _ in LEAP_SECONDS[1:])


def tdb_minus_tt(day: Float[np.ndarray, "*time"]) -> Float[np.ndarray, "*time"]:
    """TDB - TT [s] at days and their parts [MJD]."""
    centuries = (day - J2000) / 36525.0
    size, rate, phase = GROWING
    terms = [a * np.sin(w * centuries + p) for a, w, p in TDB_TERMS]
    return np.asarray(sum(terms, size * centuries * np.sin(rate * centuries + phase)))


def in_scale(at: Instants, scale: Scale, name: str = "the instant") -> Instants:
    """Instants in another scale. name: what they are called in an error. Raises SceneError for instants
    before 1972, when UTC had other seconds."""
    if at.scale == scale:
        return at
    if np.any(at.day < LEAP_SECONDS[0][0]):
        raise SceneError(name, "be in 1972 or later to be converted", "is earlier")
    if scale == "TDB":
        tt = np.asarray(at.second + leap_seconds(at.day) + TT_MINUS_TAI)
        tdb = np.asarray(tt + tdb_minus_tt(np.asarray(at.day + tt / DAY)))
        return Instants(*normalised(at.day, tdb), "TDB")
    tai = at.second - tdb_minus_tt(np.asarray(at.day + at.second / DAY)) - TT_MINUS_TAI
    return utc_of_tai(*normalised(at.day, np.asarray(tai)))


def utc_of_tai(day: np.ndarray, second: np.ndarray) -> Instants:
    """Instants of UTC from day and second of TAI. Within a leap second the second of the day is 86,400 or
    more."""
    first, _ = normalised(day, np.asarray(second - leap_seconds(day)))
    # The day before a leap second has the value of TAI - UTC before it.
    before, earlier = normalised(day, np.asarray(second - leap_seconds(first)))
    inside = (before > first) & (leap_seconds(before) != leap_seconds(first))
    return Instants(
        np.where(inside, first, before), np.where(inside, earlier + DAY * (before - first), earlier), "UTC"
    )


def seconds_between(start: Instants, end: Instants) -> Float[np.ndarray, "*time"]:
    """The SI seconds from one instant to others, which are in the same scale. A second of TDB differs from
    it by 3e-10 at most."""
    seconds = DAY * (end.day - start.day) + (end.second - start.second)
    if start.scale != end.scale:
        raise ValueError(f"scales must be the same, but are {start.scale} and {end.scale}")
    if start.scale == "UTC":
        seconds = seconds + (leap_seconds(end.day) - leap_seconds(start.day))
    return np.asarray(seconds)


def after(start: Instants, seconds: Float[np.ndarray, "*time"]) -> Instants:
    """The instants that are seconds [s] after another one, in its scale."""
    if start.scale == "TDB":
        return Instants(*normalised(start.day, np.asarray(start.second + seconds)), "TDB")
    second = start.second + leap_seconds(start.day) + seconds
    return utc_of_tai(*normalised(start.day, np.asarray(second)))


def written(at: Instants, digits: int = 3) -> list[str]:
    """Dates in the form of ISO 8601 without the name of the scale, with decimals of the second."""
    unit = 10**digits
    day, second = (np.atleast_1d(x) for x in (at.day, at.second))
    ticks = np.round(second * unit).astype(int)
    leap = np.array([at.scale == "UTC" and has_leap_second(int(d)) for d in day])
    over = ticks >= (np.where(leap, DAY + 1.0, DAY) * unit).astype(int)
    day, ticks = day + over, np.where(over, 0, ticks)
    texts = []
    for d, tick in zip(day, ticks, strict=True):
        whole, part = divmod(int(tick), unit)
        minutes = min(whole // 60, 1439)
        date = FIRST_DAYS + int(d)
        clock = f"{minutes // 60:02d}:{minutes % 60:02d}:{whole - 60 * minutes:02d}"
        texts.append(f"{date}T{clock}" + (f".{part:0{digits}d}" if digits else ""))
    return texts


# ---- the dates of a run -------------------------------------------------------------------------


def dated(epoch: str, seconds: Float[np.ndarray, "*time"], digits: int = 3) -> list[str]:
    """The dates of instants of a run [s], in the time scale of its epoch, with decimals of the second."""
    return written(after(read_instant(epoch, EPOCH), seconds), digits)


def without_leap_seconds(epoch: str) -> Instants:
    """The instant of an epoch in a calendar that has no leap seconds, such as those of netCDF and of
    figures: within one it is in the first second of the next day."""
    at = read_instant(epoch, EPOCH)
    return Instants(*normalised(at.day, at.second), at.scale)


def with_scale(epoch: str) -> str:
    """An epoch as it was given, with its time scale at the end."""
    scale = read_instant(epoch, EPOCH).scale
    return f"{epoch.removesuffix('Z').removesuffix(scale).rstrip()} {scale}"
