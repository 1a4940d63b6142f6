"""Telemetry is read as it was written, in every form, and what is wrong is said in one line."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pandas
import pytest

import esail_jax as esail
from esail_jax.files.selection import Column
from esail_jax.identification.model import Cells, measurable
from esail_jax.identification.telemetry import Telemetry, deviations_of, telemetry_of
from support.measured_sail import sail, shapes


def read(data, scene=None):
    """The telemetry of data of the sail."""
    return telemetry_of(data, scene or sail(), shapes())


def written(folder, text):
    """The path of a file with a text."""
    path = folder / "data.csv"
    path.write_bytes(text.encode())
    return path


def refused(data, scene=None):
    """The message with which data are refused."""
    with pytest.raises(esail.SceneError) as error:
        read(data, scene)
    return str(error.value)


def same(one, two):
    """Whether two tables have the same times, columns and numbers."""
    assert one.columns == two.columns
    np.testing.assert_array_equal(one.time, two.time)
    np.testing.assert_array_equal(one.values, two.values)
    return True


@pytest.mark.nightly
def test_what_the_package_writes_is_read_to_the_last_bit(tmp_path):
    """All columns of `esail export`, with dates beside the times: every number, and nothing where the run
    has none; from the dates alone, the times to a microsecond."""
    scene = sail().replace({"initial.epoch": "2027-03-01T12:00:00"})
    run = esail.simulate(scene)
    angle = np.array(run["reaction_angle"])
    angle[3] = np.nan  # as where the reactions cancel
    run = dataclasses.replace(run, observables=run.observables | {"reaction_angle": angle})
    path = esail.export(run, tmp_path / "run.csv", calendar=True)
    found = read(path, scene)
    np.testing.assert_array_equal(found.time, run.time)
    assert found.columns == tuple(
        Column(name, tuple(i + 1 for i in at)) for name in run for at in np.ndindex(run[name].shape[1:])
    )
    for column, numbers in zip(found.columns, found.values.T, strict=True):
        at = tuple(i - 1 for i in column.place)
        np.testing.assert_array_equal(numbers, run[column.name][(slice(None), *at)])
    assert np.isnan(found.values).sum() == 1
    head, *lines = path.read_text().splitlines()
    assert head.startswith("time [s],date [UTC],")
    dated = "\n".join(line.partition(",")[2] for line in (head, *lines))
    found = read(written(tmp_path, dated), scene)
    np.testing.assert_allclose(found.time, run.time, rtol=0, atol=1e-6)


PLAIN = "time [s],spin_rate[1] [rad/s],kinetic_energy [J]\n0.5,0.05,1.5\n7.25,,2.5\n"


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + PLAIN,
        PLAIN.replace("\n", "\r\n"),
        PLAIN.replace(",,", ",nan,"),
        PLAIN.replace(",,", ", ,"),
        PLAIN.replace("\n7", "\n\n7") + "\n,,\n",
        PLAIN.replace(" [s]", "").replace(" [rad/s]", "").replace(" [J]", "[J]"),
        PLAIN.replace("kinetic_energy [J]", '"kinetic_energy [J]"'),
        PLAIN.replace("time", " time").rstrip("\n"),
    ],
    ids=["BOM", "CRLF", "nan", "blank", "empty lines", "no units", "quoted", "spaces"],
)
def test_files_of_other_programs(tmp_path, text):
    """The same table whatever ends its lines, marks its encoding, or stands in an empty cell."""
    found = read(written(tmp_path, text))
    columns = (Column("spin_rate", (1,)), Column("kinetic_energy", ()))
    same(found, Telemetry("", np.array([0.5, 7.25]), columns, np.array([[0.05, 1.5], [np.nan, 2.5]])))


def test_arrays_places_and_data_frames_are_the_same_table():
    """All places of an observable as one array, as one column each, and as a frame with a column each."""
    random = np.random.default_rng(0)
    time, rate, energy = np.array([3.0, 1.0, 1.0]), random.random((3, 2)), random.random(3)
    rate[1, 0] = np.nan
    arrays = read({"time": time, "spin_rate": rate, "kinetic_energy": energy})
    places = {
        "spin_rate[1]": rate[:, 0], "time": time, "spin_rate[2] [rad/s]": rate[:, 1],
        "kinetic_energy": energy,
    }  # fmt: skip
    assert same(arrays, read(places)) and same(arrays, read(pandas.DataFrame(places)))
    assert arrays.names == ("spin_rate", "kinetic_energy")


def test_dates_count_from_the_epoch():
    """In UTC and in the time scale that the header names: 2027 has 37 leap seconds, and TDB is 32.184 s
    more beyond UTC, within 2 ms."""
    scene = sail().replace({"initial.epoch": "2027-03-01T12:00:00"})
    dates = ["2027-03-01T12:00:10.5", "2027-03-01T12:00:20Z"]
    found = read({"date": dates, "kinetic_energy": [1.0, 2.0]}, scene)
    np.testing.assert_allclose(found.time, [10.5, 20.0], rtol=0, atol=1e-9)
    later = ["2027-03-01T12:01:19.184"]
    found = read({"date [TDB]": later, "kinetic_energy": [1.0]}, scene)
    np.testing.assert_allclose(found.time, [10.0], rtol=0, atol=2e-3)
    with_times = read({"date": dates, "time": [1.0, 2.0], "kinetic_energy": [1.0, 2.0]})
    np.testing.assert_array_equal(with_times.time, [1.0, 2.0])  # which count, and need no epoch
    assert refused({"date": dates, "kinetic_energy": [1.0, 2.0]}) == (
        "`initial.epoch` must be given with dates in the data, but is missing"
    )
    bad = {"date": ["2027-03-01T12:00:10", "noon"], "kinetic_energy": [1.0, 2.0]}
    assert "'noon" in refused(bad, scene) and "\n" not in refused(bad, scene)
    assert refused({"date": ["2027-03-01T11:59:00"], "kinetic_energy": [1.0]}, scene) == (
        "`data` must lie within the run, 0 to 60 s (`integrator.t_end`), but row 1 of data is at -60 s"
    )


def test_cells_are_the_measured_ones_at_increasing_instants():
    """Rows in any order, with an instant twice: every number finds its instant, observable and place."""
    time = np.array([9.0, 2.0, 9.0, 4.0])
    rate = np.array([[1.0, np.nan], [2.0, 3.0], [np.nan, 4.0], [np.nan, np.nan]])
    cells = Cells.of(read({"time": time, "spin_rate": rate}), np.array([0.1, 0.2]))
    assert cells.times == (2.0, 9.0)
    triples = zip(cells.row.tolist(), cells.place, cells.values.tolist(), cells.deviations, strict=True)
    assert sorted(triples) == [
        (0, (0,), 2.0, 0.1), (0, (1,), 3.0, 0.2), (1, (0,), 1.0, 0.1), (1, (1,), 4.0, 0.2),
    ]  # fmt: skip


def test_cells_are_picked_in_the_order_of_the_table():
    """From arrays of observables at the instants of the run, with observables in turn in every row."""
    time, random = np.array([5.0, 3.0]), np.random.default_rng(2)
    data = {"time": time, "spin_rate": random.random((2, 2)), "kinetic_energy": random.random(2)}
    cells = Cells.of(read(data), np.ones(3))
    shown = {name: jnp.asarray(x[::-1]) for name, x in data.items()}  # at 3 s and 5 s
    np.testing.assert_array_equal(cells.picked_from(shown), cells.values)


GOOD = {"time": [0.0, 1.0], "spin_rate[1]": [1.0, 2.0]}

TABLES = {
    "no observable of that name": (
        GOOD | {"spin_rat[1]": [1.0, 2.0]},
        "have columns of observables of the run, but data has the column 'spin_rat[1]' (perhaps "
        "`spin_rate`)",
    ),
    "unit": (
        GOOD | {"coning_angle[1] [deg]": [1.0, 2.0]},
        "have coning_angle in rad, but data has the column 'coning_angle[1] [deg]'",
    ),
    "place": (
        GOOD | {"coning_angle[4]": [1.0, 2.0]},
        "have 3 places of coning_angle, but data has 'coning_angle[4]'",
    ),
    "place of a number": (
        GOOD | {"kinetic_energy[1]": [1.0, 2.0]},
        "have no places of kinetic_energy, but data has 'kinetic_energy[1]'",
    ),
    "no place": (
        GOOD | {"coning_angle": [1.0, 2.0]},
        "have rows of the shape (3,) in coning_angle, or name a place, but coning_angle of data has the "
        "shape ()",
    ),
    "shape": (
        GOOD | {"coning_angle": np.zeros((2, 2))},
        "have rows of the shape (3,) in coning_angle, or name a place, but coning_angle of data has the "
        "shape (2,)",
    ),
    "twice": (
        GOOD | {"spin_rate": np.zeros((2, 2))},
        "have every column once, but data has 'spin_rate' twice",
    ),
    "late": (
        GOOD | {"time": [0.0, 61.0]},
        "lie within the run, 0 to 60 s (`integrator.t_end`), but row 2 of data is at 61 s",
    ),
    "early": (
        GOOD | {"time": [-1.0, 1.0]},
        "lie within the run, 0 to 60 s (`integrator.t_end`), but row 1 of data is at -1 s",
    ),
    "time missing": (
        GOOD | {"time": [np.nan, 1.0]},
        "have a finite time in every row, but data has others",
    ),
    "time in minutes": (
        {"time [min]": [0.0, 1.0], "spin_rate[1]": [1.0, 2.0]},
        "have times in seconds, but data has the column 'time [min]'",
    ),
    "no time": (
        {"spin_rate[1]": [1.0, 2.0]},
        "have times and measurements, but data has no column time [s]",
    ),
    "times only": (
        {"time": [1.0, 2.0]},
        "have times and measurements, but data has no column with an observable",
    ),
    "infinite": (
        GOOD | {"spin_rate[1]": [1.0, np.inf]},
        "have numbers, or none where nothing was measured, but spin_rate[1] of data has others",
    ),
    "text": (
        GOOD | {"spin_rate[1]": ["a", "b"]},
        "have numbers, or none where nothing was measured, but spin_rate[1] of data has others",
    ),
    "rows": (
        GOOD | {"spin_rate[1]": [1.0]},
        "have 2 rows in every column, but spin_rate of data has 1",
    ),
    "empty": (GOOD | {"spin_rate[1]": [np.nan] * 2}, "have numbers, but all cells of data are empty"),
    "no rows": ({"time": [], "spin_rate[1]": []}, "have numbers, but all cells of data are empty"),
    "header": (
        GOOD | {"spin rate": [1.0, 2.0]},
        "have columns such as coning_angle[1] [rad], but data has 'spin rate'",
    ),
    "type": (3.0, "be a path, a DataFrame or a mapping of arrays, but is of type float"),
}


@pytest.mark.parametrize("case", TABLES)
def test_a_table_that_is_wrong_is_refused_in_one_line(case):
    data, must = TABLES[case]
    assert refused(data) == f"`data` must {must}"


FILES = {
    "text": (
        PLAIN.replace("2.5", "2.5 J"),
        "have numbers or empty cells, but line 3 of {} has '2.5 J' in the column 'kinetic_energy [J]'",
    ),
    "text behind an empty line": (
        PLAIN.replace("\n7", "\n\n7").replace("2.5", "x"),
        "have numbers or empty cells, but line 4 of {} has 'x' in the column 'kinetic_energy [J]'",
    ),
    "cells": (PLAIN.replace(",1.5", ""), "have 3 cells in every line, but line 2 of {} has 2"),
    "infinite": (
        PLAIN.replace("1.5", "inf"),
        "have numbers, or none where nothing was measured, but kinetic_energy [J] of {} has others",
    ),
    "header twice": (
        PLAIN.replace("kinetic_energy [J]", "time [s]"),
        "have every column once, but {} has 'time [s]' twice",
    ),
    "column twice": (
        PLAIN.replace("kinetic_energy [J]", "spin_rate[1]"),
        "have every column once, but {} has 'spin_rate[1]' twice",
    ),
    "header only": (PLAIN.split("\n")[0], "be a CSV file with a header and rows, but {} has 1 lines"),
    "nothing": ("", "be a CSV file with a header and rows, but {} has 0 lines"),
}


@pytest.mark.parametrize("case", FILES)
def test_a_file_that_is_wrong_is_refused_with_its_line(tmp_path, case):
    text, must = FILES[case]
    path = written(tmp_path, text)
    assert refused(path) == f"`data` must {must.format(repr(str(path)))}"


def test_a_file_that_is_no_text_or_that_is_not_there(tmp_path):
    path = tmp_path / "data.csv"
    start = f"`data` must be a CSV file, but {str(path)!r} cannot be read: "
    assert refused(path) == start + "No such file or directory"
    path.write_bytes(b"\xff\xfe\x00")
    assert refused(path) == start + "is no text of comma-separated values"


# ---- noise -----------------------------------------------------------------------------------------


def test_noise_of_a_place_goes_before_that_of_its_observable():
    data = read({"time": [0.0], "spin_rate": np.ones((1, 2)), "kinetic_energy": [1.0]})
    (found,) = deviations_of({"spin_rate": 0.1, "spin_rate[2]": 0.3, "kinetic_energy": 2}, [data])
    np.testing.assert_array_equal(found, [0.1, 0.3, 2.0])


NOISES = {
    "missing": ({"kinetic_energy": 1.0}, "`noise` must have a standard deviation for every column of the "
                "data, but has none for spin_rate[1] of data"),
    "not used": ({"spin_rate": 1.0, "coning_angle": 1.0}, "`noise` must be that of columns of the data, "
                 "but has coning_angle, which no column needs"),
    "place not used": ({"spin_rate": 1.0, "spin_rate[2]": 1.0}, "`noise` must be that of columns of the "
                       "data, but has spin_rate[2], which no column needs"),
    "zero": ({"spin_rate": 0.0}, "`noise[spin_rate]` must be positive and finite, but is 0.0"),
    "negative": ({"spin_rate": -1.0}, "`noise[spin_rate]` must be positive and finite, but is -1.0"),
    "nan": ({"spin_rate": np.nan}, "`noise[spin_rate]` must be positive and finite, but is nan"),
    "array": ({"spin_rate": [1.0, 2.0]}, "`noise[spin_rate]` must be positive and finite, but is "
              "[1.0, 2.0]"),
    "unit": ({"spin_rate[1] [rad/s]": 1.0}, "`noise` must be given by observable, such as spin_rate or "
             "spin_rate[1], but has 'spin_rate[1] [rad/s]'"),
}  # fmt: skip


@pytest.mark.parametrize("case", NOISES)
def test_noise_that_is_wrong_is_refused_in_one_line(case):
    noise, message = NOISES[case]
    with pytest.raises(esail.SceneError) as error:
        deviations_of(noise, [read(GOOD)])
    assert str(error.value) == message


def test_every_observable_of_a_sail_and_of_a_chain_can_be_measured():
    """Those on request, too."""
    assert {"hub_acceleration_B", "tip_direction_B", "spin_rate"} <= shapes().keys()
    assert shapes()["tip_direction_B"] == (3, 3)
    chain = esail.load_scene("hanging-chain")
    assert dataclasses.is_dataclass(chain) and "spin_rate" not in measurable(chain)
