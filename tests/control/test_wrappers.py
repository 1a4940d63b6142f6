"""Wrappers of sampled laws: noise, delay, missing sensors and failed sources. (`test_own_law.py` runs a law
with noise and delay.)"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax import control
from esail_jax.control.wrappers import small_rotation, turned
from esail_jax.errors import InputError
from esail_jax.measurements import Measurements
from support.own_laws import Clock, Swinging


def measured(time=0.0):
    angles = jnp.array([0.3, 2.4, 4.5])
    out = jnp.stack([0 * angles, jnp.cos(angles), jnp.sin(angles)])
    return Measurements(
        jnp.asarray(time), jnp.array([1.0, 0.0, 0.0]), out, out, jnp.array([0.8, 0.6, 0.0]),
        spin_rate=jnp.asarray(4e-3), rotation=jnp.eye(3), angular_velocity=jnp.array([4e-3, 0.0, 0.0]),
        tip_position=1e4 * out, tip_velocity=0.0 * out, root_tension=jnp.full(3, 0.3), voltage=jnp.zeros(3),
    )  # fmt: skip


SPREAD = {"rotation": 1e-3, "chords": 2e-3, "angular_velocity": 1e-6, "root_tension": 0.01}


def test_noise_has_the_given_standard_deviation():
    """1,000 samples: the standard error of a standard deviation is 2 %, so 10 % is five of them. Directions
    stay unit vectors, and the attitude a rotation with the spin axis as its first column."""
    law, count = control.Noisy(Clock(), SPREAD, seed=1), 1000
    keys = jax.vmap(lambda i: jax.random.fold_in(jax.random.key(1), i))(jnp.arange(count))
    found = jax.vmap(lambda key: law.disturbed(measured(), key))(keys)
    exact = measured()
    across = found.spin_axis[:, 1:]  # two of the three small angles move the spin axis
    assert np.std(across) == pytest.approx(1e-3, rel=0.1) and abs(np.mean(across)) < 1.5e-4
    assert np.allclose(np.linalg.norm(found.chords, axis=1), 1.0, atol=1e-14)
    assert np.std(found.chords[:, 0]) == pytest.approx(2e-3, rel=0.1)
    assert np.std(found.angular_velocity) == pytest.approx(1e-6, rel=2e3)  # beside the spin itself
    assert np.std(found.angular_velocity - exact.angular_velocity) == pytest.approx(1e-6, rel=0.1)
    assert np.std(found.root_tension) == pytest.approx(0.01, rel=0.1)
    turn = found.rotation
    assert np.allclose(turn @ jnp.swapaxes(turn, 1, 2), np.eye(3), atol=1e-14)
    assert np.allclose(turn[:, :, 0], found.spin_axis)
    assert np.array_equal(found.time, np.zeros(count)) and np.array_equal(found.wind[0], exact.wind)


def test_a_turn_moves_axis_and_roots_together():
    """A turn about X_B leaves the spin axis where it is and turns the roots by the angle; Rodrigues'
    formula at a right angle is exact."""
    found = turned(measured(), jnp.array([1e-2, 0.0, 0.0]))
    assert np.allclose(found.spin_axis, [1, 0, 0], atol=1e-15)
    cosine = (found.radial_directions * measured().radial_directions).sum(0)
    assert np.allclose(cosine, np.cos(1e-2), atol=1e-14)
    assert np.allclose(small_rotation(jnp.array([0.0, 0.0, np.pi / 2])), [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert np.allclose(small_rotation(jnp.zeros(3)), np.eye(3))


def test_a_delayed_law_answers_to_an_earlier_sample():
    """A law of the time answers with the voltages of two periods ago, before that with those of the
    start."""
    law = control.Delayed(Clock(), samples=2)
    memory, volts = law.init(measured()), []
    for k in range(5):
        answer, memory = law.update(measured(35.0 * k), memory)
        volts.append(float(answer[0]))
    assert np.allclose(volts, 20e3 + 10.0 * np.array([0.0, 0.0, 0.0, 35.0, 70.0]))


def test_a_missing_sensor_is_none_and_a_failed_source_gives_no_voltage():
    blind = control.Without(Swinging(), ["root_tension"])
    with pytest.raises(InputError, match=r"None here, .*`root_tension`, .*but own_laws.py.*NoneType"):
        blind.update(measured(), blind.init(measured()))
    broken = control.FailedSource(Clock(), 2, 50.0)
    for time, factor in ((49.0, [1, 1, 1]), (50.0, [1, 0, 1])):
        volts, _ = broken.update(measured(time), broken.init(measured()))
        assert np.array_equal(volts, np.array(factor) * Clock().commanded(measured(time)))


def test_wrong_names_are_refused():
    with pytest.raises(ValueError, match=r"`spread` must have names among .*, but has 'spin'"):
        control.Noisy(Clock(), {"spin": 1.0}, 0)
    with pytest.raises(ValueError, match=r"`names` must be among .*, but has 'camera'"):
        control.Without(Clock(), ["camera"])
    with pytest.raises(ValueError, match="`samples` must be a positive whole number, but is 0"):
        control.Delayed(Clock(), 0)
