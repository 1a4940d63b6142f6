"""A run that starts displaced along a mode rings with the frequency and the damping of this mode."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

import esail_jax as esail
from esail_jax.equilibria.moving_frame import MovingFrame
from esail_jax.modal.floquet import state_of
from esail_jax.modal.sail_modes import assembled, solved_scene
from esail_jax.modal.turn_map import from_state, settled, to_state
from esail_jax.steppers.stepper import Point
from esail_jax.system import Power

SPIN, AMPLITUDE = 4e-3, 0.05
SCENE = {
    "tethers.count": 3,
    "tethers.elements": 2,
    "integrator.t_end": 200.0,
    "output.interval": 2.0,
    "integrator.tolerance": 1e-11,
}


def started_in(name):
    """The eigenvalue of a mode of a coned sail and a start that is displaced along its shape by
    AMPLITUDE [m]."""
    scene = esail.load_scene("sun-facing", SCENE)
    moving = solved_scene(scene, None)
    table = assembled(scene, moving.found, None)
    mode = table.name.index(name)
    system, q = moving.system, moving.found.at.q
    v = MovingFrame(jnp.asarray(moving.axes[:, 0] * SPIN), jnp.zeros(3)).turned(q)
    shape = np.real(state_of(table, moving, mode))
    z = to_state(system, SPIN, q, v) + AMPLITUDE / np.abs(shape).max() * shape
    zero = jnp.zeros(())
    q, v = from_state(system, SPIN, settled(system, SPIN, z))
    return table.eigenvalue[mode], scene, Point(zero, q, v, Power(zero, zero), jnp.asarray(True))


def rate_of(time, signal, guess):
    """s of the signal c + Re(a exp(s t)) that fits best."""

    def parts(x):
        wave = np.exp((x[0] + 1j * x[1]) * time)
        basis = np.stack([np.ones_like(time), wave.real, wave.imag], axis=1)
        return signal - basis @ np.linalg.lstsq(basis, signal, rcond=None)[0]

    size = np.abs(guess)
    scaled = least_squares(
        lambda x: parts(size * x) / np.ptp(signal), [guess.real / size, guess.imag / size], xtol=1e-14
    )
    return complex(*(size * scaled.x))


@pytest.mark.nightly
def test_a_run_along_a_mode_rings_and_decays_like_it(validate):
    """All tethers stretch together by 5 cm: their length rings with the frequency and decays with the rate
    of the first axial mode, 0.0683 of critical. 1e-4: the next terms in the amplitude, strain by 5e-6 over
    9e-4, times the share of the nonlinear terms."""
    value, scene, start = started_in("first axial (stretching), collective")
    run = esail.simulate(scene, save=("tether_length",), start=start)
    found = rate_of(np.asarray(run.time), np.asarray(run["tether_length"])[:, 0], 1.05 * value)
    case, reference = "run along the first axial mode", "eigenvalue of the mode"
    frequency = abs(found.imag / value.imag - 1.0)
    validate("MOD-8", case, reference, "frequency, relative", frequency, 1e-4)
    ratio = abs(found.real / abs(found) / (value.real / abs(value)) - 1.0)
    validate("MOD-9", case, reference, "damping ratio, relative", ratio, 1e-3)
