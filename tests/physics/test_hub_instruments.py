"""A constant torque on the hub (`hub.torque`), and the instruments on it: an accelerometer and a camera."""

import numpy as np
import pytest

import esail_jax as esail
from esail_jax import cli
from esail_jax.commands.running import names_with

STEP = 0.1
"""Time between the rows of which differences are taken [s]."""

INSTRUMENTS = ("hub_acceleration_B", "tip_direction_B")

QUIET = {
    "tethers.count": 3, "tethers.elements": 2, "tethers.length": 300.0,
    "remote_units.mass": 0.5, "voltage.value": 0.0, "initial.spin_rate": 0.05,
    "hub.height": 1.0, "hub.radius": 1.0, "hub.density": 100.0,
    "integrator.t_end": 60.0, "integrator.tolerance": 1e-10, "output.interval": 2.0,
}  # fmt: skip
"""Three short tethers without thrust. 300 kg of hub."""

SKEW = {
    "hub.height": None, "hub.radius": None, "hub.density": None, "hub.mass": 40.0,
    "hub.inertia": np.array([[8.0, 0.5, 0.2], [0.5, 6.0, -0.3], [0.2, -0.3, 7.0]]),
    "hub.centre": np.array([0.05, -0.1, 0.02]),
    "hub.roots": np.array([[0.1, 0.5, 0.0], [-0.1, -0.3, 0.4], [0.0, -0.2, -0.5]]),
}  # fmt: skip
"""A hub without symmetry, whose centre of mass is not its centre."""


@pytest.fixture(scope="module")
def skew():
    """A run with a torque, in the wind, and with the instruments."""
    given = QUIET | SKEW | {"hub.torque": np.array([0.02, -0.01, 0.03]), "voltage.value": 20e3}
    given |= {"integrator.t_end": 6.0, "output.interval": STEP}
    scene = esail.load_scene("truss", given)
    return esail.simulate(scene, save=names_with(scene, INSTRUMENTS))


def test_a_torque_about_the_spin_axis_changes_the_angular_momentum_by_its_impulse(validate):
    """H_x(t) = H_x(0) + T t for a sail of equal tethers without thrust, whose axis stays where it is, while
    its tethers lag; the work of the torque is the gain of energy, with what is dissipated."""
    torque = 0.05
    run = esail.simulate("truss", QUIET | {"hub.torque": [torque, 0.0, 0.0]})
    axis = run["rotation_IB"][0, :, 0]
    gained = (run["angular_momentum_I"] - run["angular_momentum_I"][0]) @ axis
    error = np.abs(gained - torque * run.time).max() / (torque * run.time[-1])
    validate(
        "HUB-1", "sail with a torque on its hub", "impulse of the torque",
        "gain of angular momentum", error, 1e-9
    )  # fmt: skip
    assert np.abs(run["lagging_angle"]).max() > 1e-3
    assert np.abs(run["energy_balance_error"]).max() < 1e-8 * run["external_work"][-1]


def test_the_rate_of_angular_momentum_is_the_sum_of_torques(skew):
    """dH/dt = C_B^I T + sum r_i x F_i about the origin of I, with the thrusts F_i and their moments about
    the roots r_i; the rate by differences of the saved rows, to 1e-4 of its largest size."""
    run, step = skew, STEP
    rotation = run["rotation_IB"]
    thrust = np.einsum("tij,tkj->tki", rotation, run["thrust_B"])
    moments = np.einsum("tij,tkj->tki", rotation, run["thrust_moment_B"])
    torque = np.einsum("tij,j->ti", rotation, [0.02, -0.01, 0.03])
    roots = run["hub_position_I"][:, None] + np.einsum("tij,kj->tki", rotation, SKEW["hub.roots"])
    about_origin = torque + (np.cross(roots, thrust) + moments).sum(1)
    momentum = run["total_angular_momentum_I"]
    rate = (8.0 * (momentum[3:-1] - momentum[1:-3]) - (momentum[4:] - momentum[:-4])) / (12.0 * step)
    assert np.abs(rate - about_origin[2:-2]).max() < 1e-4 * np.abs(rate).max()


def test_an_accelerometer_at_the_centre_of_mass_shows_the_pull_of_the_tethers():
    """m f = - sum of the forces of the hub on its tethers: Newton's second law of the hub alone."""
    given = QUIET | {"voltage.value": 20e3, "remote_units.mass": [0.5, 0.6, 0.55]}
    scene = esail.load_scene("truss", given)
    run = esail.simulate(scene, save=names_with(scene, INSTRUMENTS))
    mass = 100.0 * np.pi
    pull = -run["reaction_B"].sum(1) / mass
    assert np.abs(pull).max() > 1e-6
    assert np.allclose(run["hub_acceleration_B"], pull, rtol=0, atol=1e-9 * np.abs(pull).max())


def test_an_accelerometer_off_the_centre_of_mass_shows_the_motion_of_its_place(skew):
    """The second derivative of the position of the hub's centre, by differences of the saved rows, in B: to
    1e-3 of its largest size."""
    run, step = skew, STEP
    r = run["hub_position_I"]
    second = (-(r[4:] + r[:-4]) + 16.0 * (r[3:-1] + r[1:-3]) - 30.0 * r[2:-2]) / (12.0 * step**2)
    shown = np.einsum("tji,tj->ti", run["rotation_IB"][2:-2], second)
    found = run["hub_acceleration_B"][2:-2]
    assert np.abs(found - shown).max() < 1e-3 * np.abs(shown).max()


def test_free_fall_is_not_shown():
    """In a field of gravity a free sail shows what it shows without."""
    shown = []
    for change in ({}, {"gravity.acceleration": [1e-3, 2e-3, -3e-3]}):
        scene = esail.load_scene("truss", QUIET | SKEW | change)
        shown.append(esail.simulate(scene, save=names_with(scene, INSTRUMENTS))["hub_acceleration_B"])
    assert np.abs(shown[0]).max() > 1e-5
    assert np.allclose(shown[0], shown[1], rtol=0, atol=1e-8 * np.abs(shown[0]).max())


def test_a_camera_sees_the_tips(skew):
    """Unit vectors along the lines from the hub's centre to the tips."""
    run = skew
    lines = np.einsum(
        "tji,tkj->tki", run["rotation_IB"], run["tip_position_I"] - run["hub_position_I"][:, None]
    )
    expected = lines / np.linalg.norm(lines, axis=2, keepdims=True)
    assert np.allclose(run["tip_direction_B"], expected, rtol=0, atol=1e-12)


def test_modes_need_a_steady_load():
    with pytest.raises(esail.SceneError, match=r"`hub.torque` must be left out for modes"):
        esail.modes("baseline", {"hub.torque": [1e-3, 0.0, 0.0]})


def test_the_command_saves_what_is_asked_for(tmp_path, capsys):
    """`--save` adds observables on request; a run that goes on keeps those that it has."""
    path = tmp_path / "a.h5"
    short = [f"--set={key}={value}" for key, value in QUIET.items()]
    given = ["run", "truss", *short, "-o", str(path), "--quiet", "--save", "hub_acceleration_B"]
    assert cli.main([*given, "--t-end", "4"]) == 0
    assert cli.main([*given, "--t-end", "8", "--resume"]) == 0
    run = esail.load(path)
    assert run["hub_acceleration_B"].shape == (5, 3) and "tip_direction_B" not in run
    capsys.readouterr()
    more = [*given[:-1], "tip_direction_B", "--t-end", "12", "--resume"]
    assert cli.main(more) == 2
    assert capsys.readouterr().err.startswith("`--save tip_direction_B` must be left out to go on with")
    assert cli.main([*given[:-1], "tip_directon_B", "--overwrite"][:-1]) == 2
    assert "has 'tip_directon_B' (perhaps `tip_direction_B`)" in capsys.readouterr().err
    assert (
        cli.main(["run", "hanging-chain", "-o", str(tmp_path / "b.h5"), "--save", "tip_direction_B"]) == 2
    )
    assert capsys.readouterr().err == "`--save` must be left out with a chain, but is given\n"
