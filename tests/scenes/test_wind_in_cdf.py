"""Measured wind in CDF files of OMNI, which the tests write with cdflib."""

import builtins

import cdflib
import numpy as np
import pytest
from cdflib.cdfwrite import CDF

import esail_jax as esail
from esail_jax import cli
from esail_jax.wind_files.in_run import table_of_run
from esail_jax.wind_files.opening import is_wind_file, read_rows

REAL4, EPOCH, TT2000 = CDF.CDF_FLOAT, CDF.CDF_EPOCH, CDF.CDF_TIME_TT2000
HRO = ("flow_speed", "proton_density")


def write(path, dates, speed, density, names=("V", "N"), kind=EPOCH, fills=(9999.0, 999.9)):
    """Writes a file with instants (year, month, ..., millisecond), speeds and densities."""
    parts = [[*date, *[0] * (7 - len(date))] for date in dates]
    if kind == TT2000:
        instants = cdflib.cdfepoch.compute_tt2000([[*part, 0, 0] for part in parts])
    else:
        instants = cdflib.cdfepoch.compute_epoch(parts)
    path.unlink(missing_ok=True)
    with CDF(path) as file:
        spec = {"Num_Elements": 1, "Rec_Vary": True, "Dim_Sizes": []}
        file.write_var({**spec, "Variable": "Epoch", "Data_Type": kind}, var_data=np.array(instants))
        for name, column, fill in zip(names, (speed, density), fills, strict=True):
            attributes = {} if fill is None else {"FILLVAL": [fill, "CDF_REAL4"]}
            data = np.array(column, np.float32)
            file.write_var({**spec, "Variable": name, "Data_Type": REAL4}, attributes, data)
    return path


HOURS = [(2020, 2, 28, 22), (2020, 2, 28, 23), (2020, 2, 29, 0), (2020, 2, 29, 1)]


@pytest.mark.parametrize("kind", [EPOCH, TT2000])
def test_hourly_files(tmp_path, kind):
    """A row stands in the middle of its hour; units become those of the scene, in single precision."""
    rows = read_rows(
        "a.cdf", write(tmp_path / "a.cdf", HOURS, [400, 410, 420.5, 430], [5, 6, 7, 8.25], kind=kind).parent
    )
    assert rows.form == "OMNI file (CDF) with rows every 3600 s" and rows.cadence == 3600.0
    assert np.array_equal(rows.time.day - 58907, [0, 0, 1, 1])  # 28 February 2020 has the MJD 58907
    assert np.allclose(rows.time.second, [81000.0, 84600.0, 1800.0, 5400.0], atol=1e-6)
    assert np.array_equal(rows.speed, [4e5, 4.1e5, 4.205e5, 4.3e5])
    assert np.array_equal(rows.number_density, [5e6, 6e6, 7e6, 8.25e6])


@pytest.mark.parametrize("minutes", [1, 5])
def test_minute_files(tmp_path, minutes):
    dates = [(2027, 3, 1, 12, k * minutes) for k in range(6)]
    path = write(
        tmp_path / "a.cdf", dates, 400.0 + np.arange(6), np.full(6, 5.0), HRO, fills=(99999.9, 999.99)
    )
    rows = read_rows("a.cdf", path.parent)
    assert rows.cadence == 60.0 * minutes
    assert np.allclose(rows.time.second, 43200.0 + 60.0 * minutes * (np.arange(6) + 0.5), atol=1e-6)


@pytest.mark.parametrize(
    ("names", "fills"),
    [(("V", "N"), (9999.0, 999.9)), (HRO, (99999.9, 999.99)), (HRO, (None, None)), (HRO, (-1e31, -1e31))],
)
def test_fill_values_are_gaps(tmp_path, names, fills):
    """In single precision, with the attribute or by the nines, and NaN: no such number reaches a run."""
    nines = (9999.0, 999.9) if names[0] == "V" else (99999.9, 999.99)
    absent = [nine if fill is None else fill for nine, fill in zip(nines, fills, strict=True)]
    speed, density = (
        [400.0, absent[0], 420.0, 430.0, 440.0, np.nan, 460.0],
        [5.0, 5.0, 5.0, absent[1], 5.0, 5.0, 5.0],
    )
    dates = [(2027, 3, 1, hour) for hour in range(7)]
    rows = read_rows("a.cdf", write(tmp_path / "a.cdf", dates, speed, density, names, fills=fills).parent)
    assert np.array_equal(np.isnan(rows.speed), np.isin(np.arange(7), [1, 5]))
    assert np.array_equal(np.isnan(rows.number_density), np.arange(7) == 3)
    assert set(rows.missing) == {1, 3, 5} and rows.missing[1] == f"{names[0]} is a fill value"


def test_a_run_takes_the_part_that_it_needs(tmp_path):
    """By the key of the scene, beside a text file of the day before; the gap between them is named."""
    path = write(tmp_path / "a.cdf", HOURS, [400, 410, 420, 430], [5, 6, 7, 8])
    given = {
        "solar_wind.file": str(path),
        "initial.epoch": "2020-02-28T23:00:00",
        "integrator.t_end": 3600.0,
    }
    scene = esail.load_scene("baseline", given)
    assert np.allclose(scene.solar_wind.time, [-1800.0, 1800.0, 5400.0])
    assert np.array_equal(scene.solar_wind.speed, [4e5, 4.1e5, 4.2e5])


def test_info_describes_it(tmp_path, capsys):
    path = write(tmp_path / "a.cdf", HOURS, [400, 9999.0, 420, 430], [5, 6, 7, 8])
    assert is_wind_file(path)
    assert cli.main(["info", str(path)]) == 0
    said = capsys.readouterr().out
    assert (
        "OMNI file (CDF) with rows every 3600 s" in said and "4, 3 of them with speed and density" in said
    )
    assert "2020-02-28T22:30:00 to 2020-02-29T01:30:00 UTC" in said


def refused(path):
    with pytest.raises(esail.SceneError) as error:
        table_of_run([read_rows(path.name, path.parent)])
    assert "\n" not in str(error.value)
    return str(error.value)


def test_wrong_files_are_refused_in_one_line(tmp_path):
    """Other variables, other steps, numbers that cannot be, wrong order, damage, and no rows at all."""
    path = tmp_path / "a.cdf"
    four = [400.0, 410.0, 420.0, 430.0], [5.0, 6.0, 7.0, 8.0]
    write(path, HOURS, *four, names=("speed", "N"))
    assert "must have the variables Epoch, V and N or Epoch, flow_speed and proton_density" in refused(path)
    assert "'a.cdf' has Epoch, speed, N" in refused(path)
    write(path, [(2027, 3, day) for day in range(1, 5)], *four)
    assert (
        "must have rows 60 or 300 or 3600 s apart (OMNI), but those of 'a.cdf' are mostly 86400 s"
        in refused(path)
    )
    write(path, HOURS, [400.0, -3.0, 420.0, 430.0], four[1])
    assert "must have positive speeds, but record 1 of 'a.cdf' has -3" in refused(path)
    write(path, HOURS, four[0], [5.0, 6.0, -7.0, 8.0])
    assert "must have densities that are not negative, but record 2 of 'a.cdf' has -7" in refused(path)
    write(path, [*HOURS[:2], HOURS[3], HOURS[2]], *four)
    assert "must" in refused(path)
    write(path, HOURS, *four)
    path.write_bytes(path.read_bytes()[:300])
    assert refused(path).startswith(
        "`solar_wind.file` must be an intact CDF file, but 'a.cdf' cannot be read"
    )


def test_without_the_library_it_is_named(tmp_path, monkeypatch):
    path = write(tmp_path / "a.cdf", HOURS, [400, 410, 420, 430], [5, 6, 7, 8])
    original = builtins.__import__

    def without(name, *rest):
        if name == "cdflib":
            raise ImportError(name)
        return original(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    assert "must be read with cdflib (`pip install 'esail_jax[cdf]'`)" in refused(path)
