"""Electron current, electric power and its limit (`tethers.wire_radius`, `voltage.power_limit`)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.design import objectives
from esail_jax.environment.solar_wind import SteadyWind, WindSeries
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.electron_current import Collector, PowerLimited, power_limited
from esail_jax.loads.voltage import Constant, Harmonic
from esail_jax.loads.voltage_limits import Limits
from esail_jax.measurements import Measurements
from esail_jax.scenes.build import build
from esail_jax.scenes.structure import split
from esail_jax.terms import find_term

WIRES = {"tethers.wire_radius": 12.5e-6, "tethers.wires": 4}
SMALL = {
    "tethers.count": 3,
    "tethers.elements": 2,
    "integrator.t_end": 300.0,
    "integrator.method": "generalized-alpha",
}
VOLTS = [20e3, 0.0, 15e3]


def power_of(volts, density):
    """The power [W] of tethers of 10 km and four wires of 12.5 um, as the formula is written, with the
    constants of scipy."""
    from scipy.constants import e, m_e

    volts = np.maximum(volts, 0.0)
    current = 4 * 10e3 * 2.0 * 12.5e-6 * e * density * np.sqrt(2.0 * e * volts / m_e)
    return (volts * current).sum(-1)


@pytest.mark.nightly
def test_current_and_power_of_a_run(validate):
    """The rows of a run are 2 r_w e n sqrt(2 e V / m_e) per length of each wire, and the sum of V I; a run
    without a radius has neither. Values of the constants differ by 1e-8 between tables."""
    run = esail.simulate("baseline", SMALL | WIRES | {"voltage.value": VOLTS, "integrator.t_end": 20.0})
    exact = power_of(np.array(VOLTS), 7.3e6)
    assert np.allclose((run["electron_current"] * VOLTS).sum(1), exact, rtol=1e-6, atol=0)
    error = np.abs(run["electric_power"] / exact - 1.0).max()
    validate(
        "POW-1", "wires in the solar wind", "orbital-motion-limited current of a cylinder",
        "electric power", error, 1e-6,
    )  # fmt: skip
    assert (run["electron_current"][:, 1] == 0.0).all()
    assert float(objectives.values(run, ("power",))["power"]) == pytest.approx(exact, rel=1e-6)


WIND = SteadyWind(jnp.asarray(4e5), jnp.asarray(7.3e6), jnp.asarray(1e3), jnp.array([1e11, 0.0, 0.0]))
COLLECTOR = Collector(jnp.full(3, 2.0 * 12.5e-6 * 4 * 10e3), WIND)


def measured(time):
    turned = jnp.array([0.1, 2.1, 4.2]) + 4e-3 * time
    out = jnp.stack([0.0 * turned, jnp.cos(turned), jnp.sin(turned)])
    axis, wind = jnp.array([1.0, 0.0, 0.0]), jnp.array([0.8, 0.6, 0.0])
    return Measurements(jnp.asarray(time), axis, out, out, wind, spin_rate=jnp.asarray(4e-3))


def test_limit_holds_for_a_law():
    """Voltages of a harmonic law are scaled down together where they need more than the limit, to exactly
    the limit, and left alone elsewhere."""
    wave = jnp.full((1, 3), 0.5).at[0, 1].set(0.1)
    law = Harmonic(jnp.full(3, 20e3), wave, 0.0 * wave, Limits(None), None)
    free = np.stack([law.voltage(measured(t)) for t in np.arange(0.0, 1600.0, 100.0)])
    needed = power_of(free, 7.3e6)
    bound = float(np.median(needed))
    limited = PowerLimited(law, COLLECTOR, jnp.asarray(bound))
    found = np.stack([limited.voltage(measured(t)) for t in np.arange(0.0, 1600.0, 100.0)])
    over = needed > bound * (1.0 + 1e-6)
    assert over.any() and not over.all()
    assert np.allclose(power_of(found[over], 7.3e6), bound, rtol=1e-6, atol=0)
    assert np.allclose(found / free, (found / free)[:, :1], rtol=1e-12, atol=0)
    assert np.array_equal(found[needed < bound * (1.0 - 1e-6)], free[needed < bound * (1.0 - 1e-6)])


def test_limit_of_a_constant_voltage():
    """A constant voltage in a steady wind stays constant; in a wind that varies it follows the density."""
    limit, volts = jnp.asarray(2.0), jnp.array(VOLTS)
    steady = power_limited(Constant(volts), COLLECTOR, limit)
    assert isinstance(steady, Constant)
    assert power_of(np.asarray(steady.value), 7.3e6) == pytest.approx(2.0, rel=1e-6)
    density = jnp.array([0.5e6, 20e6])
    series = WindSeries(
        jnp.array([0.0, 100.0]), jnp.full(2, 4e5), density, WIND.cutoff_voltage, WIND.origin
    )
    law = power_limited(Constant(volts), Collector(COLLECTOR.width_times_length, series), limit)
    for time in (0.0, 10.0, 50.0, 100.0):
        now = np.interp(time, [0.0, 100.0], density)
        wanted = power_of(np.array(VOLTS), now)
        found = power_of(np.asarray(law.voltage(measured(time))), now)
        assert found == pytest.approx(min(2.0, wanted), rel=1e-6)


@pytest.mark.nightly
def test_limit_of_a_scene():
    """The constant voltages of a scene in a steady wind, whose power would be above the limit, need exactly
    the limit."""
    limited = SMALL | WIRES | {"voltage.value": VOLTS, "voltage.power_limit": 2.0}
    system = build(*split(esail.load_scene("baseline", limited))).system
    law = find_term(system.loads, CoulombThrust).voltage_law
    assert power_of(np.array(VOLTS), 7.3e6) > 3.0
    assert power_of(np.asarray(law.value), 7.3e6) == pytest.approx(2.0, rel=1e-6)


def test_derivatives_are_those_of_the_formula():
    """Power and limited voltages have derivatives by radius, limit and voltage, also at zero voltage."""

    def limited(x):
        collector = Collector(x[0] * COLLECTOR.width_times_length, WIND)
        volts = collector.within_power(jnp.zeros(()), x[2] * jnp.array(VOLTS), x[1])
        return jnp.concatenate([volts / 1e4, 1e4 * collector.current(jnp.zeros(()), volts)])

    at, step = jnp.array([1.0, 2.0, 1.0]), 1e-4
    slopes = jax.jacfwd(limited)(at)
    assert np.allclose(slopes, jax.jacrev(limited)(at), rtol=1e-12, atol=1e-15)
    for k in range(3):
        move = step * at[k] * jnp.eye(3)[k]
        quotient = (limited(at + move) - limited(at - move)) / (2.0 * step * at[k])
        assert np.allclose(slopes[:, k], quotient, rtol=1e-7, atol=1e-11), k


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"voltage.power_limit": 50.0},
         r"`tethers.wire_radius` must be given with `voltage.power_limit`, but is missing"),
        ({**WIRES, "voltage.power_limit": 0.0}, r"`voltage.power_limit` must be positive, but is 0.0"),
        ({"tethers.wires": 4}, r"`tethers.wires` must be left out without `tethers.wire_radius`"),
        ({**WIRES, "tethers.wires": 2.5}, r"`tethers.wires` must be a positive integer, but is 2.5"),
        ({**WIRES, "tethers.wire_radius": -1.0}, r"`tethers.wire_radius` must be positive, but is -1.0"),
        ({**WIRES, "voltage.value": None, "solar_wind.speed": None, "solar_wind.number_density": None,
          "solar_wind.cutoff_voltage": None},
         r"`tethers.wire_radius` must be left out without \[solar_wind\], but is given"),
    ],
)  # fmt: skip
def test_bad_input(overrides, message, nothing_compiles):
    """One line names the key before anything is compiled."""
    with pytest.raises(esail.SceneError, match=message):
        esail.load_scene("baseline", overrides)
