"""The law phase-window: on during a part of each turn."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.errors import InputError
from esail_jax.loads.phase_window import PhaseWindow
from esail_jax.loads.voltage_limits import Limits
from esail_jax.measurements import Measurements
from esail_jax.simulation.under_trace import EDGES


def smooth(x):
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)


def window(phase, on, off, rise):
    """The window of phases in degrees: every rise and fall of the turns around is added."""
    turns = 360.0 * np.arange(-3, 4)[:, None]
    off = on + np.mod(off - on, 360.0)
    return (smooth((phase - on - turns) / rise) - smooth((phase - off - turns) / rise)).sum(0)


def law_of(on, off, rise, volts=2e4, maximum=None):
    numbers = (jnp.deg2rad(jnp.asarray(x, float)) for x in (on, off, rise))
    return PhaseWindow(jnp.asarray([volts]), *(x[None] for x in numbers), Limits(maximum))


def at(phase, spin=4e-3, across=0.6):
    """Measurements with the root at a phase [deg] of a sail whose axis is X."""
    angle = jnp.sign(spin) * jnp.deg2rad(phase)
    out = jnp.stack([0.0 * angle, jnp.cos(angle), jnp.sin(angle)])[:, None]
    axis, wind = jnp.array([1.0, 0.0, 0.0]), jnp.array([(1.0 - across**2) ** 0.5, across, 0.0])
    return Measurements(jnp.asarray(0.0), axis, out, out, wind, spin_rate=jnp.asarray(spin))


PHASES = np.arange(-400.0, 800.0, 0.37)


@pytest.mark.parametrize("spin", [4e-3, -4e-3])
@pytest.mark.parametrize(
    "on, off, rise", [(0.0, 180.0, 2.0), (-30.0, 30.0, 10.0), (300.0, 80.0, 25.0), (10.0, 365.0, 20.0)]
)
def test_the_window_is_that_of_every_turn(on, off, rise, spin):
    """To rounding, for both senses of the spin, and where a fall reaches into the next turn."""
    law = law_of(on, off, rise)
    found = jax.vmap(lambda x: law.voltage(at(x, spin))[0])(jnp.asarray(PHASES))
    np.testing.assert_allclose(found, 2e4 * window(PHASES, on, off, rise), rtol=0, atol=1e-8)


def test_with_wind_along_the_axis_it_is_its_mean():
    """The mean over a turn is the width, here a quarter of a turn."""
    law = law_of(0.0, 90.0, 5.0)
    for across in (0.0, 1e-6):
        np.testing.assert_allclose(law.voltage(at(33.0, across=across)), 5e3, rtol=1e-3)
    np.testing.assert_allclose(law.voltage(at(33.0, across=1e-3)), 2e4, rtol=1e-12)


def test_derivatives_by_its_numbers():
    """By the value, the phases and the rise, within an edge: difference quotients of fourth order."""

    def volts(x):
        return (
            law_of(x[1], x[2], x[3], x[0]).voltage(at(8.0))[0]
            + law_of(x[1], x[2], x[3], x[0]).voltage(at(187.0))[0]
        )

    x, h = jnp.array([2e4, 5.0, 185.0, 10.0]), jnp.array([1.0, 1e-2, 1e-2, 1e-2])
    found = jax.jacfwd(volts)(x)
    np.testing.assert_allclose(jax.grad(volts)(x), found, rtol=1e-12)
    for k in range(4):
        e = jnp.zeros(4).at[k].set(h[k])
        quotient = (8 * (volts(x + e) - volts(x - e)) - volts(x + 2 * e) + volts(x - 2 * e)) / (12 * h[k])
        np.testing.assert_allclose(found[k], quotient, rtol=1e-7, atol=1e-9)


def test_steps_end_at_its_edges():
    """Foreseen at the spin rate of the moment, also for a negative one; and just about the phase at which
    the voltage reaches the one at which thrust begins."""
    law, rate = law_of(10.0, 190.0, 5.0), np.deg2rad(1.0)
    for spin in (rate, -rate):
        found = np.sort(np.concatenate([np.atleast_1d(x) for x in law.knots(at(0.0, spin), ())]))
        np.testing.assert_allclose(found, [10.0, 15.0, 190.0, 195.0], rtol=1e-9)
    knots = [float(x[0]) for x in law.knots(at(0.0, rate), (jnp.asarray(1e3),))]
    assert len(knots) == EDGES
    for kink, first, last in ((knots[4:7], 10.0, 12.5), (knots[7:], 192.5, 195.0)):
        assert first < kink[0] < kink[1] < kink[2] < last
        middle = np.array([0.5 * (kink[1] + kink[2])])
        assert 2e4 * window(middle, 10.0, 190.0, 5.0) == pytest.approx(1e3, rel=1e-6)


@pytest.mark.parametrize(
    "keys, message",
    [
        ({"off_phase_deg": 360.0}, "`voltage.off_phase_deg` must differ from `voltage.on_phase_deg`"),
        ({"rise_phase_deg": 0.0}, "`voltage.rise_phase_deg` must lie in"),
        ({"rise_phase_deg": None}, "`voltage.rise_phase_deg` must be given with the law phase-window"),
        ({"gain": 1.0}, "`voltage.gain` must be left out with the law phase-window"),
        ({"on_phase_deg": [0.0, 1.0]}, "`voltage.on_phase_deg` must be a number or a list of 3"),
    ],
)
def test_wrong_windows_are_refused(keys, message):
    given = {
        "law": "phase-window",
        "on_phase_deg": 0.0,
        "off_phase_deg": 180.0,
        "rise_phase_deg": 2.0,
    } | keys
    scene = {"tethers.count": 3} | {f"voltage.{key}": x for key, x in given.items()}
    with pytest.raises(InputError, match=message):
        esail.load_scene("baseline", scene)
