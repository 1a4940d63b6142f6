"""Measured wind in files of OMNI and CSV files, several of them, with gaps and dates, and from Python."""

import datetime
import re

import jax
import jax.numpy as jnp
import numpy as np
import pandas
import pytest
import xarray

import esail_jax as esail
from esail_jax import cli
from esail_jax.constants import PROTON_MASS
from esail_jax.plotting.wind import draw_wind
from esail_jax.scenes.loading import builtin_text, parse
from esail_jax.scenes.overrides import Request, with_wind_file
from esail_jax.scenes.toml_text import to_toml
from esail_jax.wind_files.summary import read_wind
from support.new_process import heavy_imports_of

HEAD = "time,speed,number_density"
HOUR = 3600.0


def hourly(year, day, hour, speed, density, words=55):
    """A line of `omni2_YYYY.dat`: word 24 is the density, word 25 the speed."""
    line = [str(year), f"{day:3d}", f"{hour:2d}", *["7"] * 20, f"{density:.1f}", f"{speed:.0f}."]
    return " ".join(line + ["8"] * (words - len(line)))


def minute(year, day, hour, minute, speed, density, words=46):
    """A line of `omni_minYYYYMM.asc`: word 22 is the speed, word 26 the density."""
    line = [str(year), f"{day:3d}", f"{hour:2d}", f"{minute:2d}", *["7"] * 17, f"{speed:.1f}"]
    line += ["-350.0", "3.5", "4.5", f"{density:.2f}"]
    return " ".join(line + ["8"] * (words - len(line)))


DAY_60 = [hourly(2020, 60, hour, 400 + hour, 5.0 + hour) for hour in range(24)]
"""29 February 2020, hour by hour."""


@pytest.fixture
def wind(tmp_path):
    """Writes files and returns the table that a scene takes from them, or of which message it is refused.

    files: text by name; epoch, t_end, largest_gap: of the scene."""

    def table(files, t_end=2 * HOUR, epoch=None, largest_gap=None, names=None):
        for name, lines in files.items():
            text = lines if isinstance(lines, bytes) else ("\n".join(lines) + "\n").encode()
            (tmp_path / name).write_bytes(text)
        file = names or list(files)
        tables = {"solar_wind": {"file": file[0] if len(file) == 1 else file, "cutoff_voltage": 1e3}}
        tables["integrator"] = {"t_end": t_end}
        if largest_gap is not None:
            tables["solar_wind"]["largest_gap"] = largest_gap
        if epoch is not None:
            tables["initial"] = {"epoch": epoch}
        result = with_wind_file(Request(tables, {}, tmp_path)).tables["solar_wind"]
        assert result.pop("cutoff_voltage") == 1e3 and not {"file", "largest_gap"} & set(result)
        return result

    return table


def refused(wind, *arguments, **options):
    """The message of a refusal, which is one line."""
    with pytest.raises(esail.SceneError) as error:
        wind(*arguments, **options)
    assert "\n" not in str(error.value)
    return str(error.value)


# ---- files of OMNI ------------------------------------------------------------------------------


def test_the_words_of_a_measured_hour_have_the_flow_pressure_of_another_word(wind):
    """A line of `omni2_2025.dat`: word 29 is the flow pressure m_p n u^2 (1 + 4 r) [nPa] with the ratio of
    alpha particles r, word 28."""
    line = (
        "2025   1  0 2610 51 52  61  26  13.6  12.8 -15.3 129.0  -7.7   9.6  -3.4  10.1  -1.0   0.7   4.6"
        "   3.2   2.4   2.4  178561.  19.6  427.  -4.5   5.9 0.029  6.66   45580.   2.3    5.   1.0   1.5"
        " 0.002   0.43   1.35   7.0 40 198   -26  287 999999.99 99999.99 99999.99 99999.99 99999.99"
        " 99999.99  0  27 211.9 999.9  -187   100  4.7"
    )
    table = wind({"a": [line, line.replace("1  0", "1  1", 1)]}, HOUR, "2025-01-01T00:30")
    pressure = PROTON_MASS * table["number_density"][0] * table["speed"][0] ** 2 * (1.0 + 4.0 * 0.029)
    assert abs(pressure / 6.66e-9 - 1.0) < 5e-3  # the density has three digits


@pytest.mark.parametrize("words", [55, 56, 57])
def test_hourly_values_stand_in_the_middle_of_their_hour(wind, words):
    """Only the rows are kept between which the run lies: that of 00:30 is the last one before 01:00."""
    lines = [hourly(2020, 60, hour, 400 + hour, 5.0 + hour, words) for hour in range(24)]
    table = wind({"any.name": lines}, epoch="2020-02-29T01:00:00")
    assert table == {
        "time": [-1800.0, 1800.0, 5400.0, 9000.0],
        "speed": [400e3, 401e3, 402e3, 403e3],
        "number_density": [5e6, 6e6, 7e6, 8e6],
    }


@pytest.mark.parametrize(("words", "step"), [(46, 60.0), (49, 300.0)])
def test_minute_values_stand_in_the_middle_of_the_minutes_that_begin_at_their_date(wind, words, step):
    lines = [minute(2003, 301, 23, int(m * step / 60), 500.5, 3.25 + m, words) for m in range(12)]
    table = wind({"omni.asc": lines}, t_end=2 * step, epoch="2003-10-28T23:05:30Z")
    assert np.allclose(np.diff(table["time"]), step, rtol=0, atol=0)
    first = {46: 0.0, 49: -180.0}[words]  # the middle of 23:05 to 23:06; that of 23:00 to 23:05
    assert table["time"][0] == first and table["speed"][0] == 500.5e3
    assert table["number_density"][0] == {46: 8.25e6, 49: 3.25e6}[words]
    assert len(table["time"]) == {46: 3, 49: 4}[words]


def test_a_leap_day_lies_between_its_neighbours(wind):
    """Day 60 of 2020 is 29 February, of 2021 it is 1 March."""
    table = wind({"a": [hourly(2020, d, h, 400, 5) for d in (59, 60, 61) for h in range(24)]}, 86400.0,
                 "2020-02-29T00:30")  # fmt: skip
    assert table["time"] == [HOUR * i for i in range(25)]
    text = [hourly(2021, 60, h, 400, 5) for h in range(24)]
    assert wind({"b": text}, HOUR, "2021-03-01T00:30")["time"] == [0.0, HOUR]
    message = refused(
        wind, {"c": [hourly(2021, 366, 0, 400, 5), hourly(2022, 1, 0, 400, 5)]}, 1.0, "2021-12-31"
    )
    assert message == "`solar_wind.file` must have dates that exist, but line 1 of 'c' has '2021 366 0'"


def test_an_epoch_of_tdb_is_69_seconds_before_the_same_date_of_utc(wind):
    """TDB - UTC is 32.184 s and 37 leap seconds in 2020, but for 2 ms."""
    table = wind({"a": DAY_60}, epoch="2020-02-29T01:30:00 TDB")
    assert np.allclose(table["time"], np.array([-HOUR, 0.0, HOUR, 2 * HOUR]) + 69.184, rtol=0, atol=2e-3)


def test_a_leap_second_makes_an_hour_longer(wind):
    lines = [hourly(2016, 366, 23, 400, 5), hourly(2017, 1, 0, 401, 6), hourly(2017, 1, 1, 402, 7)]
    assert wind({"a": lines}, epoch="2016-12-31T23:30")["time"] == [0.0, 3601.0, 7201.0]


@pytest.mark.parametrize("end", [b"\r\n", b"\n"])
def test_line_ends_and_a_byte_order_mark_change_nothing(wind, end):
    text = b"\xef\xbb\xbf" + end.join(line.encode() for line in DAY_60) + end + end
    expected = wind({"a": DAY_60}, epoch="2020-02-29T01:00")
    assert wind({"b": text}, epoch="2020-02-29T01:00") == expected
    csv = end.join([b"\xef\xbb\xbftime,speed,number_density", b"0,4e5,7e6", b"7200,4.1e5,6e6"])
    assert wind({"c": csv}) == {"time": [0.0, 7200.0], "speed": [4e5, 4.1e5], "number_density": [7e6, 6e6]}


def test_dates_need_an_epoch(wind):
    expected = "`initial.epoch` must be given with a wind file of calendar times, but is missing"
    assert refused(wind, {"a": DAY_60}) == expected
    assert refused(wind, {"b": ["time,speed,number_density", "2020-02-29,4e5,7e6"]}) == expected
    message = refused(wind, {"a": DAY_60}, epoch="tomorrow")
    assert message.startswith("`initial.epoch` must be a date such as")


def test_a_run_longer_than_the_file_is_refused_with_both_spans(wind):
    expected = (
        "`solar_wind.file` must have numbers from 2020-02-29T23:00:00 (t = 0) to 2020-03-01T01:00:00 "
        "(`integrator.t_end`), but has them from 2020-02-29T00:30:00 to 2020-02-29T23:30:00"
    )
    assert refused(wind, {"a": DAY_60}, epoch="2020-02-29T23:00") == expected
    assert "t = 0" in refused(wind, {"a": DAY_60}, epoch="2020-02-29T00:29:59")
    fills = [hourly(2020, 60, hour, 9999, 999.9) for hour in range(4)]
    assert refused(wind, {"a": fills}, epoch="2020-02-29T01:00").endswith("but has none")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({2: hourly(2020, 60, 1, 400, 5)},
         "`solar_wind.time` must increase, but line 3 of 'a' is not later than line 2"),
        ({1: hourly(2020, 60, 1, 400, 5)[:-2]},
         "`solar_wind.file` must have 55 words in every line, but line 2 of 'a' has 54"),
        ({1: hourly(2020, 60, 24, 400, 5)},
         "`solar_wind.file` must have dates that exist, but line 2 of 'a' has '2020 60 24'"),
        ({1: hourly(2020, 60, 1, -400, 5)},
         "`solar_wind.file` must have positive speeds, but line 2 of 'a' has '-400.'"),
        ({1: hourly(2020, 60, 1, 400, -5)},
         "`solar_wind.file` must have densities that are not negative, but line 2 of 'a' has '-5.0'"),
        ({1: hourly(2020, 60, 1, 400, 5).replace("400.", "fast")},
         "`solar_wind.file` must have numbers for date, speed and density, but line 2 of 'a' has "
         "'2020 60 1 fast 5.0'"),
        ({0: hourly(2020, 60, 0, 400, 5, 50)},
         "`solar_wind.file` must have 55 to 57 words in a line (hourly OMNI file), 46 (of one minute) or "
         "49 (of five minutes), but line 1 of 'a' has 50"),
    ],
)  # fmt: skip
def test_the_line_of_omni_that_is_wrong_is_named(wind, change, message):
    lines = [change.get(i, line) for i, line in enumerate(DAY_60)]
    assert refused(wind, {"a": lines}, epoch="2020-02-29T01:00") == message


# ---- gaps ---------------------------------------------------------------------------------------


FILLED = [
    hourly(2020, 60, h, 9999 if h == 4 else 400 + h, 999.9 if h in (5, 6) else 5 + h) for h in range(24)
]
"""Three hours, 04:30 to 06:30, lack a number; the rows before and behind are four hours apart."""


@pytest.mark.parametrize("largest_gap", [None, 4 * HOUR - 1.0])
def test_a_gap_is_refused_with_its_first_and_last_instant_and_the_key(wind, largest_gap):
    """Fill values are no numbers: a speed of 9999 km/s would blow the sail away."""
    got = "is missing" if largest_gap is None else "is 14399"
    assert refused(wind, {"a": FILLED}, 6 * HOUR, "2020-02-29T02:00", largest_gap) == (
        "`solar_wind.largest_gap` must be at least 14400 (s) to bridge the gap from 2020-02-29T04:30:00 to "
        f"2020-02-29T06:30:00 (line 5 of 'a': speed is the fill value 9999.0), but {got}"
    )


def test_a_gap_is_bridged_by_a_straight_line(wind):
    table = wind({"a": FILLED}, 6 * HOUR, "2020-02-29T03:30", 4 * HOUR)
    assert table["time"] == [0.0, 4 * HOUR, 5 * HOUR, 6 * HOUR]
    assert table["speed"] == [403e3, 407e3, 408e3, 409e3]
    assert np.isclose(np.interp(2 * HOUR, table["time"], table["number_density"]), 10e6)


@pytest.mark.parametrize(("epoch", "hours"), [("2020-02-29T07:30", 3.0), ("2020-02-29T00:30", 3.0)])
def test_a_gap_outside_the_run_is_no_matter(wind, epoch, hours):
    assert len(wind({"a": FILLED}, hours * HOUR, epoch)["time"]) == 4


@pytest.mark.parametrize(("epoch", "hours"), [("2020-02-29T05:00", 4.0), ("2020-02-29T02:30", 2.0)])
def test_a_gap_over_an_end_of_the_run_matters(wind, epoch, hours):
    """The run would begin, or end, on the straight line."""
    message = refused(wind, {"a": FILLED}, hours * HOUR, epoch)
    assert "from 2020-02-29T04:30:00 to 2020-02-29T06:30:00" in message
    table = wind({"a": FILLED}, hours * HOUR, epoch, 4 * HOUR)
    assert table["time"][0] <= 0.0 and table["time"][-1] >= hours * HOUR


def test_missing_lines_are_a_gap(wind):
    lines = [minute(2010, 1, 0, m, 400, 5) for m in range(60) if m not in (20, 21)]
    message = refused(wind, {"a": lines}, 1800.0, "2010-01-01T00:10")
    assert message == (
        "`solar_wind.largest_gap` must be at least 180 (s) to bridge the gap from 2010-01-01T00:20:30 to "
        "2010-01-01T00:21:30 (nothing after line 20 of 'a'), but is missing"
    )
    table = wind({"a": lines}, 1800.0, "2010-01-01T00:10", 180.0)
    assert np.diff(table["time"]).max() == 180.0


@pytest.mark.parametrize(("speed", "density"), [(99999.9, 5.0), (400.0, 999.99)])
def test_fills_of_minutes_are_all_nines_of_their_words(wind, speed, density):
    lines = [minute(2010, 1, 0, m, 400, 5) for m in range(9)]
    lines[4] = minute(2010, 1, 0, 4, speed, density)
    assert "at least 120 (s)" in refused(wind, {"a": lines}, 240.0, "2010-01-01T00:02")
    table = wind({"a": lines}, 240.0, "2010-01-01T00:02:30", 120.0)
    assert table["time"] == [0.0, 60.0, 180.0, 240.0] and set(table["speed"]) == {4e5}


@pytest.mark.parametrize("largest_gap", [-1.0, 0.0, "1 h", np.inf])
def test_a_largest_gap_is_a_positive_number(wind, largest_gap):
    message = refused(wind, {"a": FILLED}, epoch="2020-02-29T01:00", largest_gap=largest_gap)
    assert message.startswith("`solar_wind.largest_gap` must be ")


# ---- several files ------------------------------------------------------------------------------


def test_two_years_in_any_order_are_one_wind(wind):
    new = [hourly(2021, 1, h, 500 + h, 5) for h in range(24)]
    old = [hourly(2020, 366, h, 400 + h, 5) for h in range(24)]
    table = wind({"new": new, "old": old}, epoch="2020-12-31T22:30", t_end=2.5 * HOUR)
    assert table["time"] == [0.0, HOUR, 2 * HOUR, 3 * HOUR]
    assert table["speed"] == [422e3, 423e3, 500e3, 501e3]


def test_a_gap_between_two_files_is_one(wind):
    files = {"b": [hourly(2020, 61, h, 400, 5) for h in range(1, 9)], "a": DAY_60}
    message = refused(wind, files, epoch="2020-02-29T23:00", t_end=3 * HOUR)
    assert "gap from 2020-03-01T00:30:00 to 2020-03-01T00:30:00 (nothing after line 24 of 'a')" in message


@pytest.mark.parametrize(
    ("date", "epoch", "hours", "gap"),
    [
        ("2020-02-28T20:30", "2020-02-28T20:30", 4.0, "2020-02-28T20:30:00 to 2020-02-28T23:30:00"),
        ("2020-03-01T02:30", "2020-02-29T23:30", 3.0, "2020-03-01T00:30:00 to 2020-03-01T02:30:00"),
    ],
)
def test_files_of_several_forms_are_one_wind(wind, date, epoch, hours, gap):
    """Hours of OMNI are missing between its file and a CSV file that has one row, before or behind it."""
    files = {"omni": DAY_60, "csv": [HEAD, f"{date},3e5,4e6"]}
    assert f"at least {3600 * hours:g} (s) to bridge the gap from {gap}" in refused(
        wind, files, epoch=epoch
    )
    table = wind(files, epoch=epoch, t_end=hours * HOUR, largest_gap=hours * HOUR)
    assert table["time"] == [0.0, hours * HOUR]


@pytest.mark.parametrize("hour", [22, 23])
def test_files_that_overlap_are_refused_with_both_names(wind, hour):
    files = {"a": DAY_60, "b": [hourly(2020, 60, hour, 400, 5), hourly(2020, 61, 0, 400, 5)]}
    assert refused(wind, files, epoch="2020-02-29T01:00") == (
        "`solar_wind.file` must name files whose times do not overlap, but 'a' reaches to "
        f"2020-02-29T23:30:00 and 'b' begins at 2020-02-29T{hour}:30:00"
    )


@pytest.mark.parametrize("file", [[], [3.0], None, {"a": 1}])
def test_what_is_no_list_of_names_is_refused(file):
    overrides = {"solar_wind.file": file}
    with pytest.raises(esail.SceneError):
        with_wind_file(Request({}, overrides | {"solar_wind.largest_gap": 1.0}, None))


def test_a_year_of_minutes_becomes_the_table_of_a_run(wind):
    """Of two days of minutes, a run of ten minutes keeps eleven."""
    lines = [minute(2010, d, h, m, 400, 5) for d in (1, 2) for h in range(24) for m in range(60)]
    assert len(wind({"a": lines}, 600.0, "2010-01-02T00:00:30")["time"]) == 11


@pytest.mark.parametrize("name", ["time", "speed", "number_density"])
def test_values_under_a_trace_are_refused_as_such(name):
    """They have no numbers that could be checked."""
    table = {"time": TIME, "speed": SPEED, "number_density": DENSITY}

    def total(factor):
        return sum(esail.wind(**table | {name: factor * jnp.asarray(table[name])}).values())

    with pytest.raises(esail.SceneError, match=f"`{name}` must be .*, but is traced by JAX"):
        jax.grad(total)(1.0)


def test_a_masked_date_is_none():
    times = np.ma.array(np.datetime64("2027-03-01", "s") + np.arange(len(SPEED)), mask=False)
    times[1] = np.ma.masked
    with pytest.raises(esail.SceneError, match="`time` must be finite, but is NaT at index 1"):
        esail.wind(times, SPEED, DENSITY, epoch="2027-03-01")


# ---- CSV files ----------------------------------------------------------------------------------


def test_a_file_of_seconds_is_kept_whole(wind):
    """As it always was: a run can then be continued."""
    lines = [HEAD, "-100,3e5,5e6", "0,4e5,7e6", "10,4.1e5,6e6", "999,3.9e5,0"]
    assert wind({"a": lines}, 5.0) == {
        "time": [-100.0, 0.0, 10.0, 999.0],
        "speed": [3e5, 4e5, 4.1e5, 3.9e5],
        "number_density": [5e6, 7e6, 6e6, 0.0],
    }


def test_decimal_commas_between_semicolons(wind):
    lines = ["time;speed;number_density", "0;4,5e5;7e6", "7200,5;400000,25;6,5e6"]
    assert wind({"a": lines}) == {
        "time": [0.0, 7200.5], "speed": [4.5e5, 400000.25], "number_density": [7e6, 6.5e6]
    }  # fmt: skip
    message = refused(wind, {"b": ["time;speed;number_density", "0;1.234,5;7e6"]})
    assert message == "`solar_wind.speed` must be finite, but line 2 of 'b' has '1.234,5'"


@pytest.mark.parametrize(
    ("row", "why"),
    [
        ("200,,7e6", "speed is empty"),
        ("200, ,7e6", "speed is empty"),
        ("200,4e5,NaN", "number_density is NaN"),
        ("200,9999.,7e6", "speed is the fill value 9999."),
        ("200,99999.9,7e6", "speed is the fill value 99999.9"),
        ("200,9999e3,7e6", "speed is the fill value 9999e3"),
        ("200,4e5,999.9", "number_density is the fill value 999.9"),
        ("200,4e5,999.99e6", "number_density is the fill value 999.99e6"),
    ],
)
def test_cells_without_a_number_are_gaps_named_for_what_they_are(wind, row, why):
    lines = [HEAD, "0,4e5,7e6", "100,4e5,7e6", row, "300,4.2e5,6e6", "400,4e5,7e6"]
    assert refused(wind, {"a": lines}, 300.0) == (
        "`solar_wind.largest_gap` must be at least 200 (s) to bridge the gap from 200 s to 200 s "
        f"(line 4 of 'a': {why}), but is missing"
    )
    assert wind({"a": lines}, 300.0, largest_gap=200.0)["time"] == [0.0, 100.0, 300.0]
    assert wind({"a": lines}, 100.0)["time"] == [0.0, 100.0], "the run ends before the gap"


def test_a_time_column_of_dates(wind):
    """Also with gaps of any length between rows: a CSV file has no cadence."""
    lines = [HEAD, "2027-03-01T12:00,4e5,7e6", "2027-060T13:00:30,4.1e5,6e6", "2027-03-05,4.2e5,5e6"]
    assert wind({"a": lines}, epoch="2027-03-01T12:30")["time"] == [-1800.0, 1830.0, 3.5 * 86400.0 - 1800.0]
    wrong = [*lines[:2], "2027-02-30,4e5,7e6"]
    assert refused(wind, {"b": wrong}, epoch="2027-03-01") == (
        "`solar_wind.time` must be a date that exists, but line 3 of 'b' has '2027-02-30'"
    )
    mixed = [*lines[:2], "2027-03-02 TDB,4e5,7e6"]
    assert "must be in one time scale, but line 3 of 'c'" in refused(wind, {"c": mixed}, epoch="2027-03-01")
    back = [*lines[:3], "2027-03-01T13:00:30,4e5,7e6"]
    assert "must increase, but line 4 of 'd'" in refused(wind, {"d": back}, epoch="2027-03-01")


# ---- scenes -------------------------------------------------------------------------------------


def test_overrides_replace_file_epoch_end_and_gap_of_the_tables(tmp_path):
    (tmp_path / "a").write_text("\n".join(FILLED))
    tables = {
        "solar_wind": {"file": "no-such-file", "largest_gap": 1.0},
        "initial": {"epoch": "1999-01-01"},
    }
    overrides = {
        "solar_wind.file": str(tmp_path / "a"), "solar_wind.largest_gap": 4 * HOUR,
        "initial.epoch": "2020-02-29T03:30", "integrator.t_end": 5 * HOUR,
    }  # fmt: skip
    found = with_wind_file(Request(tables, overrides, tmp_path))
    assert found.tables["solar_wind"] == {} and "solar_wind.largest_gap" not in found.overrides
    assert found.overrides["solar_wind.time"] == [0.0, 4 * HOUR, 5 * HOUR]
    assert found.overrides["initial.epoch"] == "2020-02-29T03:30", "the key stays for whoever checks it"


def test_a_largest_gap_without_a_file_is_refused():
    message = "`solar_wind.largest_gap` must be left out without `solar_wind.file`, but is given"
    with pytest.raises(esail.SceneError) as error:
        esail.load_scene("baseline", {"solar_wind.largest_gap": 100.0})
    assert str(error.value) == message


def test_a_scene_takes_several_files(tmp_path):
    for name, rows in (("b.csv", "100,4.1e5,6e6\n9e4,4e5,7e6"), ("a.csv", "0,4e5,7e6\n50,4.2e5,5e6")):
        (tmp_path / name).write_text(f"{HEAD}\n{rows}\n")
    files = [str(tmp_path / name) for name in ("b.csv", "a.csv")]
    scene = esail.load_scene("baseline", {"solar_wind.file": files})
    assert scene.solar_wind.time == (0.0, 50.0, 100.0, 9e4)
    assert scene.solar_wind.speed == (4e5, 4.2e5, 4.1e5, 4e5)


def test_a_scene_file_names_files_beside_it(tmp_path):
    """The scene holds the numbers alone: its text needs no file."""
    (tmp_path / "a.csv").write_text(f"{HEAD}\n0,4e5,7e6\n50,,5e6\n100,4.1e5,6e6\n")
    (tmp_path / "b.csv").write_text(f"{HEAD}\n9e4,4e5,7e6\n")
    text = builtin_text("baseline").replace("speed = 4e5", 'file = ["b.csv", "a.csv"]\nlargest_gap = 100')
    text = re.sub(r"(?m)^number_density.*\n", "", text)
    (tmp_path / "measured.toml").write_text(text)
    scene = esail.load_scene(tmp_path / "measured.toml")
    assert scene.solar_wind.time == (0.0, 100.0, 9e4)
    assert parse(to_toml(scene), "again") == scene
    with pytest.raises(esail.SceneError, match=r"must be at least 100 \(s\) .*, but is 99"):
        esail.load_scene(tmp_path / "measured.toml", {"solar_wind.largest_gap": 99.0})


# ---- tables in Python ---------------------------------------------------------------------------


TIME, SPEED, DENSITY = [0.0, 100.0, 9e4], [4e5, 4.1e5, 4.2e5], [7e6, 6e6, 5e6]


@pytest.mark.parametrize("kind", [list, tuple, np.array, pandas.Series, xarray.DataArray])
def test_a_table_of_python_is_a_dictionary_of_overrides(kind):
    table = esail.wind(kind(TIME), kind(SPEED), kind(DENSITY))
    assert {key: x.tolist() for key, x in table.items()} == {
        "solar_wind.time": TIME, "solar_wind.speed": SPEED, "solar_wind.number_density": DENSITY
    }  # fmt: skip
    assert esail.load_scene("baseline", table).solar_wind.number_density == tuple(DENSITY)


def test_the_numbers_handed_over_are_not_changed():
    speed = np.array([4e5, 9999.0, 4e5])
    assert len(esail.wind(TIME, speed, DENSITY, largest_gap=1e5)["solar_wind.time"]) == 2
    assert speed[1] == 9999.0


def test_datetimes_are_placed_by_the_epoch():
    """Which becomes that of the scene: its times belong to it."""
    times = np.array(["2027-03-01T12:00", "2027-03-01T12:00:00.5", "2027-03-02"], "datetime64[ms]")
    zoned = pandas.Series(times).dt.tz_localize("UTC").dt.tz_convert("Europe/Berlin")
    for time in (times, pandas.Series(times), zoned, zoned.array, pandas.DatetimeIndex(zoned)):
        table = esail.wind(time, SPEED, DENSITY, epoch="2027-03-01T12:00:00.25")
        assert table["solar_wind.time"].tolist() == [-0.25, 0.25, 43199.75]
    assert esail.load_scene("baseline", table).initial.epoch == "2027-03-01T12:00:00.25"
    zero = np.datetime64("2027-03-01T12:00:00.250", "ns")
    assert np.array_equal(
        esail.wind(times, SPEED, DENSITY, epoch=zero)["solar_wind.time"], table["solar_wind.time"]
    )
    tdb = esail.wind(times, SPEED, DENSITY, epoch="2027-03-01T12:00 TDB")["solar_wind.time"]
    assert abs(tdb[0] - 69.184) < 2e-3


@pytest.mark.parametrize("absent", [np.nan, 9999.0])
def test_gaps_of_a_table(absent):
    speed = [4e5, absent, 4.2e5]
    with pytest.raises(esail.SceneError) as error:
        esail.wind(TIME, speed, DENSITY)
    assert str(error.value) == (
        "`largest_gap` must be at least 90000 (s) to bridge the gap from 100 s to 100 s (index 1 of "
        "`time`: no speed), but is missing"
    )
    assert esail.wind(TIME, speed, DENSITY, largest_gap=9e4)["solar_wind.speed"].tolist() == [4e5, 4.2e5]
    masked = np.ma.array([4e5, 1.0, 4.2e5], mask=[False, True, False])
    assert esail.wind(TIME, masked, DENSITY, largest_gap=9e4)["solar_wind.time"].tolist() == [0.0, 9e4]


DATES = np.array(["2027-03-01", "2027-03-02", "NaT"], "datetime64[s]")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((TIME, SPEED[:2], DENSITY), "`speed` must have as many entries as `time` (3), but has 2"),
        (([0.0, 0.0, 1.0], SPEED, DENSITY),
         "`solar_wind.time` must increase, but index 1 of `time` is not later than index 0"),
        ((TIME, [4e5, -1.0, 4e5], DENSITY), "`speed` must be positive and finite, but is -1.0 at index 1"),
        ((TIME, SPEED, [7e6, 0.0, 7e6]),
         "`number_density` must be positive and finite, but is 0.0 at index 1"),
        ((TIME, [np.nan, 4e5, 4e5], DENSITY),
         "`speed` must have a number at its first and last instant, but has none at index 0"),
        ((TIME, ["a", "b", "c"], DENSITY), "`speed` must be a list of numbers, but has other entries"),
        ((TIME, 4e5, DENSITY), "`speed` must be a list of numbers, but has the shape ()"),
        (([0.0, np.nan, 2.0], SPEED, DENSITY), "`time` must be finite, but is nan at index 1"),
        ((DATES[:2], SPEED, DENSITY), "`epoch` must be given with times of the calendar, but is missing"),
        ((DATES, SPEED, DENSITY, "2027-03-01"), "`time` must be finite, but is NaT at index 2"),
        ((TIME, SPEED, DENSITY, "2027-03-01"),
         "`epoch` must be left out with times in seconds, but is given"),
        (([datetime.date(2027, 3, 1)], [4e5], [7e6], "2027-03-01"),
         "`time` must be seconds or datetime64 values, but has entries of dtype object"),
    ],
)  # fmt: skip
def test_a_table_that_is_no_wind_is_refused(arguments, message):
    first, epoch = arguments[:3], (*arguments, None)[3]
    with pytest.raises(esail.SceneError) as error:
        esail.wind(*first, epoch=epoch)
    assert str(error.value) == message


# ---- esail info ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lines", "rc", "said"),
    [
        (
            ["Time,Speed,Number_density", "0,4e5,7e6"],
            2,
            "line 1 of '{path}' has Time, Speed, Number_density",
        ),
        ([], 2, "'{path}' has no lines"),
        (
            [HEAD, "0,nan,7e6", "9,,7e6"],
            0,
            "rows      2, 0 of them with speed and density\n  gaps      all of it",
        ),
    ],
)
def test_info_says_what_a_csv_file_lacks(lines, rc, said, tmp_path, capsys):
    """And does not take it for a broken run file."""
    path = tmp_path / "wind.csv"
    path.write_text("\n".join(lines))
    assert cli.main(["info", str(path)]) == rc
    assert said.format(path=path) in "".join(capsys.readouterr())


def test_info_describes_a_wind_file(tmp_path, capsys):
    """21 of 24 hours have both numbers: speeds 400 to 423 km/s without 404, 405 and 406."""
    (tmp_path / "omni").write_text("\n".join(FILLED))
    assert cli.main(["info", str(tmp_path / "omni")]) == 0
    kept = [400.0 + h for h in range(24) if h not in (4, 5, 6)]
    low, high = np.quantile(kept, [0.05, 0.95])
    assert capsys.readouterr().out == (
        f"{tmp_path / 'omni'}: wind, hourly OMNI file\n"
        "  span      2020-02-29T00:30:00 to 2020-02-29T23:30:00 UTC (82800 s)\n"
        "  rows      24, 21 of them with speed and density\n"
        "  gaps      1, bridged with `largest_gap = 14400`; longest from 2020-02-29T04:30:00 to "
        "2020-02-29T06:30:00\n"
        f"  speed           mean {1e3 * np.mean(kept):.4g}, median {1e3 * np.median(kept):.4g}, "
        f"5 % {1e3 * low:.4g}, 95 % {1e3 * high:.4g} m/s\n"
        f"  number_density  mean {1e6 * (np.mean(kept) - 395):.4g}, "
        f"median {1e6 * (np.median(kept) - 395):.4g}, "
        f"5 % {1e6 * (low - 395):.4g}, 95 % {1e6 * (high - 395):.4g} 1/m^3\n"
    )


@pytest.mark.parametrize("dated", [True, False])
def test_info_draws_a_wind_with_its_gaps(tmp_path, capsys, dated):
    """The curves break in the gap, where a dashed line is; the file is replaced only if asked."""
    path, figure = tmp_path / "wind", tmp_path / "wind.png"
    csv = [HEAD, *(f"{3600 * h},{4e5 + h},{'' if h in (4, 5) else 5e6}" for h in range(24))]
    path.write_text("\n".join(FILLED if dated else csv) + "\n")
    given = ["info", str(path), "-o", str(figure)]
    assert cli.main(given) == 0
    assert capsys.readouterr().out.endswith(f"{figure}\n") and figure.read_bytes().startswith(b"\x89PNG")
    assert cli.main(given) == 2 and "must not exist" in capsys.readouterr().err
    assert cli.main([*given, "--overwrite"]) == 0
    wind = read_wind([path])
    drawn = draw_wind(wind, "")
    dashed, whole = drawn.axes[0].lines
    assert np.isnan(whole.get_ydata()).sum() == 1 and np.isfinite(dashed.get_ydata()).all()
    assert np.array_equal(dashed.get_ydata(), 1e-3 * wind.column("speed")[wind.good])
    assert drawn.axes[1].get_xlabel() == ("date [UTC]" if dated else "time $t$ [s]")


def test_a_figure_belongs_to_a_wind(tmp_path, capsys):
    (tmp_path / "wind").write_text("\n".join(FILLED) + "\n")
    for given, line in (
        (["baseline"], "`-o` must be left out unless all files are those of a wind, but is given"),
        ([str(tmp_path / "wind")], "`-o` must end in .png, .pdf or .svg, but ends in '.txt'"),
    ):
        assert cli.main(["info", *given, "-o", str(tmp_path / "a.txt")]) == 2
        assert capsys.readouterr().err == f"{line}\n"
    assert not (tmp_path / "a.txt").exists()


def test_info_describes_csv_files_as_one_wind_without_jax(tmp_path, capsys):
    for name, rows in (("b.csv", "100,4.1e5,6e6\n200,4e5,7e6"), ("a.csv", "0,4e5,7e6\n50,4.2e5,5e6")):
        (tmp_path / name).write_text(f"{HEAD}\n{rows}\n")
    paths = [str(tmp_path / name) for name in ("a.csv", "b.csv")]
    assert cli.main(["info", *paths]) == 0
    out = capsys.readouterr().out
    assert "CSV file with seconds" in out and "span      0 s to 200 s (200 s)" in out
    assert "gaps      none" in out and "speed           mean 4.075e+05, median 4.05e+05" in out
    assert heavy_imports_of(["info", paths[0]]) == (0, [])
    (tmp_path / "c.csv").write_text(f"{HEAD}\n0,4e5\n")
    assert cli.main(["info", str(tmp_path / "c.csv")]) == 2
    assert "line 2" in capsys.readouterr().err
