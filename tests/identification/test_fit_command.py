"""`esail fit`: its files, what it refuses, and going on after an interruption."""

import importlib
import json

import numpy as np
import pytest

import esail_jax as esail
from esail_jax import cli
from esail_jax.commands import fitting
from esail_jax.scenes.toml_text import to_toml
from support.measured_sail import NOISE, TIMES, sail, served, shapes, telemetry, with_noise

FREE = ("solar_wind.thrust_factor", "hub.torque[1]", "bias.spin_rate[2]")
TRUTH = {"solar_wind.thrust_factor": 0.185, "hub.torque": [1e-3, 0.0, 0.0]}


def table(data):
    """Telemetry as the text of a CSV file."""
    columns = {"time [s]": data["time"]}
    for name in NOISE:
        columns |= {f"{name}[{k + 1}]": x for k, x in enumerate(data[name].T)}
    rows = [
        ",".join(columns),
        *(",".join(map(repr, row)) for row in np.stack([*columns.values()]).T.tolist()),
    ]
    return "\n".join(rows)


def files_in(folder, data):
    """The scene file and the data file, in a folder."""
    (folder / "sail.toml").write_text(to_toml(sail()))
    (folder / "data.csv").write_text(table(data))


def command(folder, *more, free=FREE):
    """Runs `esail fit` with the files of a folder; returns the exit code."""
    options = [x for name in free for x in ("--free", name)]
    options += [x for name, sd in NOISE.items() for x in ("--noise", f"{name}={sd}")]
    paths = [str(folder / name) for name in ("sail.toml", "data.csv")]
    return cli.main(["fit", *paths, "-o", str(folder / "fit"), *options, *more])


NOTHING = {"time": TIMES} | {name: np.zeros((len(TIMES), shapes()[name][0])) for name in NOISE}


@pytest.fixture(scope="module")
def data():
    """Telemetry of a sail with a torque and another factor."""
    return with_noise(telemetry(TRUTH), 3)


@pytest.fixture
def folder(tmp_path, data, monkeypatch):
    """A folder with a scene and its data; the command takes its runs from the program of all parameters."""
    monkeypatch.setattr(importlib.import_module("esail_jax.identification.fit"), "predictor", served)
    files_in(tmp_path, data)
    return tmp_path


@pytest.mark.nightly
def test_a_fit_leaves_its_result_its_scene_its_run_and_figures(folder, capsys):
    """fit.json has what is promised; fitted.toml is the scene with the estimates, and run.h5 its run, by
    which the residuals are those of the file; nothing is left of the way there."""
    assert command(folder, "--profile", "hub.torque[1]", "--prior", f"{FREE[0]}=normal:0.18:0.1") == 0
    out = folder / "fit"
    found = json.loads((out / "fit.json").read_text())
    assert found["parameters"] == list(FREE) and found["units"] == ["-", "N m", "rad/s"]
    values, sd = np.array(found["values"]), np.array(found["sd"])
    assert (np.abs(values - [0.185, 1e-3, 0.0]) < 4.0 * sd).all()
    covariance = np.array(found["covariance"])
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), sd, rtol=1e-12)
    np.testing.assert_allclose(np.array(found["correlation"]), covariance / np.outer(sd, sd), rtol=1e-9)
    assert found["degrees_of_freedom"] == 8 * len(TIMES) + 1 - 3
    assert found["weakest"].keys() == {"parameters", "weights", "sd", "words"}
    low, high = found["profile"]["hub.torque[1]"]
    np.testing.assert_allclose([values[1] - low, high - values[1]], sd[1], rtol=0.01)
    scene = esail.load_scene(out / "fitted.toml")
    assert scene.solar_wind.thrust_factor == values[0] and scene.hub.torque == (values[1], 0.0, 0.0)
    assert f"# bias.spin_rate[2] = {values[2]:.17g}  # rad/s" in (out / "fitted.toml").read_text()
    run = esail.load(out / "run.h5")
    again = esail.simulate(scene)
    np.testing.assert_array_equal(run["spin_rate"], again["spin_rate"])
    residuals = telemetry({"solar_wind.thrust_factor": values[0], "hub.torque": [values[1], 0.0, 0.0]})
    residuals["spin_rate"] = residuals["spin_rate"] + [0.0, values[2]]
    data = np.genfromtxt(folder / "data.csv", delimiter=",", skip_header=1)[:, 1:]
    shown = np.concatenate([residuals[name] / NOISE[name] for name in NOISE], axis=1)
    noise = np.repeat([NOISE["spin_rate"], NOISE["angular_velocity_B"], NOISE["coning_angle"]], [2, 3, 3])
    square = ((shown - data / noise) ** 2).sum() + ((values[0] - 0.18) / 0.1) ** 2
    assert found["chi_squared"] == pytest.approx(square, rel=1e-4)
    assert {"data", "correlation", "ellipses"} <= {path.stem for path in out.glob("*.p*")}
    assert not list(out.glob("progress*")) and not list(out.glob("*.part"))
    printed = capsys.readouterr().out
    assert f"hub.torque[1] lies between {low:.6g} and {high:.6g} (68 %, by its likelihood)" in printed
    # Complete: --resume says so and leaves everything; without it, the result is not overwritten.
    before = {path: path.stat().st_mtime_ns for path in out.iterdir()}
    assert command(folder, "--resume") == 0
    assert capsys.readouterr().out == f"{out / 'fit.json'} is complete already: nothing is left to fit\n"
    assert command(folder) != 0
    assert capsys.readouterr().err == f"`{out / 'fit.json'}` must not exist, but does\n"
    assert {path: path.stat().st_mtime_ns for path in out.iterdir()} == before


@pytest.mark.nightly
def test_an_interrupted_fit_goes_on_from_its_best_point(folder, capsys, monkeypatch):
    """Ctrl-C after the second better point: the folder has that point and no result. Without --resume the
    folder is refused, and with other noise, parameters or another prior, too; with it the fit starts at the
    point and ends at the estimates of a fit that was not interrupted."""
    write, points = fitting.write_progress, []

    def interrupt(path, best, identity):
        write(path, best, identity)
        points.append(best)
        if len(points) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(fitting, "write_progress", interrupt)
    out = folder / "fit"
    assert command(folder) == 130
    assert f"interrupted: {out / 'progress.json'} has the best point; --resume goes on" in (
        capsys.readouterr().err
    )
    assert [path.name for path in out.glob("*.json")] == ["progress.json"]
    assert json.loads((out / "progress.json").read_text())["values"] == points[1].values.tolist()
    assert command(folder) != 0
    assert "must not exist (or ask for --resume), but does" in capsys.readouterr().err
    for other in (["--prior", f"{FREE[0]}=normal:0.18:0.1"], ["--loss", "huber"], ["--noise", "voltage=1"]):
        assert command(folder, "--resume", *other) != 0
        assert capsys.readouterr().err.count("\n") == 1
    assert command(folder, "--resume", free=FREE[:2]) != 0
    assert capsys.readouterr().err.count("\n") == 1
    assert command(folder, "--resume", "--quiet") == 0
    assert points[2].evaluations == 1
    np.testing.assert_array_equal(points[2].values, points[1].values)
    resumed = json.loads((out / "fit.json").read_text())
    assert not (out / "progress.json").exists()
    whole = esail.identification.fit(sail(), folder / "data.csv", FREE, NOISE)
    assert (np.abs(np.array(resumed["values"]) - whole.values) < 1e-3 * whole.sd).all()
    capsys.readouterr()


WRONG = {
    "noise": (["--noise", "spin_rate"], "`--noise` must look like OBSERVABLE=SD, but is 'spin_rate'"),
    "noise twice": (
        ["--noise", "spin_rate=1"],
        "`--noise` must be given once for spin_rate, but is twice",
    ),
    "noise in words": (["--noise", "voltage=x"], "`--noise voltage` must be a number, but is 'x'"),
    "noise of another": (
        ["--noise", "voltage=1"],
        "must be that of columns of the data, but has voltage, which no column needs",
    ),
    "prior": (
        ["--prior", "hub.torque[1]"],
        "`--prior` must look like KEY=normal:MEAN:SD, but is 'hub.torque[1]'",
    ),
    "prior in words": (
        ["--prior", "hub.torque[1]=uniform:0:1"],
        "must be normal:MEAN:SD, or a pair of numbers, but is 'uniform:0:1'",
    ),
    "prior of another": (["--prior", "hub.mass=normal:1:1"], "must be of free parameters"),
    "profile": (["--profile", "hub.mass"], "`--profile` must be a free parameter"),
    "profile of outliers": (
        ["--profile", FREE[0], "--loss", "huber"],
        "`--loss` must be linear for a profile, but is huber",
    ),
    "evaluations": (["--evaluations", "0"], "`--evaluations` must be positive, but is 0"),
    "free": (["--free", "hub.masse"], "`hub.masse` must be a known key (perhaps `hub.mass`), but is not"),
    "free twice": (["--free", FREE[0]], f"must name every number once, but has {FREE[0]} twice"),
}


@pytest.mark.parametrize("case", WRONG)
def test_bad_options_write_nothing(case, tmp_path, capsys, nothing_compiles):
    """In one line, and without a folder."""
    files_in(tmp_path, NOTHING)
    options, message = WRONG[case]
    assert command(tmp_path, *options) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
    assert not (tmp_path / "fit").exists()


def test_bad_files_are_refused(tmp_path, capsys, nothing_compiles):
    """Data that are not there, a folder that is a file, and the progress of something else."""
    files_in(tmp_path, NOTHING)
    (tmp_path / "fit").write_text("")
    assert command(tmp_path) != 0
    assert capsys.readouterr().err.startswith("`-o` must be in a writable directory, but ")
    (tmp_path / "fit").unlink()
    (tmp_path / "fit").mkdir()
    (tmp_path / "fit" / "progress.json").write_text("{}")
    assert command(tmp_path, "--resume") != 0
    assert "must be the progress of a fit, but cannot be read" in capsys.readouterr().err
    (tmp_path / "data.csv").unlink()
    assert command(tmp_path, "--resume") == 2
    assert "cannot be read: No such file or directory" in capsys.readouterr().err
