"""`esail export` of an ensemble: a long table, netCDF and Zarr, from files and from memory."""

import csv

import numpy as np
import pytest
import xarray

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.ensembles import load_ensemble


def table_of(path):
    """Header and columns of a table, the columns by their names."""
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    return header, dict(zip(header, np.array(rows, float).T, strict=True))


def test_the_long_table_holds_every_number(finished, tmp_path, capsys):
    """All rows of the first member, then all of the next one, with number and inputs of the member."""
    path = tmp_path / "a.csv"
    assert main(["export", str(finished.parent), "-o", str(path)]) == 0
    assert capsys.readouterr().out == f"{path}\n"
    ensemble = load_ensemble(finished)
    header, table = table_of(path)
    members, instants = len(ensemble), len(ensemble.time)
    assert header[:2] == ["member", "time [s]"]
    assert np.array_equal(table["member"], np.repeat(np.arange(members), instants))
    assert np.array_equal(table["time [s]"], np.tile(ensemble.time, members))
    for key, values in ensemble.inputs.items():
        columns = [x for name, x in table.items() if name.startswith(key)]
        expected = np.repeat(np.asarray(values).reshape(members, -1), instants, axis=0)
        assert np.array_equal(np.array(columns).T, expected)
    for name, values in ensemble.observables.items():
        columns = [x for head, x in table.items() if head.partition(" ")[0].partition("[")[0] == name]
        assert np.array_equal(np.array(columns).T, values.reshape(members * instants, -1), equal_nan=True)


def test_a_part_of_the_table(finished, tmp_path):
    ensemble = load_ensemble(finished)
    name = next(iter(ensemble.keys()))
    path = tmp_path / "a.csv"
    last = float(ensemble.time[1])
    place = "[1]" if ensemble[name].ndim > 2 else ""
    options = ["--observables", f"{name}{place}", "--to", repr(last)]
    assert main(["export", str(finished), "-o", str(path), *options]) == 0
    _, table = table_of(path)
    part = ensemble[name][:, :2].reshape(len(ensemble), 2, -1)[:, :, 0]
    assert np.array_equal(list(table.values())[-1], part.ravel())
    assert np.array_equal(np.unique(table["time [s]"]), ensemble.time[:2])


@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
def test_arrays_have_members_units_and_messages(finished, tmp_path, suffix):
    """Of a file and of the ensemble in memory the same."""
    ensemble = load_ensemble(finished)
    first, second = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    assert main(["export", str(finished), "-o", str(first)]) == 0
    assert esail.export(ensemble, second) == second
    opened = xarray.open_zarr if suffix == ".zarr" else xarray.open_dataset
    for path in (first, second):
        how = {"consolidated": False} if suffix == ".zarr" else {"engine": "scipy"}
        data = opened(path, **how).load()
        data.close()
        for name, values in ensemble.observables.items():
            assert data[name].dims[:2] == ("member", "time")
            assert np.array_equal(data[name], values, equal_nan=True)
            assert data[name].attrs["units"] == esail.observables.described(name).unit
        for key, values in ensemble.inputs.items():
            assert np.array_equal(data[key], values) and data[key].dims[0] == "member"
        assert np.array_equal(data["complete"].astype(bool), ensemble.complete)
        texts = [x.decode() if isinstance(x, bytes) else str(x) for x in data["message"].values.tolist()]
        assert texts == list(ensemble.messages)


def test_members_that_are_not_computed_are_left_out_and_said(finished, tmp_path, capsys):
    """A table has no row of them; the command says how many they are."""
    ensemble = load_ensemble(finished)
    steps = ensemble.steps.astype(float)
    steps[[1, 4]] = np.nan
    part = esail.ensembles.Ensemble(**{**vars(ensemble), "steps": steps})
    esail.export(part, tmp_path / "a.csv", observables=next(iter(ensemble.keys())))
    _, table = table_of(tmp_path / "a.csv")
    assert set(table["member"]) == set(range(len(ensemble))) - {1, 4}


def test_no_folder_but_a_store_is_replaced(finished, tmp_path, capsys):
    """`--overwrite` removes a Zarr store, and nothing else that has its name."""
    mine = tmp_path / "a.zarr"
    mine.mkdir()
    (mine / "mine.txt").write_text("mine")
    assert main(["export", str(finished), "-o", str(mine)]) == 2
    assert main(["export", str(finished), "-o", str(mine), "--overwrite"]) == 2
    assert "`-o` must be a Zarr store to be replaced" in capsys.readouterr().err
    assert [x.name for x in tmp_path.iterdir()] == ["a.zarr"] and (mine / "mine.txt").exists()
    store = tmp_path / "b.zarr"
    for options in ([], ["--overwrite"]):
        assert main(["export", str(finished), "-o", str(store), *options]) == 0


def test_an_ensemble_has_no_orbit(finished, tmp_path, capsys):
    assert main(["export", str(finished), "-o", str(tmp_path / "a.oem")]) == 2
    assert "must be a file of one run, but is of an ensemble" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
