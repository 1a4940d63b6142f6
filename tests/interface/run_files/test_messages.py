"""`esail export` to messages of flight dynamics: what public readers find in them is what the run has."""

import dataclasses

import numpy as np
import pytest
from ccsds_ndm.ndm_io import NdmIo
from oem import OrbitEphemerisMessage

import esail_jax as esail
from esail_jax.calendar.frames import TO_EQUATOR
from esail_jax.cli import main

RADIUS, RATE = 1.5e11, 2e-7
TILT = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(0.1), -np.sin(0.1)], [0.0, np.sin(0.1), np.cos(0.1)]])


@pytest.fixture(scope="module")
def flown(solution):
    """A run with an epoch whose hub moves on a tilted circle about the Sun and turns about X."""
    run = esail.simulate(
        solution.scene, {"initial.epoch": "2027-03-01T12:00:00"}, times=np.arange(0.0, 71.0, 10.0).tolist()
    )
    angle, spin = RATE * run.time, 0.01 * run.time
    zero = 0.0 * angle
    position = RADIUS * np.stack([np.cos(angle), np.sin(angle), zero], axis=1) @ TILT.T
    velocity = RADIUS * RATE * np.stack([-np.sin(angle), np.cos(angle), zero], axis=1) @ TILT.T
    turn = np.zeros((len(spin), 3, 3))
    turn[:, 0, 0] = 1.0
    turn[:, 1, 1] = turn[:, 2, 2] = np.cos(spin)
    turn[:, 2, 1], turn[:, 1, 2] = np.sin(spin), -np.sin(spin)
    rates = np.tile([0.01, 0.0, 0.0], (len(spin), 1))
    added = {"heliocentric_position": position, "heliocentric_velocity": velocity}
    seen = dict(run) | added | {"rotation_IB": turn, "angular_velocity_B": rates}
    return dataclasses.replace(run, observables=seen)


@pytest.fixture(scope="module")
def file(flown, tmp_path_factory):
    path = tmp_path_factory.mktemp("flown") / "sail.h5"
    esail.save(flown, path)
    return path


def test_an_orbit_is_that_of_the_run(file, flown, tmp_path, capsys):
    """To the last printed digit, in the equator of J2000, in km and km/s; with the dates of the run."""
    path = tmp_path / "run.oem"
    names = ["--object", "SAIL 1", "--mission", "2027-012A"]
    assert main(["export", str(file), "-o", str(path), *names]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == str(path) and "degree 7 (Hermite)" in printed[1]
    (segment,) = OrbitEphemerisMessage.open(path)
    assert segment.metadata["OBJECT_NAME"] == "SAIL 1" and segment.metadata["OBJECT_ID"] == "2027-012A"
    assert segment.metadata["CENTER_NAME"] == "SUN" and segment.metadata["TIME_SYSTEM"] == "UTC"
    states = list(segment.states)
    assert [x.epoch.isot for x in states] == flown.dates(6)
    position, velocity = (
        1e-3 * flown[name] @ TO_EQUATOR.T for name in ("heliocentric_position", "heliocentric_velocity")
    )
    assert np.abs(np.array([x.position for x in states]) - position).max() < 0.6e-6
    assert np.abs(np.array([x.velocity for x in states]) - velocity).max() < 0.6e-9


def test_an_attitude_is_that_of_the_run(file, flown, tmp_path, capsys):
    """The quaternion turns EME2000 into the axes of the hub; the largest turn between rows is said."""
    path = tmp_path / "run.aem"
    assert main(["export", str(file), "-o", str(path), "--time-system", "TDB"]) == 0
    assert "turns by 5.73 deg at most" in capsys.readouterr().out
    (segment,) = NdmIo().from_path(path).body.segment
    assert segment.metadata.time_system.value == "TDB" and segment.metadata.object_name == "sail"
    rows = segment.data.attitude_state
    for row, rotation in zip(rows, flown["rotation_IB"], strict=True):
        given = row.quaternion_state.quaternion
        x, y, z, w = (float(getattr(given, name)) for name in ("q1", "q2", "q3", "qc"))
        q = np.array([x, y, z])
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        matrix = (w * w - q @ q) * np.eye(3) + 2.0 * np.outer(q, q) + 2.0 * w * cross
        assert np.abs(matrix - TO_EQUATOR @ rotation).max() < 1e-11


def test_what_has_no_orbit_or_date_is_refused(file, whole, flown, tmp_path, capsys):
    """In one line, and nothing is written."""
    esail.save(
        dataclasses.replace(
            flown, observables=dict(flown) | {"angular_velocity_B": 400.0 * flown["angular_velocity_B"]}
        ),
        tmp_path / "fast.h5",
    )
    still = {name: x for name, x in flown.items() if name != "angular_velocity_B"}
    esail.save(dataclasses.replace(flown, observables=still), tmp_path / "still.h5")
    for run, name, options, message in (
        (whole, "a.oem", [], "must have an epoch (`initial.epoch`) for dates, but has none"),
        (
            tmp_path / "fast.h5",
            "a.aem",
            [],
            "must turn by less than 180 deg between two rows, but turns by 2292",
        ),
        (tmp_path / "still.h5", "a.aem", [], "must have the observable `angular_velocity_B`, but has not"),
        (file, "a.oem", ["--calendar"], "`--calendar` must be left out with .oem, but is given"),
        (file, "a.csv", ["--mission", "x"], "`--mission` must be left out with .csv, but is given"),
        (
            file,
            "a.oem",
            ["--object", "Gerät"],
            "`--object` must be 1 to 200 printable characters of ASCII",
        ),
    ):
        assert main(["export", str(run), "-o", str(tmp_path / name), *options]) == 2
        error = capsys.readouterr().err
        assert message in error and error.count("\n") == 1 and not (tmp_path / name).exists()
