"""Voltage laws and time-dependent wind: values, limits, and motions that are known in closed form.

Values and limits are those of the load of a scene, at states or on a sail that turns rigidly. Only what a
law does to the motion needs a run. Derivatives of such runs are in `simulation/test_gradient_edges.py`.
"""

import dataclasses
import re
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.array_types import PerTether, Scalar
from esail_jax.environment.gusts import gusty_wind, write_wind
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.voltage import (
    OnOff,
    VoltageLaw,
    modulation,
)
from esail_jax.loads.voltage_limits import Limits, smooth_positive_part, within_slew_rate
from esail_jax.measurements import Measurements
from esail_jax.numerics.smooth_step import smooth_step
from esail_jax.scenes.build_parts import solar_wind, starting_attitude, voltage_law, wind_of
from esail_jax.scenes.loading import builtin_text, parse
from esail_jax.scenes.structure import split
from esail_jax.scenes.toml_text import to_toml
from esail_jax.steppers.transposable import Transposable
from esail_jax.terms import Load, find_term
from support.quick import build_jitted, jit
from support.whole_runs import check_going_on

SMALL = {
    "tethers.count": 3,
    "tethers.elements": 2,
    "integrator.t_end": 300.0,
    "output.interval": 10.0,
}
FIXED = {
    "tethers.count": 3,
    "tethers.elements": 2,
    "integrator.t_end": 300.0,
    "integrator.method": "generalized-alpha",
}
"""Overrides for tests that need no error control: a method with fixed steps compiles in half the time. With
the default interval the tests share the programs of the fixture `small`."""

HARMONIC = {
    "voltage.law": "harmonic",
    "voltage.cosine": [0.3, 0.1],
    "voltage.sine": [[0.2, -0.1, 0.0], [0.05, 0.1, 0.15]],
}
WAVES = SMALL | HARMONIC


AZIMUTH = 2 * np.pi * np.arange(3) / 3
"""Azimuths of the three roots [rad]."""


def phases(axes, origin):
    """The phase phi of every tether [rad], (state, tether), from angles in the spin plane.

    phi is zero at the azimuth at which the wind's component in the spin plane points outward, and positive
    about X_B. axes: attitudes C_B^I, (state, 3, 3).
    """
    wind = np.einsum("tib,i->tb", axes, origin / np.linalg.norm(origin))
    return AZIMUTH - np.arctan2(wind[:, 2], wind[:, 1])[:, None]


def commanded(overrides, times):
    """The voltages [V] that the load of a scene commands at instants [s], (time, tether), on a sail
    that turns rigidly at its initial spin rate about its initial axis. The tethers are radial."""
    structure, numbers = split(esail.load_scene("baseline", FIXED | overrides))
    attitude, _ = starting_attitude(numbers)
    (load,) = solar_wind(structure, numbers).loads

    def at(time):
        turned = AZIMUTH + numbers["initial.spin_rate"] * time
        radial = attitude @ jnp.stack([jnp.zeros(3), jnp.cos(turned), jnp.sin(turned)])
        spin = numbers["initial.spin_rate"]
        return load.commanded(Measurements(time, attitude[:, 0], radial, radial, spin_rate=spin))

    return jax.jit(jax.vmap(at))(jnp.asarray(times))


TURN = np.arange(0.0, 1575.0, 0.5)
"""Instants [s] over one turn at 4 mrad/s."""


def test_harmonics_of_the_phase():
    """The harmonic law is V = V_0 (1 + sum a_k cos k phi + b_k sin k phi), with phi by another formula, at
    any attitude of the sail and with tethers of any shape.

    The law fades where the wind is along the spin axis: by 1e-8 / 2 over the square of the sine of their
    angle. States with a sine below 0.1 are left out, so that voltages change by 1e-6 at most.
    """
    scene = esail.load_scene("baseline", FIXED | HARMONIC)
    system, q = (x := build_jitted(*split(scene))).system, x.q
    random = np.random.default_rng(3)
    turns = np.linalg.qr(random.normal(size=(40, 3, 3)))[0]
    turns = turns * np.linalg.det(turns)[:, None, None]

    @jax.jit
    @jax.vmap
    def found(turn, noise):
        hub = q.hub @ turn.T
        tether = jnp.einsum("ij,sjnt->sint", turn, q.tether) + noise
        state = q._replace(tether=tether, hub=hub)
        time = jnp.zeros(())
        (load,) = system.loads
        rest = jax.tree.map(jnp.zeros_like, state)
        measured = system.measurements(time, state, rest)._replace(spin_rate=jnp.asarray(4e-3))
        return load.commanded(measured), system.rotation(time, state)

    volts, axes = found(turns, random.normal(size=(40, *q.tether.shape)))
    origin = np.array(scene.initial.heliocentric_position_au)
    across = np.linalg.norm(np.cross(axes[:, :, 0], origin / np.linalg.norm(origin)), axis=1)
    phi = phases(axes, origin)
    expected = 1.0 + 0.3 * np.cos(phi) + 0.1 * np.cos(2 * phi)
    for order, row in enumerate(scene.voltage.sine, 1):
        expected = expected + np.array(row) * np.sin(order * phi)
    error = np.abs(volts / (20e3 * expected) - 1.0)[across > 0.1]
    assert len(error) > 30 and error.max() < 2e-6
    assert np.ptp(volts) > 10e3


def test_limits_hold():
    """Voltages and their rates stay within the limits for any amplitudes, and come near them."""
    wild = HARMONIC | {"voltage.cosine": [3.0, -2.0], "voltage.maximum": 25e3}
    volts = commanded(wild, TURN)
    assert volts.min() >= 0.0 and volts.max() <= 25e3 and np.ptp(volts) > 24e3
    slow = commanded(wild | {"voltage.slew_rate": 20.0}, TURN)
    rate = np.abs(np.diff(slow, axis=0)).max() / 0.5
    assert 10.0 < rate <= 20.0


def test_well_within_a_limit_changes_nothing():
    """A limit is exact: what is asked for within it is not changed, and what is asked for beyond it is cut
    off. A blended one, which a scene may ask for, is the identity well within the limits, never exceeded,
    and monotonic, to rounding."""
    exact = Limits(jnp.asarray(100.0))(jnp.asarray([-1.0, 0.0, 1e-9, 99.9, 100.0, 101.0]))
    assert exact.tolist() == [0.0, 0.0, 1e-9, 99.9, 100.0, 100.0]
    x = jnp.linspace(-10.0, 110.0, 1001)
    cut = Limits(jnp.asarray(100.0), jnp.asarray(0.02))(x)
    assert float(cut.min()) >= 0.0 and float(cut.max()) <= 100.0
    inside = (x > 2.1) & (x < 97.9)
    assert np.allclose(cut[inside], x[inside], rtol=1e-12)
    assert bool((jnp.diff(cut) >= -1e-12).all())


def test_smooth_corners():
    """The blend at a limit and the switch have continuous slopes."""
    for function, corners in (
        (lambda x: smooth_positive_part(x, 1.0), (-1.0, 1.0)),
        (smooth_step, (0.0, 1.0)),
    ):
        for corner in corners:
            before, after = (jax.grad(function)(corner + e) for e in (-1e-7, 1e-7))
            assert abs(before - after) < 1e-6


def test_a_pulse_rises_and_falls():
    """A pulse rises at `on` and falls at `off`, along 10 s^3 - 15 s^4 + 6 s^5 over the rise time, to
    rounding.

    It takes longer if its largest slope, 15/8 V_0 per rise time, would exceed the slew rate.
    """
    volts, on, off, rise_time = (jnp.asarray(x) for x in ([20e3], [100.0], [200.0], 5.0))
    time, nowhere, no_axis = jnp.linspace(90.0, 250.0, 321), jnp.zeros((3, 1)), jnp.zeros(3)
    measured = jax.vmap(lambda t: Measurements(t, no_axis, nowhere, nowhere, no_axis))(time)
    for slew_rate, rise in ((None, 5.0), (jnp.asarray(1e3), 37.5)):
        law = OnOff(volts, on, off, rise_time, Limits(None), slew_rate)
        found = jax.vmap(law.commanded)(measured)[:, 0]
        up, down = (np.clip((time - x) / rise, 0.0, 1.0) for x in (100.0, 200.0))
        expected = [10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5 for s in (up, 1.0 - down)]
        assert np.allclose(found, 20e3 * np.minimum(*expected), rtol=0, atol=1e-8)


TABLE = [[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.5, 0.5, 1.0]]
IN_TIME = {"voltage.law": "piecewise-linear", "voltage.time": [20.0, 100.0, 250.0], "voltage.table": TABLE}


def expected_of_table(time):
    """The voltages [V] of IN_TIME, (time, tether)."""
    columns = [20e3 * np.interp(time, IN_TIME["voltage.time"], column) for column in np.transpose(TABLE)]
    return np.stack(columns, axis=1)


def test_table_in_time():
    """The voltage of a table is linear between its instants; every tether has a column. It is linear in the
    table, so that its derivative along the table is the voltage itself."""
    time = np.linspace(0.0, 300.0, 301)

    def scaled(factor):
        return commanded(IN_TIME | {"voltage.table": factor * jnp.array(TABLE)}, time)

    volts, slope = jax.jvp(scaled, (1.0,), (1.0,))
    for found in (commanded(IN_TIME, time), volts, slope):
        assert np.allclose(found, expected_of_table(time), rtol=1e-12, atol=1e-9)


def test_table_keeps_its_slew_rate():
    """A table is changed so that its slopes keep the slew rate; the expected values are computed by hand.

    One column asks for 20 kV within 10 s and for 0 V 40 s later, at 500 V/s: it reaches 5 kV, and then the
    table again. A column that is slow enough is not changed.
    """
    time = jnp.array([0.0, 10.0, 50.0, 60.0])
    wanted = jnp.array([[0.0, 10.0], [20e3, 5e3], [0.0, 5e3], [1e3, 5e3]])
    found = within_slew_rate(time, wanted, jnp.asarray(500.0))
    assert np.allclose(found[:, 0], [0.0, 5e3, 0.0, 1e3], rtol=0, atol=1e-9)
    assert np.allclose(found[:, 1], wanted[:, 1], rtol=0, atol=1e-9)
    table = {"voltage.law": "piecewise-linear", "voltage.time": [0.0, 10.0, 250.0]}
    time = np.linspace(0.0, 300.0, 301)
    volts = commanded(table | {"voltage.table": [0.0, 1.0, 0.2], "voltage.slew_rate": 100.0}, time)
    expected = np.interp(time, [0.0, 10.0, 250.0], [0.0, 1e3, 4e3])
    assert np.allclose(volts, expected[:, None], rtol=1e-9)


def test_planar_cone_keeps_its_slew_rate():
    """The planar-cone law reaches the allowed rate and does not exceed it.

    Its rate is dV/dphi omega_0 / (1 - x cos phi). The lower bound allows for Newton's method and the grid
    of phases.
    """
    bar, (per_volt, spin, allowed) = jnp.array([3e-4]), jnp.array([1e-8, 4e-3, 5.0])
    x = modulation(jnp.array([0.2]), bar, per_volt, spin, allowed)
    phi = jnp.linspace(0.0, 2.0 * np.pi, 2001)

    def volts(phi):
        return bar[0] / per_volt / (1.0 - x[0] * jnp.cos(phi)) ** 3

    rate = jnp.abs(jax.vmap(jax.grad(volts))(phi)) * spin / (1.0 - x[0] * jnp.cos(phi))
    assert allowed * (1.0 - 1e-5) < rate.max() <= allowed * (1.0 + 1e-12)
    free = modulation(jnp.array([0.2]), bar, per_volt, spin, jnp.asarray(1e6))
    assert np.allclose(free, 0.2, rtol=1e-15)


@pytest.mark.nightly
def test_switching_on_and_off():
    """Before the pulse a sail moves as without voltage; a pulse shorter than a step has its full effect.

    A pulse of 1 s moves the tips by about a hundredth of what a pulse of 100 s does, and its energy
    balance closes.
    """
    often = SMALL | {"output.interval": 5.0}
    switched = often | {"voltage.law": "on-off", "voltage.on": 100.0, "voltage.rise_time": 5.0}
    run = esail.simulate("baseline", switched | {"voltage.off": 200.0})
    # The run without voltage has the program of the others.
    never = {"voltage.value": 0.0, "voltage.on": 1e4, "voltage.off": 2e4}
    off, volts = esail.simulate("baseline", switched | never), run["voltage"][:, 0]
    assert (off["voltage"] == 0.0).all()
    early = run.time <= 100.0
    # The two runs have different steps; local errors are 2e-6 m.
    assert np.allclose(run["tip_position_I"][early], off["tip_position_I"][early], rtol=0, atol=1e-4)
    assert (volts[early] == 0.0).all() and (volts[(run.time >= 105.0) & (run.time <= 200.0)] == 20e3).all()
    assert (volts[run.time >= 205.0] == 0.0).all()
    pulse = esail.simulate(
        "baseline", often | {"voltage.law": "on-off", "voltage.on": 101.0, "voltage.off": 102.0,
                             "voltage.rise_time": 0.5}
    )  # fmt: skip
    moved = np.abs(pulse["tip_position_I"][-1] - off["tip_position_I"][-1]).max()
    assert (
        0.5 * moved < np.abs(run["tip_position_I"][-1] - off["tip_position_I"][-1]).max() / 100 < 2 * moved
    )
    assert not pulse.stats["message"]


@pytest.mark.nightly
@pytest.mark.parametrize("axis", ["hub", "angular-momentum"])
def test_feedback_turns_the_axis_to_its_target(axis):
    """Feedback turns the spin axis towards its target, whichever axis it measures; with the opposite gain
    the axis turns away."""
    turn = FIXED | {"integrator.t_end": 1570.0, "voltage.law": "feedback", "voltage.measured_axis": axis}
    turn |= {"voltage.target_sailing_angle_deg": 20.0}
    ends = [
        esail.simulate("baseline", turn | {"voltage.gain": gain})["sailing_angle"][-1]
        for gain in (2, 0, -2)
    ]
    assert abs(ends[0]) > abs(ends[1]) > abs(ends[2])


def test_feedback_measures_the_angular_momentum():
    """The angular momentum of a sail of straight tethers that turns like a rigid body, from the moments of
    inertia of rods, point masses and a cylinder. The sail is far from the origin and moves, which adds
    nothing."""
    scene = esail.load_scene("baseline", SMALL | {"initial.coning_angle_deg": 5.0})
    model = build_jitted(*split(scene))
    system, q = model.system, model.q
    axes, far = np.asarray(system.rotation(jnp.zeros(()), q)), jnp.array([3e6, -2e6, 1e6])
    spin = axes @ np.array([4e-3, 1e-3, -2e-3])

    def turned(points):  # velocities of vectors, slopes among them
        return np.cross(spin, np.asarray(points), axis=0)

    hub = np.asarray(q.hub)
    centre = 0.5 * (hub[0] + hub[1])
    here = q.axpy(-1.0, system.uniform(jnp.asarray(centre)))
    rate = np.asarray(here.tether).transpose(1, 0, 2, 3)
    v = here._replace(
        tether=jnp.asarray(turned(rate).transpose(1, 0, 2, 3)),
        hub=jnp.asarray(turned(np.asarray(here.hub).T).T),
    )
    q, v = q.axpy(1.0, system.uniform(far)), v.axpy(1.0, system.uniform(jnp.array([30.0, 1.0, 2.0])))
    found = np.asarray(system.measurements(jnp.zeros(()), q, v).momentum_axis)

    nodes = np.asarray(here.tether)[0]  # (xyz, node, tether), relative to the hub's centre
    line = scene.tethers.density * scene.tethers.area * np.array(scene.tethers.length)
    tips, roots, tip_mass = nodes[:, -1], nodes[:, 0], np.array(scene.remote_units.mass)
    hub_mass = scene.hub.density * np.pi * scene.hub.radius**2 * scene.hub.height
    masses = np.concatenate([np.broadcast_to(line, 3), np.broadcast_to(tip_mass, 3), [hub_mass]])
    places = np.concatenate([0.5 * (roots + tips), tips, np.zeros((3, 1))], axis=1)
    away = places - (places * masses).sum(1, keepdims=True) / masses.sum()
    expected = (masses * np.cross(away, turned(away), axis=0)).sum(1)
    half = 0.5 * (tips - roots)
    expected += (np.broadcast_to(line, 3) / 3.0 * np.cross(half, turned(half), axis=0)).sum(1)
    radius, height = scene.hub.radius, scene.hub.height
    across = hub_mass * (radius**2 / 4.0 + height**2 / 12.0)
    expected += axes @ (np.array([hub_mass * radius**2 / 2.0, across, across]) * (axes.T @ spin))
    # Rounding of positions 4e6 m from the origin, 1e-9 m, over the 1e4 m of a tether.
    np.testing.assert_allclose(found, expected / np.linalg.norm(expected), atol=1e-9)


def test_feedback_keeps_its_slew_rate():
    """A feedback gain that would exceed the slew rate is reduced; another gain is not changed.

    Without a limit 20 kV change by V_0 g omega sin(5 deg) = 5.7 V/s, with a limit by 2 V/s, to 1e-5 (mean
    rates over 0.5 s of a wave of 1571 s).
    """
    law = {"voltage.law": "feedback", "voltage.gain": 0.82, "initial.sailing_angle_deg": 0.0}
    law |= {"voltage.target_sailing_angle_deg": 5.0}

    def fastest(**limit):
        given = {f"voltage.{key}": value for key, value in limit.items()}
        return np.abs(np.diff(commanded(law | given, TURN), axis=0)).max() / 0.5

    free = fastest()
    assert free == pytest.approx(20e3 * 0.82 * 4e-3 * np.sin(np.deg2rad(5.0)), rel=1e-5)
    assert fastest(slew_rate=2.0) == pytest.approx(2.0, rel=1e-5)
    assert fastest(slew_rate=10.0) == pytest.approx(free, rel=1e-9)


@pytest.mark.nightly
@pytest.mark.parametrize(("sailing", "coning"), [(20.0, 5.0), (35.0, 2.0)])
def test_planar_cone_keeps_its_coning_angle(sailing, coning):
    """The planar-cone law keeps a nearly rigid tether on its cone to 1e-3 deg over five turns.

    The anchor is fixed. With the mean voltage the tether leaves the cone by degrees, because the wind's
    component in the plane is resonant.
    """
    spin = 4e-3
    rigid = {
        "hub.height": None, "hub.radius": None, "hub.density": None, "voltage.value": None,
        "tethers.count": 1, "tethers.elements": 2, "tethers.youngs_modulus": 70e12,
        "tethers.second_moment": 1e12 / 70e12, "initial.sailing_angle_deg": sailing,
        "initial.coning_angle_deg": coning, "initial.spin_rate": spin,
        "integrator.t_end": 5 * 2 * np.pi / spin, "output.interval": 5.0,
    }  # fmt: skip
    law = {"voltage.law": "planar-cone", "voltage.coning_angle_deg": coning, "voltage.spin_rate": spin}
    # Tether 1 starts across the wind, where phi' = omega_0.
    run = esail.simulate("baseline", rigid | law)
    assert np.abs(np.rad2deg(run["coning_angle"]) - coning).max() < 1e-3
    mean = rigid | {"voltage.value": float(run["voltage"].mean())}
    away = esail.simulate("baseline", mean)["coning_angle"]
    assert np.abs(np.rad2deg(away) - coning).max() > 1.0


@pytest.mark.nightly
def test_a_constant_voltage_is_reported_as_given():
    """A constant voltage is a row as well, tether by tether; a sail without wind has no voltage."""
    given = {"voltage.value": [20e3, 0.0, 15e3]}
    run = esail.simulate("baseline", FIXED | given | {"integrator.t_end": 20.0})
    assert np.array_equal(run["voltage"], np.tile(given["voltage.value"], (len(run.time), 1)))
    calm = {f"solar_wind.{key}": None for key in ("speed", "number_density", "cutoff_voltage")}
    calm |= {"voltage.value": None, "integrator.t_end": 20.0}
    names = jax.eval_shape(lambda: dict(esail.simulate("baseline", FIXED | calm)))
    assert "tip_position_I" in names and "voltage" not in names


def test_limits_of_a_constant_voltage():
    """The law "constant" takes the limits as other laws do: a value above the maximum is cut off there. Its
    slew rate is zero. Without a maximum the value is taken as given."""
    volts = [25e3, 10e3, -5e3]
    for more, wanted in (({}, volts), ({"voltage.maximum": 20e3}, [20e3, 10e3, 0.0])):
        limits = {"voltage.value": volts, "voltage.slew_rate": 10.0} | more
        scene = esail.load_scene("baseline", {"tethers.count": 3} | limits)
        structure, numbers = split(scene)
        law = voltage_law(structure, numbers, wind_of(numbers, jnp.ones(3)))
        assert law.constant and law.value.tolist() == wanted


class Drag(Load):
    """A second load: f = -c r' [N/m]."""

    coefficient: Scalar

    name: ClassVar[str] = "drag"
    depends_on: ClassVar[tuple[str, ...]] = ("r",)

    def force(self, time, fields, rates):
        return -self.coefficient * rates.r


class Cosine(VoltageLaw):
    """A law from outside the package: V = V_0 (1 + cos(phi) / 2), phi from the chords."""

    value: PerTether
    limits: Limits = Limits(None)

    name: ClassVar[str] = "cosine"

    def commanded(self, measurements):
        return self.value * (1.0 + 0.5 * measurements.tether_phase[0])


@pytest.mark.nightly
def test_order_of_loads_does_not_matter():
    """A second load may stand before or after the thrust, and a law may come from outside the package.
    Forces and their derivatives are the same, and so is the transpose that steps use; to rounding, as sums
    are taken in another order."""
    model = build_jitted(*split(esail.load_scene("baseline", SMALL)))
    (thrust,), drag = model.system.loads, Drag(jnp.asarray(1e-6))
    thrust = CoulombThrust.of(thrust.wind, Cosine(jnp.full(3, 20e3)), 2)
    random, time = np.random.default_rng(4), jnp.zeros(())
    q, v, w = (jax.tree.map(lambda x: x + random.normal(size=x.shape), model.q) for _ in range(3))

    def work(system, q):
        residual, _ = system.residual(time, q, v, v, system.no_multipliers())
        return sum(jax.tree.leaves(jax.tree.map(lambda f, w: (f * w).sum(), residual.forces, w)))

    @jit
    def found(system):
        voltage = find_term(system.loads, CoulombThrust).commanded(system.measurements(time, q, q))
        slopes = [jax.grad(work, 1)(x, q) for x in (system, Transposable.of(system))]
        return work(system, q), slopes, voltage

    alone, before, after = (
        found(dataclasses.replace(model.system, loads=loads))
        for loads in ((thrust,), (drag, thrust), (thrust, drag))
    )
    assert np.ptp(alone[2]) > 1e3 and abs(before[0] / alone[0] - 1.0) > 1e-9
    assert abs(before[0] / after[0] - 1.0) < 1e-12
    for value, (slope, turned), voltage in (alone, before, after):
        assert np.array_equal(voltage, alone[2])
        same = slope if value is alone[0] else before[1][0]
        for x, *others in zip(*map(jax.tree.leaves, (slope, turned, same)), strict=True):
            assert all(np.allclose(x, y, rtol=0, atol=1e-11 * np.abs(x).max()) for y in others)


WIND_TIMES = [0.0, 100.0, 300.0]
LEVEL = {"solar_wind.speed": [4e5] * 3, "solar_wind.number_density": [7.3e6] * 3}
VARIED = {"solar_wind.speed": [4e5, 4e5, 6e5], "solar_wind.number_density": [7.3e6, 14.6e6, 14.6e6]}


def factor_of_thrust(time):
    """The thrust in the wind VARIED, divided by that in the wind LEVEL."""
    speed, density = (np.interp(time, WIND_TIMES, row) for row in VARIED.values())
    return speed / 4e5 * np.sqrt(density / 7.3e6)


@pytest.mark.nightly
def test_a_constant_series_is_the_steady_wind():
    """The force of a constant series is that of the steady wind at any state and instant. In another series
    it is proportional to the speed and to the root of the density. Both hold to rounding."""

    def force_of(overrides, times):
        model = build_jitted(*split(esail.load_scene("baseline", FIXED | overrides)))
        (load,), tethers = model.system.loads, model.system.tethers
        random = np.random.default_rng(5)
        q, v = (model.q.tether + random.normal(size=model.q.tether.shape) for _ in range(2))
        fields, rates = tethers.interpolate_motion(q, v)
        return np.stack([np.asarray(load.force(jnp.asarray(t), fields, rates)) for t in times])

    times = np.array([0.0, 60.0, 130.0, 299.0, 400.0])
    steady, level, varied = (
        force_of(wind, times)
        for wind in ({}, {"solar_wind.time": WIND_TIMES} | LEVEL, {"solar_wind.time": WIND_TIMES} | VARIED)
    )
    assert np.abs(steady).max() > 1e-8
    assert np.allclose(level, steady, rtol=1e-12, atol=0)
    expected = factor_of_thrust(times).reshape(-1, *(1,) * (steady.ndim - 1)) * steady
    assert np.allclose(varied, expected, rtol=1e-12, atol=0)


@pytest.mark.nightly
def test_wind_in_time():
    """In a run, thrust is proportional to the speed and to the root of the density of the wind, and the
    voltages are those of the table."""
    scene = FIXED | IN_TIME | {"solar_wind.time": WIND_TIMES}
    level, varied = (esail.simulate("baseline", scene | wind) for wind in (LEVEL, VARIED))
    thrust = np.linalg.norm(varied["thrust_O"], axis=1) / np.linalg.norm(level["thrust_O"], axis=1)
    assert np.allclose(thrust, factor_of_thrust(varied.time), rtol=2e-3)  # the tethers lag a little more
    for run in (level, varied):
        assert np.allclose(run["voltage"], expected_of_table(run.time), rtol=1e-12, atol=1e-9)


def test_wind_from_a_file(tmp_path):
    """A wind file in the scene's folder is read, and its numbers are written with all digits.

    Gusts have the requested mean and spread, to the error of 2000 correlated samples.
    """
    wind = gusty_wind(seed=1, duration=300.0)
    write_wind(tmp_path / "wind.csv", wind)
    text = builtin_text("baseline").replace("speed = 4e5", 'file = "wind.csv"')
    (tmp_path / "gusty.toml").write_text(re.sub(r"(?m)^number_density.*\n", "", text))
    short = {"integrator.t_end": 300.0}
    scene = esail.load_scene(tmp_path / "gusty.toml", short)
    for name, column in wind.items():
        assert np.array_equal(getattr(scene.solar_wind, name), column)
    assert parse(to_toml(scene), "again") == scene
    other = esail.load_scene("baseline", short | {"solar_wind.file": str(tmp_path / "wind.csv")})
    assert other.solar_wind == scene.solar_wind
    with pytest.raises(
        esail.SceneError, match=r"`solar_wind.file` must be a CSV .*'no.csv' cannot be read"
    ):
        esail.load_scene("baseline", {"solar_wind.file": "no.csv"})
    long = gusty_wind(seed=2, duration=1.2e5)
    logs = np.log(long["number_density"] / 7.3e6)
    assert abs(logs.std() / 0.3 - 1.0) < 0.2 and abs(logs.mean()) < 0.1


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"voltage.law": "harmonic"},
         r"`voltage.cosine` must be given with the law harmonic, but is missing"),
        ({"voltage.law": "on-off", "voltage.on": 1.0},
         r"`voltage.rise_time` must be given with the law on-off, but is missing"),
        ({"voltage.gain": 1.0}, r"`voltage.gain` must be left out with the law constant, but is given"),
        ({"voltage.law": "sawtooth"}, r"`voltage.law` must be \"constant\", .*, but is 'sawtooth'"),
        ({**WAVES, "voltage.sine": [0.1]},
         r"`voltage.sine` must have as many harmonics as `voltage.cosine` \(2\), but has 1"),
        ({**WAVES, "voltage.sine": [[0.1, 0.2]]},
         r"`voltage.sine` must have lists of 3 \(`tethers.count`\), but has lists of 2"),
        ({"voltage.law": "piecewise-linear", "voltage.time": [1.0, 1.0], "voltage.table": [1.0, 1.0]},
         r"`voltage.time` must increase, but is \[1.0, 1.0\]"),
        ({"voltage.law": "piecewise-linear", "voltage.time": [0.0, 1.0], "voltage.table": [1.0]},
         r"`voltage.table` must have as many rows as `voltage.time` has instants \(2\), but has 1"),
        ({"solar_wind.speed": [1.0, 2.0]},
         r"`solar_wind.time` must be given with a list of `solar_wind.speed`, but is missing"),
        ({"solar_wind.time": [0.0, 10.0]},
         r"`solar_wind.time` must reach from 0 to `integrator.t_end` \(.*\), but reaches from 0 to 10"),
    ],
)  # fmt: skip
def test_bad_input(overrides, message, nothing_compiles):
    """One line names the key before anything is compiled."""
    with pytest.raises(esail.SceneError, match=message):
        esail.load_scene("baseline", overrides)


@pytest.mark.nightly
def test_a_switch_after_the_end_is_known_to_a_run_that_goes_on(tmp_path):
    """A run that ends within a pulse of 4 s and is continued is bit-identical to one run.

    For any t_end, the first step after a switch is no longer than the pulse.
    """
    pulse = {"voltage.law": "on-off", "voltage.on": 100.0, "voltage.off": 104.0, "voltage.rise_time": 1.0}
    check_going_on(SMALL | pulse | {"output.interval": 1.0}, 102, 160, tmp_path)
