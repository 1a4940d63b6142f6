"""`jax.jvp`, `jax.grad` and `jax.vmap` of `simulate`, over whole runs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from support.quick import jit

KEYS = {
    "voltage.value": (20e3, 100.0),
    "initial.spin_rate": (4e-3, 1e-5),
    "tethers.length": (10e3, 1.0),
    "tethers.youngs_modulus": (70e9, 1e7),
    "remote_units.mass": (1.5, 1e-3),
    "hub.radius": (1.0, 1e-3),
    "solar_wind.speed": (4e5, 1e3),
    "tethers.bending_damping_time": (1.0, 0.1),
    "initial.sailing_angle_deg": (10.0, 0.1),
}
"""The number at which the derivative is taken, and its component of the direction."""

SIGNALS = ("tip_position_I", "coning_angle", "thrust_O", "reaction_B", "kinetic_energy", "euler_sail")


@pytest.fixture(scope="module")
def run(small):
    """A function from all numbers of KEYS to signals of a run."""

    def signals(numbers):
        found = esail.simulate("baseline", {**small, **numbers})
        return {name: found[name] for name in SIGNALS}

    return signals


def numbers(scale=0.0):
    """Returns the numbers of KEYS, moved along the direction by `scale`."""
    return {key: jnp.asarray(value + scale * size) for key, (value, size) in KEYS.items()}


@pytest.fixture(scope="module")
def differentiated(run):
    """A traced run and its derivative along the direction of KEYS, which moves nine numbers at once."""
    direction = {key: jnp.asarray(size) for key, (_, size) in KEYS.items()}
    return jit(lambda x: jax.jvp(run, (x,), (direction,)))(numbers())


@pytest.mark.slow
def test_jvp_through_a_run_is_the_difference_quotient(run, differentiated):
    """The derivative equals the difference quotient to 1e-5, which is the quotient's own accuracy.

    The run starts with exactly straight tethers. The quotient moves the numbers by +-1 % of the direction.
    """
    _, tangent = differentiated
    step = 1e-2
    ahead, behind = run(to_floats(numbers(step))), run(to_floats(numbers(-step)))
    for name in SIGNALS:
        quotient = (np.asarray(ahead[name]) - np.asarray(behind[name])) / (2 * step)
        error = np.abs(quotient - tangent[name]).max() / np.abs(quotient).max()
        assert error < 1e-5, (name, error)


def to_floats(tree):
    return {key: float(value) for key, value in tree.items()}


def test_traced_run_equals_the_host_run(run, differentiated):
    """A traced run equals a run on the host to rounding (positions of 1e4 m: 2e-12).

    A traced run is one program; the host calls several. The compiler orders their operations differently,
    so that the results are not bit-identical.
    """
    host, (traced, _) = run(to_floats(numbers())), differentiated
    for name in SIGNALS:
        scale = np.abs(host[name]).max()
        assert np.abs(np.asarray(host[name]) - traced[name]).max() < 1e-11 * scale + 1e-14, name


def test_vmap_over_voltages_equals_a_loop(small):
    """Members of a batch do not influence each other."""
    volts = jnp.array([10e3, 20e3])

    def tip(volt):
        return esail.simulate("baseline", {**small, "voltage.value": volt})["tip_position_I"]

    batch = jit(jax.vmap(tip))(volts)
    for member, volt in zip(batch, volts, strict=True):
        np.testing.assert_allclose(member, tip(float(volt)), rtol=0, atol=1e-8)


@pytest.mark.slow
def test_reverse_mode_agrees_with_forward_mode(small):
    """d(final coning of tether 1, dissipated energy)/d(voltages, spin) is the same by vjp and jvp (1e-9,
    relative).

    Reverse mode skips the powers where no output depends on them; the two outputs cover both cases.
    """

    def signals(volts, spin):
        found = esail.simulate("baseline", {**small, "voltage.value": volts, "initial.spin_rate": spin})
        return jnp.stack([found["coning_angle"][-1, 0], found["dissipated_energy"][-1]])

    at = (jnp.array([20e3, 18e3, 22e3]), jnp.asarray(4e-3))
    direction = (jnp.array([1.0, 2.0, -1.0]), jnp.asarray(1e-6))
    _, forward = jax.jvp(jit(signals), at, direction)

    # The weights are an argument, so that one program computes both rows.
    @jit
    def pulled_back(weights):
        by_volts, by_spin = jax.vjp(signals, *at)[1](weights)
        return by_volts @ direction[0] + by_spin * direction[1]

    reverse = [pulled_back(weights) for weights in jnp.eye(2)]
    np.testing.assert_allclose(reverse, forward, rtol=1e-9)
