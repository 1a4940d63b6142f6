"""Rectification of the orbit of a sail: when the origin of the coordinates moves to the hub, the motion,
the output in the frame I, and derivatives stay what they are."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.constants import ASTRONOMICAL_UNIT as AU
from esail_jax.environment.kepler_orbit import KeplerOrbit
from esail_jax.scenes import parts
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.structure import split
from esail_jax.scenes.toml_text import to_toml
from esail_jax.simulation.rectification import FAR, PointOnOrbit
from esail_jax.steppers.stepper import Point
from esail_jax.system import Power
from support.near_sun import SCENE
from support.quick import build_jitted, jit
from support.whole_runs import check_resumed_bits

TIGHT = SCENE.replace({"integrator.tolerance": 1e-13})

ENERGIES = ("kinetic_energy", "external_work", "external_power", "energy_balance_error")

PERIOD, DRIFT = 20.0, np.array([5e3, -4e3, 1e3])
"""Time between rectifications [s], and a velocity of the hub relative to an origin [m/s] with which it is
farther away than FAR after PERIOD."""

LIGHT = {"hub.density": 1.0, "integrator.t_end": 2.5 * 86400.0, "output.interval": 43200.0}
"""A light sail, which the thrust moves by more than FAR in two days."""


def moved(displacement, drift):
    """The start of the scene in coordinates whose origin is behind that of the scene by a displacement [m]
    and a velocity [m/s]: the model, the point, and the orbit of the origin."""
    system, q, v, _ = build_jitted(*split(TIGHT))
    orbit, zero = system.kepler_orbit, jnp.zeros(())
    orbit = KeplerOrbit(orbit.position - displacement, orbit.velocity - drift, zero)
    q, faster = (x.axpy(1.0, system.uniform(jnp.asarray(y))) for x, y in ((q, displacement), (v, drift)))
    point = Point(zero, q, faster, Power(zero, zero), jnp.asarray(True))
    return system, point, orbit


def kinetic(system, v):
    """Kinetic energy [J]: half of momenta times velocities."""
    pairs = zip(*map(jax.tree.leaves, (system.momenta(v), v)), strict=True)
    return 0.5 * sum((p * x).sum() for p, x in pairs)


def check_same(found, expected, names, bound):
    """Signals are the same, to a bound relative to the range of each."""
    for name in names:
        values = np.asarray(expected[name])
        error = np.abs(np.asarray(found[name]) - values).max()
        assert error <= bound * np.ptp(values), (name, error, np.ptp(values))


@pytest.fixture(scope="module")
def drifting():
    """The start of the scene with an origin from which the hub drifts away."""
    _, point, orbit = moved(np.zeros(3), DRIFT)
    return PointOnOrbit.of(point, orbit)


def rectify_every(monkeypatch, interval):
    """Replaces the interval [s] after which the orbit of a sail may be rectified."""
    changed = [replace(part, every=interval) if part.every else part for part in parts.PARTS]
    monkeypatch.setattr(parts, "PARTS", changed)


@pytest.fixture
def often(monkeypatch):
    """Runs may be rectified every PERIOD, not every day."""
    rectify_every(monkeypatch, PERIOD)


SIGNALS = ("coning_angle", "tether_length", "rotation_IB", "reaction_O", "thrust_O", "voltage",
           "heliocentric_position", "heliocentric_velocity", "orbital_elements")  # fmt: skip


@pytest.mark.nightly
def test_output_is_that_of_the_frame_of_the_scene():
    """A run whose coordinates have another origin than the frame I has the output of one whose coordinates
    are those of I: the same motion is integrated about two origins, 4e4 m and 50 m/s apart. Positions,
    kinetic energy, work and power are those in I.

    Coordinates of 4e4 m are rounded to 7e-12 m, 3e-9 of the range of the length: 1e-6 of a range. Energies
    contain the velocity of the shift times the momentum, with the rounding of a heliocentric velocity of
    4e5 m/s, 6e-11 m/s: 1e-9 of their range."""
    system, point, orbit = moved(np.array([3e4, -2e4, 1e4]), np.array([40.0, -30.0, 10.0]))
    scene = TIGHT.replace({
        "orbit.position_au": (np.asarray(orbit.position) / AU).tolist(),
        "orbit.velocity": np.asarray(orbit.velocity).tolist(),
    })  # fmt: skip
    in_frame = esail.simulate(scene, start=point)
    _, near, own = moved(np.zeros(3), np.zeros(3))
    lost = kinetic(system, near.v) - kinetic(system, point.v)
    near = near._replace(work=point.work._replace(external=lost))
    found = esail.simulate(scene, start=PointOnOrbit.of(near, own))
    check_same(found, in_frame, SIGNALS, 1e-6)
    check_same(found, in_frame, ("hub_position_I", "tip_position_I", *ENERGIES[:3]), 1e-9)
    assert np.ptp(in_frame["kinetic_energy"]) > 1e4  # J: the shift changes with the tide


@pytest.mark.nightly
def test_origin_moves_to_a_distant_hub(often, drifting):
    """A run whose hub drifts away from the origin is rectified, and is the run of a hub that stays near its
    origin. The origin moves once, at the first instant at which the hub is farther away than FAR, and stays
    with the hub. 1e-6 of a range is the rounding of coordinates of 1e5 m."""
    assert 0.9 * FAR < np.linalg.norm(DRIFT) * PERIOD < 2.0 * FAR
    expected, found = esail.simulate(TIGHT), esail.simulate(TIGHT, start=drifting)
    assert float(found.final_state.orbit.epoch) == PERIOD
    assert float(expected.final_state.orbit.epoch) == 0.0
    check_same(found, expected, SIGNALS, 1e-6)
    error = np.abs(found["hub_position_I"] - expected["hub_position_I"]).max()
    assert error < 1e-5  # m: a heliocentric position of 1.5e9 m is rounded to 2e-7 m


@pytest.mark.nightly
def test_energy_balance_does_not_change(often, drifting):
    """The energy balance of a run that is rectified has the error of its tolerance, although its kinetic
    energy falls from 1e11 J to that of the rotation: 1e-14 of it."""
    run = esail.simulate(TIGHT, start=drifting)
    system, point, _ = moved(np.zeros(3), DRIFT)
    errors = np.abs(run["energy_balance_error"] - run["energy_balance_error"][0])
    assert errors.max() < 1e-14 * float(kinetic(system, point.v))


@pytest.mark.nightly
def test_a_traced_run_is_rectified(often, drifting):
    """A run under `jit` is that of the host, rectified at the same instant, and so is its final state."""
    names = ("tether_length", "hub_position_I", "thrust_O")

    def signals(start):
        run = esail.simulate(TIGHT, start=start, save=names)
        return {name: run[name] for name in names}, run.final_state

    (found, final), expected = jit(signals)(drifting), esail.simulate(TIGHT, start=drifting, save=names)
    assert float(final.orbit.epoch) == PERIOD
    assert np.abs(final.orbit.position - expected.final_state.orbit.position).max() < 1e-5
    for name in names:
        assert np.allclose(found[name], expected[name], rtol=1e-12, atol=1e-6), name


@pytest.mark.nightly
def test_a_derivative_goes_through_a_rectification(often, drifting):
    """The derivative in reverse mode, by the voltage and the velocity of the start together, of the arms of
    the tips and of the hub's path after a rectification is the difference quotient of runs on the host.
    The path is rounded to 2e-7 m of 400 m, for which it changes: 1e-6 of the derivative is left."""
    faster = build_jitted(*split(TIGHT))[0].uniform(jnp.array([1.0, -2.0, 0.5]))

    def end(x):
        settings = {"voltage.value": 20e3 * (1.0 + x), "output.interval": 40.0}
        start = drifting._replace(v=drifting.v.axpy(100.0 * x, faster))
        run = esail.simulate(TIGHT, settings, start=start, save=("tip_position_I", "hub_position_I"))
        hub = run["hub_position_I"][-1]
        arms = run["tip_position_I"][-1] - hub
        return jnp.array([1.0, 2.0, 3.0]) @ (hub / 1e4 + arms @ jnp.array([3.0, 1.0, 2.0]))

    h = 0.05
    quotient = (8.0 * (end(h) - end(-h)) - (end(2 * h) - end(-2 * h))) / (12.0 * h)
    assert abs(jit(jax.grad(end))(0.0) / quotient - 1.0) < 1e-6


@pytest.mark.nightly
def test_days_are_those_of_a_run_without_rectification(monkeypatch):
    """Two and a half days of a light sail, rectified on the second day, are those of the same run about one
    origin, which is 2e5 m away at the end: to 1e-6 of a range; of coning, which is small, to 1e-3. Rounding
    changes the sizes of the steps, and these are the differences of two runs at the default tolerance."""
    found = esail.simulate(SCENE, LIGHT)
    assert float(found.final_state.orbit.epoch) == 2 * 86400.0
    rectify_every(monkeypatch, 1e9)
    expected = esail.simulate(SCENE, LIGHT)
    assert float(expected.final_state.orbit.epoch) == 0.0
    assert np.linalg.norm(expected["hub_position_I"][-1]) > 1.5 * FAR
    check_same(found, expected, (*SIGNALS, "hub_position_I", "tip_position_I", *ENERGIES[:2])[1:], 1e-6)
    check_same(found, expected, SIGNALS[:1], 1e-3)


@pytest.mark.nightly
def test_resumed_run_is_bit_identical(tmp_path):
    """A run that is continued from its file after a rectification, at the instant of one, and before one,
    is that of one run, bit for bit: the file holds the orbit of the moment. Its final state is read with
    its orbit."""
    file = tmp_path / "scene.toml"
    file.write_text(to_toml(SCENE.replace(LIGHT)))
    run = check_resumed_bits(file, (129600, 172800, 216000), tmp_path)
    assert float(run.final_state.orbit.epoch) == 2 * 86400.0
    goes_on = esail.simulate(SCENE, LIGHT | {"integrator.t_end": 259200.0}, start=run.final_state)
    assert np.allclose(goes_on["tip_position_I"][0], run["tip_position_I"][-1], rtol=0, atol=1e-6)


def test_a_point_on_an_orbit_needs_one(drifting):
    """A start that is relative to an orbit is refused by a scene without one, in one line."""
    with pytest.raises(SceneError, match=r"`start` must have no orbit .* but has one"):
        esail.simulate("baseline", start=drifting)
