"""What a run file holds, and the commands that read it."""

import os
import re
import shutil
import subprocess
import sys

import h5py
import numpy as np
import pytest

from esail_jax import cli
from esail_jax.scenes.loading import parse
from esail_jax.steppers.fixed_step import STEPS_PER_FACTORISATION
from support import small_sail
from support.bits import esail_run
from support.new_process import heavy_imports_of
from support.run_kinds import OBSERVABLES


def test_run_file_holds_every_observable_with_unit_symbol_axes_and_equation(whole):
    with h5py.File(whole, "r") as file:
        assert set(OBSERVABLES) <= set(file["observables"])
        for name, data in file["observables"].items():
            assert set(data.attrs) >= {"unit", "symbol", "axes", "equation"}, name
            assert data.attrs["unit"] and data.attrs["symbol"], name
            axes = list(data.attrs["axes"])
            assert axes[0] == "time" and len(axes) == data.ndim, name
            assert all(size == 2 for axis, size in zip(axes, data.shape, strict=True) if axis == "tether")
        for name, axes in OBSERVABLES.items():
            shape = tuple(2 if axis == "tether" else int(axis) for axis in axes.split())
            assert file["observables"][name].shape[1:] == shape, name
            assert list(file["observables"][name].attrs["axes"]).count("tether") == axes.count("tether")
            if name not in ("precession_angle", "euler_sail"):
                assert np.isfinite(file["observables"][name][()]).all(), name


def test_run_file_holds_how_the_solver_fared(whole):
    with h5py.File(whole, "r") as file:
        rows = file["time"].shape[0]
        assert {"hub", "coulomb"} <= set(file["numerics"].attrs["terms"])
        numerics = {name: data[()] for name, data in file["numerics"].items()}
        assert {len(values) for values in numerics.values()} == {rows}
        assert (numerics["iterations_per_step"][1:] >= 1.0).all()
        assert 0.0 < numerics["last_increment"].max() <= 1e-8
        assert 0.0 < numerics["residual"].max() < 1e-3
        assert numerics["constraint_violation"].max() < 1e-9


def test_run_file_says_what_ran_and_where(whole):
    with h5py.File(whole, "r") as file:
        attributes = dict(file.attrs)
        assert attributes["status"] == "complete" and attributes["message"] == ""
        assert attributes["schema_version"] == 3 and attributes["steps"] == 800
        assert attributes["wall_time"] > 0.0 and attributes["compile_time"] > 0.0
        assert attributes["device"]
        for package in ("esail_jax", "jax", "jaxlib", "numpy", "h5py"):
            assert re.match(r"\d+\.\d+", attributes[f"version_{package}"])
        assert parse(file["scene"][()].decode(), "file") == parse(small_sail.TEXT, "text")
        assert file["time"].attrs["unit"] == "s"
        assert attributes["result"] == "successful" and attributes["method"] == "generalized-alpha"
        assert attributes["rejected_steps"] == 0
        assert len(file["state/motion"]) and file["state"].attrs["rows"] == 229, "80 s is no whole interval"
        assert file["final/time"][()] == 80.0


@pytest.mark.parametrize("t_end", [80.0, 30.07, 0.35, 0.07])
def test_saved_times_are_zero_the_multiples_of_the_interval_and_the_end(t_end, scene, tmp_path):
    """It holds, too, if interval and t_end are no multiples of the step, and if t_end is less than the
    step. The end makes no step shorter: the blocks of steps are those of a longer run."""
    assert esail_run(scene, tmp_path / "a.h5", "--t-end", t_end) == 0
    with h5py.File(tmp_path / "a.h5", "r") as file:
        expected = [*np.arange(0.0, t_end - 1e-9, 0.35), t_end]
        assert file["time"][()].tolist() == expected
        assert file["observables/kinetic_energy"].shape == (len(expected),)
        blocks = np.ceil((t_end / 0.1 - 1e-9) / STEPS_PER_FACTORISATION)
        assert file.attrs["steps"] == blocks * STEPS_PER_FACTORISATION
        error = np.abs(file["observables/energy_balance_error"][()]).max()
        assert error < 1e-6 * file["observables/kinetic_energy"][0]


def test_quiet_says_nothing_and_a_pipe_gets_no_progress(scene, tmp_path, capsys):
    assert esail_run(scene, tmp_path / "a.h5", "--t-end", 1) == 0
    assert capsys.readouterr() == ("", "")
    assert cli.main(["run", str(scene), "-o", str(tmp_path / "b.h5"), "--t-end", "1"]) == 0
    out, err = capsys.readouterr()
    assert err == "" and "complete" in out


def test_info_says_what_ran_how_it_ended_and_how_fast(whole, capsys):
    assert cli.main(["info", str(whole)]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    for word in (
        "complete",
        "2 tethers x 2 elements",
        "coulomb",
        "generalized-alpha, step 0.",
        "800 steps",
        "compiling",
    ):
        assert word in out


def test_info_of_several_runs_is_a_table(whole, wholes, tmp_path, capsys):
    """It has one column per run, and a row for every key in which the scenes differ."""
    shutil.copy(whole, tmp_path / "same.h5")
    assert cli.main(["info", str(whole), str(wholes("dopri8")), str(tmp_path / "same.h5")]) == 0
    out, err = capsys.readouterr()
    rows = {line[:22].split("  ")[0].strip(): line for line in out.splitlines()}
    assert err == "" and len(rows) == len(out.splitlines())
    assert rows["model"].endswith("  2 tethers x 2 elements") and "3 rods" in rows["model"]
    assert rows["steps"].split()[1] == rows["steps"].split()[3] == "800"
    assert rows["voltage.value"].split()[1:] == ["20000", "-", "20000"]
    assert cli.main(["info", str(whole), str(tmp_path / "none.h5")]) == 2
    assert capsys.readouterr() == ("", f"`{tmp_path}/none.h5` must be a run file, but does not exist\n")


def test_plot_of_several_runs(whole, wholes, tmp_path, capsys):
    """They are drawn on the same axes. Runs that cannot be compared are refused before anything is
    written."""
    shutil.copy(whole, tmp_path / "same.h5")
    figures = tmp_path / "figures"
    for others, reason in (
        ([wholes("dopri8")], "must be of a sail like"),
        ([tmp_path / "same.h5", tmp_path / "same.h5"], "must be different files"),
    ):
        assert cli.main(["plot", str(whole), *map(str, others), "-o", str(figures)]) == 2
        assert reason in capsys.readouterr().err and not figures.exists()
    assert cli.main(["plot", str(whole), str(tmp_path / "same.h5"), "-o", str(figures)]) == 0
    names = [f"compare_{name}.png" for name in ("tether", "sail", "energies")]
    assert capsys.readouterr().out.split() == [str(figures / name) for name in names]
    assert sorted(path.name for path in figures.iterdir()) == sorted(names)


def test_info_starts_without_jax(whole):
    """`esail info` only reads the file, which takes less time than the import of JAX."""
    assert heavy_imports_of(["info", str(whole)]) == (0, [])
    assert heavy_imports_of(["info", str(whole), str(whole)]) == (0, [])


def test_the_package_runs_as_a_module(whole):
    environment = os.environ | {"PYTHONWARNINGS": "error"}
    done = subprocess.run(
        [sys.executable, "-m", "esail_jax", "info", str(whole)],
        capture_output=True,
        text=True,
        env=environment,
    )
    assert (done.returncode, done.stderr) == (0, "") and "complete" in done.stdout
