"""Instants and time scales: against the library of the IAU (ERFA), and against dates by hand."""

import erfa
import numpy as np
import pytest

from esail_jax.calendar.instants import (
    DAY,
    LEAP_SECONDS,
    Instants,
    after,
    in_scale,
    read_instant,
    seconds_between,
    written,
)
from esail_jax.errors import SceneError

RNG = np.random.default_rng(59)
DAYS = RNG.integers(LEAP_SECONDS[0][0], 62000, 400)
SECONDS = RNG.uniform(0.0, DAY, 400)


def test_leap_seconds_are_those_of_the_library():
    table = erfa.leap_seconds.get()
    known = {(int(x["year"]), int(x["month"])): int(x["tai_utc"]) for x in table if x["year"] >= 1972}
    assert len(known) == len(LEAP_SECONDS)
    for (year, month), value in known.items():
        day = int(read_instant(f"{year}-{month:02d}-01", "x").day)
        assert (day, value) in LEAP_SECONDS


def test_tdb_is_that_of_the_library():
    """To 20 microseconds: the terms that are left out; and back again to rounding."""
    utc = Instants(DAYS, SECONDS, "UTC")
    tdb = in_scale(utc, "TDB")
    tai = erfa.utctai(2400000.5 + DAYS, SECONDS / DAY)
    tt = erfa.taitt(*tai)
    whole, part = erfa.tttdb(*tt, erfa.dtdb(*tt, 0.0, 0.0, 0.0, 0.0))
    error = (whole - 2400000.5 - tdb.day) * DAY + part * DAY - tdb.second
    assert np.abs(error).max() < 2e-5
    back = in_scale(tdb, "UTC")
    assert np.abs(seconds_between(utc, back)).max() < 1e-9


def test_seconds_between_instants_count_leap_seconds():
    """Between two instants of UTC, as TAI counts them; and forward again."""
    start = read_instant("2016-12-31T23:59:50", "x")
    end = read_instant("2017-01-01T00:00:10", "x")
    assert seconds_between(start, end) == 21.0
    assert written(after(start, np.array([9.0, 10.0, 10.5, 11.0, 21.0])), 1) == [
        "2016-12-31T23:59:59.0",
        "2016-12-31T23:59:60.0",
        "2016-12-31T23:59:60.5",
        "2017-01-01T00:00:00.0",
        "2017-01-01T00:00:10.0",
    ]
    leap = read_instant("2016-12-31T23:59:60.25", "x")
    assert seconds_between(start, leap) == 10.25
    assert seconds_between(leap, end) == 10.75
    for scale in ("UTC", "TDB"):
        start = Instants(DAYS, SECONDS, scale)
        later = after(start, 1e3 * SECONDS)
        assert np.abs(seconds_between(start, later) - 1e3 * SECONDS).max() < 1e-6
        assert np.all((later.second >= 0.0) & (later.second < DAY + 1.0))


@pytest.mark.parametrize(
    ("text", "day", "second", "scale"),
    [
        ("2000-01-01T12:00:00", 51544, 43200.0, "UTC"),
        ("2000-01-01 12:00:00.5Z", 51544, 43200.5, "UTC"),
        ("2027-060T06:00", 61465, 21600.0, "UTC"),
        ("2027-03-01", 61465, 0.0, "UTC"),
        ("2027-03-01T00:00:00 TDB", 61465, 0.0, "TDB"),
        ("1963-11-27T00:00:00UTC", 38360, 0.0, "UTC"),
        ("2024-366T23:59:59.999", 60675, 86399.999, "UTC"),
    ],
)
def test_dates_are_read(text, day, second, scale):
    at = read_instant(text, "x")
    assert (int(at.day), float(at.second), at.scale) == (day, second, scale)


@pytest.mark.parametrize(
    "text",
    ["", "tomorrow", "2027-13-01", "2027-02-29", "2027-366", "2027-000", "2027-03-01T24:00:00",
     "2027-03-01T12:60", "2016-12-31T23:59:61", "2027-06-30T23:59:60", "2016-12-31T23:59:60 TDB",
     "2027-03-01T12:00:00 TT", "2027-3-1", "2027-03-01T12:00:00+01:00"],
)  # fmt: skip
def test_what_is_no_date_is_refused(text):
    with pytest.raises(SceneError, match=r"`initial.epoch` must be a"):
        read_instant(text, "initial.epoch")


def test_dates_before_the_seconds_of_today_are_not_converted():
    """Differences in one scale are those of the calendar."""
    first, second = (read_instant(f"1965-01-{d:02d}", "x") for d in (1, 2))
    assert seconds_between(first, second) == DAY
    with pytest.raises(SceneError, match="must be in 1972 or later"):
        in_scale(first, "TDB")


def test_one_instant_is_converted_as_one_of_several():
    for scale, other in (("UTC", "TDB"), ("TDB", "UTC")):
        one = in_scale(Instants(DAYS[7:8].reshape(()), SECONDS[7:8].reshape(()), scale), other)
        all_of_them = in_scale(Instants(DAYS, SECONDS, scale), other)
        assert one.day.shape == one.second.shape == ()
        assert (one.day, one.second) == (all_of_them.day[7], all_of_them.second[7])
        later = after(one, np.array(1e5))
        assert later.day.shape == later.second.shape == ()


def test_rounding_of_a_second_carries():
    """Up to the next day, and at a leap second to the second 60."""
    assert written(read_instant("2027-12-31T23:59:59.9996", "x")) == ["2028-01-01T00:00:00.000"]
    assert written(read_instant("2016-12-31T23:59:59.9996", "x")) == ["2016-12-31T23:59:60.000"]
    assert written(read_instant("2027-12-31T23:59:59.4", "x"), 0) == ["2027-12-31T23:59:59"]
