"""Scripts of `docs/howto/other_tools.md`: what a run hands to programs that move a spacecraft."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from esail_jax.cli import main

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "howto" / "other_tools.md").read_text(encoding="utf-8")
TABLE = """\
time [s],date [UTC],{}
5.0,2027-03-01T12:00:05.250,{}
15.0,2027-03-01T12:00:15.250,{}
"""
TILT = np.radians(84381.448 / 3600.0)


def script(name, *arguments):
    """What a script of the documentation does."""
    command = [sys.executable, ROOT / "docs" / "scripts" / f"{name}.py", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def table_of(path, thrusts, scale="UTC"):
    """A table whose hub stands on the axis X of the ecliptic, where the axes i_O, j_O, k_O are Y, Z, X."""
    names = ("thrust_O", "heliocentric_position", "heliocentric_velocity")
    titles = ",".join(f"{name}[{i}] [-]" for name in names for i in (1, 2, 3))
    rows = (",".join(map(str, (*thrust, 1.5e11, 0.0, 0.0, 0.0, 0.0, 3e4))) for thrust in thrusts)
    path.write_text(TABLE.format(titles, *rows).replace("[UTC]", f"[{scale}]"))


def test_a_thrust_history_has_the_thrust_in_the_equator(tmp_path):
    """Away from the Sun, along X of both frames, and then along i_O, the axis Y of the ecliptic."""
    table_of(tmp_path / "a.csv", [(0.0, 0.0, 2.0), (3.0, 0.0, 0.0)])
    done = script("gmat_thrust", tmp_path / "a.csv", tmp_path / "a.thrust")
    lines = (tmp_path / "a.thrust").read_text().splitlines()
    assert lines[:6] == [
        "BeginThrust {Segment1}",
        "Start_Epoch = 01 Mar 2027 12:00:05.250",
        "Thrust_Vector_Coordinate_System = EarthMJ2000Eq",
        "Thrust_Vector_Interpolation_Method = CubicSpline",
        "Mass_Flow_Rate_Interpolation_Method = None",
        "ModelThrustOnly",
    ]
    rows = np.array([line.split() for line in lines[6:8]], float)
    expected = [[0.0, 2.0, 0.0, 0.0], [10.0, 0.0, 3.0 * np.cos(TILT), 3.0 * np.sin(TILT)]]
    assert np.abs(rows - expected).max() < 1e-14  # printed with 16 digits
    assert lines[8:] == ["EndThrust {Segment1}"]
    start = dict(re.findall(r"Sail\.(\w+) = (.*);", done.stdout))
    assert start["Epoch"] == "'01 Mar 2027 12:00:05.250'"
    assert float(start["X"]) == 1.5e8
    assert abs(float(start["VY"]) + 30.0 * np.sin(TILT)) < 1e-13
    assert abs(float(start["VZ"]) - 30.0 * np.cos(TILT)) < 1e-13


def test_dates_in_tdb_are_no_start_epoch(tmp_path):
    """They would shift the thrust by 69 s."""
    table_of(tmp_path / "a.csv", [(0.0, 0.0, 2.0)] * 2, "TDB")
    done = script("gmat_thrust", tmp_path / "a.csv", tmp_path / "a.thrust")
    assert done.returncode == 1
    assert done.stderr == "The dates must be in UTC, but are in TDB.\n"
    assert not (tmp_path / "a.thrust").exists()


@pytest.mark.nightly
def test_the_thrust_of_a_run_moves_a_point_as_its_sail(tmp_path, monkeypatch):
    """The commands of the page, but for Basilisk. The orbit under the thrust history is that of the centre
    of mass, to the rounding of the message: half a millimetre and half a micrometre per second in each of
    three components. Without thrust it would be off by 655 m. The hub is away from the centre of mass, as
    the tethers cone."""
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```shell\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)
    printed = ""
    for line in "".join(blocks).replace("\\\n", "").splitlines():
        first, *words = shlex.split(line)
        if first == "esail":
            assert main(words) == 0
        elif "basilisk" not in line:
            done = script(Path(words[0]).stem, *words[1:])
            assert done.returncode == 0, done.stderr
            printed = done.stdout
    found = [[float(x) for x in re.findall(r"([\d.e-]+) m", line)] for line in printed.splitlines()]
    (hub, hub_speed), (centre, speed) = found
    assert 1.0 < hub < 1.3 and 4e-3 < hub_speed < 5e-3
    assert centre < 1e-3 and speed < 1e-6
    head = (tmp_path / "sail.thrust").read_text().splitlines()[:6]
    assert "\n".join(head) in TEXT
