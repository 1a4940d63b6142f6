"""A run with an epoch: its dates in Python, in run files, in tables and in netCDF."""

import csv

import matplotlib.dates
import numpy as np
import pytest
import xarray

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.plotting.dates import Calendar
from esail_jax.scenes.structure import split
from support.bits import same_bits

LEAP = "2016-12-31T23:59:30"
"""Half a minute before a leap second."""


@pytest.fixture(scope="module")
def dated(solution):
    """The run that these tests share, with an epoch."""
    return esail.simulate(solution.scene, {"initial.epoch": LEAP})


@pytest.fixture(scope="module")
def file(dated, tmp_path_factory):
    path = tmp_path_factory.mktemp("dated") / "dated.h5"
    esail.save(dated, path)
    return path


def test_an_epoch_changes_no_number(solution, dated):
    """It is no part of the equations: the same program gives the same bits."""
    assert split(dated.scene)[0] == split(solution.scene)[0]
    assert same_bits(dict(dated), dict(solution)) and np.array_equal(dated.time, solution.time)


def test_dates_count_leap_seconds(solution):
    """The second 60 at the end of 2016 is one of the run. In TDB there is none."""
    times = [0.0, 29.0, 30.0, 31.0, 80.0]
    run = esail.simulate(solution.scene, {"initial.epoch": LEAP}, times=times)
    clock = ["12-31T23:59:30", "12-31T23:59:59", "12-31T23:59:60", "01-01T00:00:00", "01-01T00:00:49"]
    assert [date[5:] for date in run.dates(0)] == clock
    tdb = esail.simulate(solution.scene, {"initial.epoch": f"{LEAP} TDB"}, times=[0.0, 30.25])
    assert tdb.dates(2) == ["2016-12-31T23:59:30.00", "2017-01-01T00:00:00.25"]
    with pytest.raises(ValueError, match="must be given for a run with dates"):
        solution.dates()


def test_a_run_file_has_the_epoch_with_its_scale(file, whole, capsys):
    """As it was given. `esail info` says the dates of the first and the last instant."""
    import h5py

    with h5py.File(file) as content:
        assert content.attrs["epoch"] == f"{LEAP} UTC"
    assert esail.load(file).scene.initial.epoch == LEAP
    assert main(["info", str(file)]) == 0
    line = "  dates      2016-12-31T23:59:30 to 2017-01-01T00:00:49, epoch 2016-12-31T23:59:30 UTC\n"
    assert line in capsys.readouterr().out
    assert main(["info", str(whole)]) == 0
    assert "dates" not in capsys.readouterr().out


def test_a_table_has_the_dates_if_they_are_asked_for(file, whole, dated, tmp_path, capsys):
    """A column beside the time, with the name of the time scale. A run without an epoch has none, and
    netCDF has them anyway: both are said, and nothing is written."""
    path = tmp_path / "a.csv"
    assert main(["export", str(file), "-o", str(path), "--calendar"]) == 0
    with path.open(encoding="utf-8", newline="") as table:
        header, *rows = csv.reader(table)
    assert header[:2] == ["time [s]", "date [UTC]"]
    assert [row[1] for row in rows] == dated.dates()
    assert main(["export", str(file), "-o", str(path), "--overwrite"]) == 0
    assert path.read_text(encoding="utf-8").startswith("time [s],angular")
    capsys.readouterr()
    for run, name, message in (
        (whole, "b.csv", f"`{whole}` must have an epoch (`initial.epoch`) for dates, but has none"),
        (file, "b.nc", "`--calendar` must be left out with .nc, but is given"),
    ):
        assert main(["export", str(run), "-o", str(tmp_path / name), "--calendar"]) == 2
        assert capsys.readouterr().err == f"{message}\n" and not (tmp_path / name).exists()


def test_netcdf_has_times_that_other_programs_read_as_dates(file, solution, tmp_path):
    """By the CF conventions. Their calendar has no leap seconds: the dates behind one are a second late."""
    path = tmp_path / "a.nc"
    assert main(["export", str(file), "-o", str(path)]) == 0
    with xarray.open_dataset(path, engine="scipy") as data:
        dates = data["time"].values
        assert dates[0] == np.datetime64(LEAP) and dates[-1] == np.datetime64(LEAP) + np.timedelta64(
            80, "s"
        )
        assert data["time"].attrs["time_scale"] == "UTC"
    assert solution.to_xarray()["time"].attrs == {"units": "s"}


def test_an_epoch_within_a_leap_second_is_a_date_of_other_calendars(solution):
    """Theirs is in the first second of the next day; the run's own is the second 60."""
    run = esail.simulate(solution.scene, {"initial.epoch": "2016-12-31T23:59:60.25"}, times=[0.0, 1.0])
    assert run.dates(2) == ["2016-12-31T23:59:60.25", "2017-01-01T00:00:00.25"]
    assert run.to_xarray()["time"].attrs["units"] == "seconds since 2017-01-01 00:00:00.250000"
    calendar = Calendar.of(run.scene.initial.epoch)
    assert matplotlib.dates.num2date(calendar.start).isoformat().startswith("2017-01-01T00:00:00.25")
    assert calendar.scale == "UTC"


@pytest.mark.parametrize(
    ("epoch", "message"),
    [
        ("soon", "must be a date such as"),
        (2027.0, "must be a date such as"),
        ("2027-02-30", "must be a date that exists"),
        ("2027-06-30T23:59:60", "must be an instant that exists"),
    ],
)
def test_what_is_no_epoch_is_refused(solution, epoch, message):
    with pytest.raises(esail.SceneError, match=f"`initial.epoch` {message}"):
        esail.simulate(solution.scene, {"initial.epoch": epoch})


def test_a_date_of_toml_needs_no_quotes(solution):
    """It becomes its text; the scene's own text reads the same again."""
    from esail_jax.scenes.loading import parse
    from esail_jax.scenes.toml_text import to_toml

    text = to_toml(solution.scene).replace("[initial]", "[initial]\nepoch = 2027-03-01T12:00:00Z")
    scene = parse(text, "scene.toml")
    assert scene.initial.epoch == "2027-03-01T12:00:00Z"
    assert parse(to_toml(scene), "again.toml").initial.epoch == scene.initial.epoch
