"""Bad input is answered by one line that names the key.

Each case has exit status 2, one line on stderr and nothing on stdout. No file is made or changed, and
nothing is compiled.
"""

import re
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

from esail_jax import cli
from support import small_sail

pytestmark = pytest.mark.usefixtures("nothing_compiles")


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(small_sail.TEXT)
    return path


def contents(folder: Path):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def complaint(arguments, capsys, folder) -> str:
    """Runs a command that is refused and returns its one line."""
    before = contents(folder)
    status = cli.main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    assert (status, out) == (2, ""), err
    assert err.endswith("\n") and err.count("\n") == 1, err
    assert contents(folder) == before, "something was written"
    return err.strip()


def check_refused(arguments, key, capsys, folder, *words):
    """Checks that the line reads: `key` must ..., but ... ."""
    line = complaint(arguments, capsys, folder)
    assert re.match(rf"`{re.escape(str(key))}` must .+, but .+", line), line
    for word in words:
        assert word in line, line


SETTINGS = [
    # wrong types
    ("tethers.length=long", "a number or a list", "'long'"),
    ("tethers.length=true", "a number", "true"),
    ("tethers.length=[true, 1.0]", "a number"),
    ("tethers.length=[]", "a number or a list with one per tether", "[]"),
    ("tethers.length=[1.0, 2.0, 3.0]", "list of 2", "3 entries"),
    ("tethers.length=[1e4]", "list of 2", "1 entries"),
    ("tethers.length=[[1.0, 2.0], [3.0, 4.0]]", "a number or a list"),
    ("tethers.length={of = 1.0}", "a number"),
    ('tethers.length=["1e4", "1e4"]', "a number"),
    ("tethers.length=2024-01-01", "a number"),
    ("tethers.length=1e4]", "a number", "'1e4]'"),
    ("tethers.length=" + 5000 * "9", "a number", "..."),
    ("hub.height=[2.0, 2.0]", "a single number"),
    ("initial.spin_rate=[4e-3]", "a single number"),
    ("hub.height=", "a number", "''"),
    ("tethers.bending=1", "true or false", "1"),
    ("tethers.bending=yes", "true or false", "'yes'"),
    ("gravity.acceleration=9.81", "list of three numbers", "9.81"),
    ("gravity.acceleration=[0.0, 9.81]", "list of three numbers", "[0.0, 9.81]"),
    ('gravity.acceleration=[0.0, "down", 0.0]', "a number for each of x, y, z"),
    # numbers out of range
    ("tethers.area=nan", "finite", "nan"),
    ("tethers.area=inf", "finite", "inf"),
    ("tethers.area=1e999", "finite", "inf"),
    ("tethers.area=-1.0", "positive", "-1.0"),
    ("tethers.area=[1e-9, 0.0]", "positive"),
    ("hub.radius=0", "positive", "0"),
    ("remote_units.mass=-1", "not be negative"),
    ("remote_units.mass=[1.5, -1.0]", "not be negative", "[1.5, -1.0]"),
    ("voltage.value=-inf", "finite"),
    ("solar_wind.speed=0.0", "positive"),
    ("solar_wind.number_density=-1.0", "not be negative"),
    ("tethers.axial_damping_time=-1.0", "not be negative"),
    ("tethers.count=0", "positive integer", "0"),
    ("tethers.count=-3", "positive integer"),
    ("tethers.count=1.5", "positive integer", "1.5"),
    ("tethers.count=2.0", "positive integer"),
    ("tethers.count=true", "positive integer", "true"),
    ("tethers.count=two", "positive integer"),
    ("tethers.elements=0", "positive integer"),
    ("tethers.elements=[2, 2]", "positive integer"),
    ("initial.sailing_angle_deg=-180", "(-180, 180]"),
    ("initial.sailing_angle_deg=180.0001", "(-180, 180]"),
    ("initial.coning_angle_deg=90", "(-90, 90)"),
    ("initial.coning_angle_deg=-90", "(-90, 90)"),
    ("initial.heliocentric_position_au=[1.0, 0.0]", "three numbers"),
    ("initial.heliocentric_position_au=1.0", "three numbers"),
    ("initial.heliocentric_position_au=[0.0, 0.0, 1.0]", "axis"),
    ("initial.heliocentric_position_au=[0.0, 0.0, 0.0]", "axis"),
    ("integrator.spectral_radius=1.0", "below 1"),
    ("integrator.spectral_radius=1.1", "[0, 1]"),
    ("integrator.spectral_radius=-0.1", "[0, 1]"),
    ("integrator.t_end=0", "positive"),
    ("integrator.step=0.0", "positive"),
    ("integrator.step=-0.1", "positive"),
    ("integrator.step=[0.1, 0.1]", "a single number"),
    ("output.interval=0", "positive"),
    ("output.interval=-5.0", "positive"),
    # choices
    ("tethers.element=beam", '"cable" or "truss"', "'beam'"),
    ("tethers.element=1", '"cable" or "truss"'),
    ('tethers.element=["cable"]', '"cable" or "truss"'),
    ("tethers.strain=hencky", '"green-lagrange" or "engineering"'),
    ("tethers.root=welded", '"pinned" or "clamped"'),
    ("initial.elongation=none", '"steady" or "paper"'),
    ("integrator.method=euler", '"generalized-alpha"'),
    # unknown keys, with the nearest known one
    ("tethers.lenght=1e4", "known key", "`tethers.length`"),
    ("tether.length=1e4", "known key", "`tethers.length`"),
    ("integrator.tolerance=1e-9", "left out with generalized-alpha"),
    ("integrator.method=dopri8", "for a sail"),
    ("tethers.length.x=1", "known key"),
]


@pytest.mark.parametrize(
    ("setting", "words"), [(s, words) for s, *words in SETTINGS], ids=lambda x: str(x)[:50]
)
def test_bad_setting_is_refused_in_one_line(setting, words, scene, tmp_path, capsys):
    """`--set KEY=VALUE` with a value that the model does not allow is refused."""
    key = setting.partition("=")[0]
    check_refused(["run", scene, "-o", tmp_path / "a.h5", "--set", setting], key, capsys, tmp_path, *words)


TOGETHER = [
    (["tethers.element=truss", "tethers.bending=true"], "tethers.bending", "truss"),
    (["tethers.element=truss", "tethers.root=clamped"], "tethers.root", "truss"),
    (["tethers.bending=true"], "tethers.second_moment", "missing"),
    (["tethers.straight_turn=1e-3"], "tethers.straight_turn", "without `tethers.bending_damping_time`"),
    (["hub.height=1", "hub.height=-1"], "hub.height", "positive"),
    (["chain.rods=3"], "chain", "[tethers]"),
    (["event.time=[5.0]"], "event.release", "missing"),
    (["event.time=5.0", "event.release=[1]"], "event.time", "list of numbers"),
    (["event.time=[0.0]", "event.release=[1]"], "event.time", "positive"),
    (["event.time=[5.0]", "event.release=1"], "event.release", "list of integers"),
    (["event.time=[5.0]", "event.release=[1.5]"], "event.release", "positive integer"),
    (["event.time=[5.0]", "event.release=[3]"], "event.release", "at most 2 (`tethers.count`)"),
    (["event.time=[5.0]", "event.release=[1, 2]"], "event.release", "1"),
    (["event.time=[5.0, 6.0]", "event.release=[1, 1]"], "event.release", "once"),
]


@pytest.mark.parametrize(("settings", "key", "word"), TOGETHER, ids=lambda x: str(x)[:50])
def test_settings_that_contradict_each_other_are_refused(settings, key, word, scene, tmp_path, capsys):
    options = [part for setting in settings for part in ("--set", setting)]
    check_refused(["run", scene, "-o", tmp_path / "a.h5", *options], key, capsys, tmp_path, word)


def without(part: str) -> str:
    assert part in small_sail.TEXT
    return small_sail.TEXT.replace(part, "")


def instead(part: str, other: str) -> str:
    assert part in small_sail.TEXT
    return small_sail.TEXT.replace(part, other)


VOLTAGE = "[voltage]\nvalue = 20e3\n"
WIND = "[solar_wind]\nspeed = 4e5\nnumber_density = 7.3e6\ncutoff_voltage = 1e3\n"
INITIAL = "[initial]\nspin_rate = 4e-3\nsailing_angle_deg = 10.0\n"

FILES = {
    "unknown table": (small_sail.TEXT + "[hubs]\nheight = 2.0\n", "hubs", "`hub`"),
    "unknown key": (instead("radius = 1.0", "radius = 1.0\nradios = 1.0"), "hub.radios", "`hub.radius`"),
    "unknown key above all tables": ("count = 3\n" + small_sail.TEXT, "count", "known key"),
    "missing tethers": (
        "[initial]\nspin_rate = 0.0\n[integrator]\nt_end = 1.0\n",
        "tethers.count",
        "missing",
    ),
    "missing initial": (without(INITIAL), "initial.spin_rate", "missing"),
    "missing integrator": (
        without("[integrator]\nt_end = 80.0\nstep = 0.1\n"),
        "integrator.t_end",
        "missing",
    ),
    "missing key": (without("youngs_modulus = 70e9\n"), "tethers.youngs_modulus", "missing"),
    "missing key of an optional table": (without("density = 884.0\n"), "hub.density", "missing"),
    "empty table": (instead("[output]\ninterval = 0.35", "[output]"), "output.interval", "missing"),
    "empty file": ("", "tethers.count", "missing"),
    "table that is a number": ("hub = 2.0\n" + small_sail.TEXT.split("884.0\n")[1], "hub", "table"),
    "table that is a list": (instead("[voltage]", "[[voltage]]"), "voltage", "table"),
    "key that is a table": (instead("value = 20e3", "[voltage.value]\nx = 1.0"), "voltage.value", "number"),
    "wind without voltage": (without(VOLTAGE), "voltage.value", "solar_wind"),
    "voltage without wind": (without(WIND), "solar_wind.speed", "voltage"),
    "event without a time": (small_sail.TEXT + "[[event]]\nrelease = 1\n", "event.time", "missing"),
    "event that lacks what another has": (
        small_sail.TEXT + "[[event]]\nrelease = 1\n[[event]]\nrelease = 2\ntime = 5.0\n",
        "event.time",
        "every [[event]]",
    ),
    "unknown key of an event": (
        small_sail.TEXT + "[[event]]\ntime = 5.0\nreleased = 1\n",
        "event.released",
        "`event.release`",
    ),
    "bad value": (instead("count = 2", "count = 2.5"), "tethers.count", "2.5"),
}


@pytest.mark.parametrize("name", FILES)
def test_bad_scene_file_is_refused_in_one_line(name, tmp_path, capsys):
    text, key, word = FILES[name]
    path = tmp_path / "bad.toml"
    path.write_text(text)
    check_refused(["run", path, "-o", tmp_path / "a.h5"], key, capsys, tmp_path, word)


@pytest.mark.parametrize(
    "content",
    [
        b"[tethers\ncount = 2",
        b"count = 2\ncount = 3",
        b"\xff\xfe\x00",
        b"\x89HDF\r\n\x1a\n",
        b"a = " + 5000 * b"9",
    ],
    ids=["unclosed", "twice", "not utf-8", "HDF5", "5000 digits"],
)
def test_a_file_that_is_not_toml_is_refused_by_name(content, tmp_path, capsys):
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    check_refused(["run", path, "-o", tmp_path / "a.h5"], path, capsys, tmp_path, "TOML file")


@pytest.mark.parametrize("name", ["missing.toml", "", "basline", "folder"])
def test_a_scene_that_cannot_be_read_is_refused_by_name(name, tmp_path, capsys):
    """The scene is a missing file, an empty name, a mistyped built-in scene, or a directory."""
    (tmp_path / "folder").mkdir()
    source = tmp_path / name if name in ("missing.toml", "folder") else name
    check_refused(["run", source, "-o", tmp_path / "a.h5"], source, capsys, tmp_path, "built-in scene")


USAGE = [
    ([], "COMMAND"),
    (["fly"], "fly"),
    (["run"], "scene"),
    (["run", "baseline"], "-o"),
    (["run", "baseline", "-o"], "-o"),
    (["run", "baseline", "-o", "a.h5", "--sett", "a.b=1"], "--sett"),
    (["run", "baseline", "-o", "a.h5", "--t-en", "1"], "--t-en"),
    (["run", "baseline", "-o", "a.h5", "--set"], "--set"),
    (["run", "baseline", "-o", "a.h5", "--set", "hub.height"], "--set"),
    (["run", "baseline", "-o", "a.h5", "--set", "height=3"], "--set"),
    (["run", "baseline", "-o", "a.h5", "--set", "=3"], "--set"),
    (["run", "baseline", "-o", "a.h5", "extra"], "extra"),
    (["run", "baseline", "-o", "a.h5", "two\nlines"], "two lines"),
    (["scenes", "extra"], "extra"),
    (["info"], "RUN.h5"),
]


@pytest.mark.parametrize(("arguments", "word"), USAGE, ids=lambda x: str(x)[:50])
def test_bad_command_line_is_refused_in_one_line(arguments, word, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert word in complaint(arguments, capsys, tmp_path)


@pytest.mark.parametrize("t_end", ["0", "-1", "nan", "soon", "true", "[1.0]", ""])
def test_bad_end_time_is_refused(t_end, scene, tmp_path, capsys):
    check_refused(
        ["run", scene, "-o", tmp_path / "a.h5", "--t-end", t_end], "integrator.t_end", capsys, tmp_path
    )


def test_output_in_a_missing_directory_is_refused(scene, tmp_path, capsys):
    check_refused(
        ["run", scene, "-o", tmp_path / "no" / "a.h5"], "-o", capsys, tmp_path, "existing directory"
    )


def test_output_that_is_a_directory_is_refused(scene, tmp_path, capsys):
    (tmp_path / "a.h5").mkdir()
    for more in ([], ["--resume"]):
        check_refused(["run", scene, "-o", tmp_path / "a.h5", *more], "-o", capsys, tmp_path, "directory")


def test_existing_output_is_refused_without_resume(scene, tmp_path, capsys):
    (tmp_path / "a.h5").write_text("precious")
    check_refused(["run", scene, "-o", tmp_path / "a.h5"], "-o", capsys, tmp_path, "--resume")


def test_resuming_what_is_no_run_is_refused(scene, tmp_path, capsys):
    """The file is a text, an HDF5 file of another kind, or empty."""
    (tmp_path / "text.h5").write_text("precious")
    (tmp_path / "empty.h5").touch()
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["scene"] = "of another program"
    for name in ("text.h5", "empty.h5", "other.h5"):
        path = tmp_path / name
        check_refused(["run", scene, "-o", path, "--resume"], path, capsys, tmp_path, "run file")


@pytest.mark.parametrize("kind", ["missing", "text", "folder"])
def test_info_about_what_is_no_run_is_refused(kind, tmp_path, capsys):
    (tmp_path / "text").write_text("precious")
    (tmp_path / "folder").mkdir()
    check_refused(["info", tmp_path / kind], tmp_path / kind, capsys, tmp_path, "run file")


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("apendix-d", "(perhaps `appendix-d`)"),
        ("mine.toml", "(`esail scenes` lists"),
        ("run.h5", "a file of results"),
    ],
)
def test_a_scene_that_cannot_be_read_says_what_was_meant(name, hint, tmp_path, capsys, monkeypatch):
    """A misspelt built-in scene, a missing file, and a run file in place of a scene."""
    monkeypatch.chdir(tmp_path)
    with h5py.File("run.h5", "w") as file:
        file["time"] = [0.0, 1.0]
    check_refused(["modes", name], name, capsys, tmp_path, "built-in scene or a TOML file", hint)


def test_the_shell_sees_the_same(tmp_path):
    """A process has the same exit status and output, for a bad key and for a bad command."""
    for arguments, word in (
        (
            ["run", "baseline", "-o", "a.h5", "--set", "hub.height=-1"],
            "`hub.height` must be positive, but is -1",
        ),
        (["fly"], "fly"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", "esail_jax", *arguments], cwd=tmp_path, capture_output=True, text=True
        )
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
        assert word in done.stderr and not list(tmp_path.iterdir())
