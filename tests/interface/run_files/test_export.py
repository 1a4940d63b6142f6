"""`esail export`: the observables of a run file as a table and as netCDF."""

import csv

import numpy as np
import pytest
import xarray

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.html import html_table


def test_a_table_holds_every_number_of_the_run(whole, tmp_path, capsys, nothing_compiles):
    """A column for each number of an instant, with name, place and unit, and all digits."""
    path = tmp_path / "a.csv"
    assert main(["export", str(whole), "-o", str(path)]) == 0
    assert capsys.readouterr().out == f"{path}\n"
    run = esail.load(whole)
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    table = dict(zip(header, np.array(rows, float).T, strict=True))
    assert np.array_equal(table["time [s]"], run.time)
    assert np.array_equal(table["coning_angle[2] [rad]"], run["coning_angle"][:, 1])
    assert np.array_equal(table["rotation_IB[1,3] [-]"], run["rotation_IB"][:, 0, 2])
    assert np.array_equal(table["kinetic_energy [J]"], run["kinetic_energy"])
    assert len(header) == 1 + sum(x[0].size for x in run.values())


def test_netcdf_holds_every_array_with_its_unit(whole, tmp_path, nothing_compiles):
    path = tmp_path / "a.nc"
    assert main(["export", str(whole), "-o", str(path)]) == 0
    run = esail.load(whole)
    with xarray.open_dataset(path, engine="scipy") as data:
        assert set(data.data_vars) == set(run)
        assert all(np.array_equal(data[name], run[name], equal_nan=True) for name in run)
        assert data["coning_angle"].attrs["units"] == "rad"
        assert data["coning_angle"].dims == ("time", "tether")


def test_without_xarray_netcdf_is_refused_in_one_line(whole, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(["export", str(whole), "-o", str(tmp_path / "a.nc")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("`-o` must end in .csv unless xarray is installed, but ends in .nc")
    assert error.count("\n") == 1 and not list(tmp_path.iterdir())


def test_other_formats_and_existing_files_are_refused(whole, tmp_path, capsys):
    """A file is replaced only when asked."""
    assert main(["export", str(whole), "-o", str(tmp_path / "a.xls")]) == 2
    assert (
        capsys.readouterr().err == "`-o` must end in .csv, .nc, .zarr, .oem or .aem, but ends in '.xls'\n"
    )
    path = tmp_path / "a.csv"
    path.write_text("mine")
    assert main(["export", str(whole), "-o", str(path)]) == 2
    assert path.read_text() == "mine" and "must not exist" in capsys.readouterr().err
    assert main(["export", str(whole), "-o", str(path), "--overwrite"]) == 0
    assert path.read_text().startswith("time [s],")


@pytest.mark.parametrize("name", ["none/run.csv", "none/run.nc", "file/run.csv", "file/run.zarr"])
def test_a_folder_that_is_none_is_named_with_the_file_that_was_asked_for(name, whole, tmp_path, capsys):
    """Not with the temporary file, of which the user knows nothing."""
    (tmp_path / "file").write_text("")
    assert main(["export", str(whole), "-o", str(tmp_path / name)]) == 2
    line = capsys.readouterr().err
    assert line.startswith(f"`{tmp_path / name}` must be accessible") and line.count("\n") == 1


def test_a_link_to_a_zarr_store_is_followed(whole, tmp_path):
    """The store behind it is replaced, and the link stays."""
    store, link = tmp_path / "store.zarr", tmp_path / "link.zarr"
    esail.export(whole, store, observables="kinetic_energy")
    link.symlink_to(store)
    esail.export(whole, link, observables="coning_angle", overwrite=True)
    assert link.is_symlink() and (store / "coning_angle").exists()
    assert not (store / "kinetic_energy").exists() and not list(tmp_path.glob("*.part"))


def test_a_notebook_shows_run_and_scene_as_tables(whole):
    """The table of a run has a row for each observable with its unit and range, that of a scene a row for
    each key with its value, unit and meaning. Texts are escaped."""
    run = esail.load(whole)
    text = run._repr_html_()
    assert text.count("<tr>") == 1 + len(run)
    row = f"{run['coning_angle'].min():.6g}"
    assert "coning_angle" in text and "time, tether" in text and row in text
    text = run.scene._repr_html_()
    assert "tethers.youngs_modulus" in text and "<td style='text-align:left'>Pa</td>" in text
    assert "<td>a &lt; b &amp; c</td>" in html_table("", ["x"], [["a < b & c"]]).replace(
        " style='text-align:left'", ""
    )
