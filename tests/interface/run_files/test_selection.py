"""`esail export` of a part of a run: some observables, or places of them, and some instants."""

import csv

import numpy as np
import pytest
import xarray

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.files.selection import Column, columns_of


def exported(run, path, *options):
    """Header and numbers of a table of the run."""
    assert main(["export", str(run), "-o", str(path), "--overwrite", *options]) == 0
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    return header, rows


def test_names_and_places():
    assert columns_of("a, b[1],c[2,3]") == (Column("a", None), Column("b", (1,)), Column("c", (2, 3)))


def test_a_table_has_the_columns_that_are_asked_for(whole, tmp_path):
    """In the order in which they are named; places are counted from 1."""
    run = esail.load(whole)
    asked = "kinetic_energy,coning_angle[2],rotation_IB[1,3],voltage"
    header, rows = exported(whole, tmp_path / "a.csv", "--observables", asked)
    count = run["voltage"].shape[1]
    voltages = [f"voltage[{k + 1}] [V]" for k in range(count)]
    wanted = ["kinetic_energy [J]", "coning_angle[2] [rad]", "rotation_IB[1,3] [-]", *voltages]
    assert header == ["time [s]", *wanted]
    table = np.array(rows, float)
    assert np.array_equal(table[:, 2], run["coning_angle"][:, 1])
    assert np.array_equal(table[:, 3], run["rotation_IB"][:, 0, 2])
    assert np.array_equal(table[:, 4:], run["voltage"])


def test_a_table_has_the_instants_that_are_asked_for(whole, tmp_path):
    """Both ends are included; between two rows is at least the time that is asked for."""
    run = esail.load(whole)
    path, one = tmp_path / "a.csv", ("--observables", "kinetic_energy")
    first, last = float(run.time[10]), float(run.time[50])
    for options, expected in (
        (("--from", repr(first), "--to", repr(last)), run.time[10:51]),
        (("--to", repr(first)), run.time[:11]),
        (("--from", repr(last)), run.time[50:]),
    ):
        assert np.array_equal(np.array(exported(whole, path, *one, *options)[1], float)[:, 0], expected)
    time = np.array(exported(whole, path, *one, "--every", "5.0")[1], float)[:, 0]
    assert time[0] == run.time[0] and np.diff(time).min() >= 5.0 * (1.0 - 1e-8)
    assert np.diff(time).max() < 5.0 + np.diff(run.time).max() * (1.0 + 1e-8)


def test_instants_may_be_dates(solution, tmp_path):
    """Of a run with an epoch, in either time scale."""
    path, table = tmp_path / "dated.h5", tmp_path / "a.csv"
    esail.save(esail.simulate(solution.scene, {"initial.epoch": "2027-03-01T12:00:00"}), path)
    options = ("--observables", "kinetic_energy", "--to", "2027-03-01T12:00:30", "--calendar")
    _, rows = exported(path, table, "--from", "2027-03-01T12:00:10", *options)
    time = np.array([row[0] for row in rows], float)
    assert 10.0 <= time.min() < time.max() <= 30.0 and rows[0][1].startswith("2027-03-01T12:00:1")
    _, tdb = exported(path, table, "--from", "2027-03-01T12:01:19.2 TDB", *options)
    assert [row[1] for row in tdb] == [row[1] for row in rows if float(row[0]) >= 10.0146]
    first, last = (np.datetime64(f"2027-03-01T12:00:{second}", "ns") for second in (10, 30))
    esail.export(path, table, observables="kinetic_energy", first=first, last=last, overwrite=True)
    assert np.array_equal(np.loadtxt(table, delimiter=",", skiprows=1)[:, 0], time)


def test_netcdf_has_the_same_parts(whole, tmp_path):
    path, run = tmp_path / "a.nc", esail.load(whole)
    part = ["--observables", "voltage,kinetic_energy", "--to", "20"]
    assert main(["export", str(whole), "-o", str(path), *part]) == 0
    with xarray.open_dataset(path, engine="scipy") as data:
        assert set(data.data_vars) == {"voltage", "kinetic_energy"}
        assert np.array_equal(data["time"], run.time[run.time <= 20.0])
        assert np.array_equal(data["voltage"], run["voltage"][run.time <= 20.0])


REFUSED = {
    "unknown": (
        ["--observables", "coning"],
        "must be observables of the run, but has 'coning' (perhaps `con",
    ),
    "no name": (["--observables", "a b"], "must be names of observables with commas between them"),
    "empty": (["--observables", ""], "must be names of observables with commas between them"),
    "place": (["--observables", "voltage[9]"], "must name one of the 2 places of voltage, but has [9]"),
    "axes": (["--observables", "voltage[1,2]"], "must name one of the 2 places of voltage, but has [1, 2]"),
    "scalar": (["--observables", "kinetic_energy[1]"], "must name no place of a number, but has [1]"),
    "late": (["--from", "1e4"], "`--from` must leave instants of the run, but there are from 0 to 80 s"),
    "order": (["--from", "9", "--to", "3"], "`--from` must not be later than the last instant that is"),
    "date": (
        ["--to", "2027-03-01"],
        "`--to` must be a number of seconds, or a date of a run with an epoch",
    ),
    "every": (["--every", "0"], "`--every` must be positive, but is 0"),
    "not a number": (["--every", "nan"], "`--every` must be positive, but is nan"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(name, whole, tmp_path, capsys):
    """In one line, and nothing is written."""
    options, message = REFUSED[name]
    assert main(["export", str(whole), "-o", str(tmp_path / "a.csv"), *options]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1 and not list(tmp_path.iterdir())


def test_messages_have_no_parts(whole, tmp_path, capsys):
    for options, name in ((["--from", "1"], "from"), (["--every", "1"], "every")):
        assert main(["export", str(whole), "-o", str(tmp_path / "a.oem"), *options]) == 2
        assert capsys.readouterr().err == f"`--{name}` must be left out with .oem, but is given\n"
    assert main(["export", str(whole), "-o", str(tmp_path / "a.nc"), "--observables", "voltage[1]"]) == 2
    assert "must be whole arrays for .nc" in capsys.readouterr().err
