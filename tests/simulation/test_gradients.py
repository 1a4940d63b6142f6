"""`jax.jvp`, `jax.grad` and `jax.vmap` of `simulate`, over whole runs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
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
        return {name: found[name] for name in (*SIGNALS, "dissipated_energy")}

    return signals


def numbers(scale=0.0):
    """The numbers of KEYS, moved along the direction by `scale`."""
    return {key: jnp.asarray(value + scale * size) for key, (value, size) in KEYS.items()}


@pytest.fixture(scope="module")
def differentiated(run):
    """A traced run and its derivative along the direction of KEYS, which moves nine numbers at once."""
    direction = {key: jnp.asarray(size) for key, (_, size) in KEYS.items()}
    return jit(lambda x: jax.jvp(run, (x,), (direction,)))(numbers())


@pytest.mark.nightly
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


@pytest.mark.nightly
def test_traced_run_equals_the_host_run(run, differentiated):
    """A traced run equals a run on the host to rounding (positions of 1e4 m: 2e-12).

    A traced run is one program; the host calls several. The compiler orders their operations differently,
    so that the results are not bit-identical.
    """
    host, (traced, _) = run(to_floats(numbers())), differentiated
    for name in SIGNALS:
        scale = np.abs(host[name]).max()
        assert np.abs(np.asarray(host[name]) - traced[name]).max() < 1e-11 * scale + 1e-14, name


@pytest.mark.nightly
def test_vmap_over_voltages_equals_a_loop(small):
    """Members of a batch do not influence each other."""
    volts = jnp.array([10e3, 20e3])

    def tip(volt):
        return esail.simulate("baseline", {**small, "voltage.value": volt})["tip_position_I"]

    batch = jit(jax.vmap(tip))(volts)
    for member, volt in zip(batch, volts, strict=True):
        np.testing.assert_allclose(member, tip(float(volt)), rtol=0, atol=1e-8)


@pytest.mark.nightly
def test_reverse_mode_agrees_with_forward_mode(run, differentiated):
    """The derivatives of the final coning of tether 1 and of the dissipated energy along the direction of
    KEYS are the same by vjp and jvp (1e-9 of the sum of the parts' magnitudes: rounding).

    Reverse mode skips the powers where no output depends on them; the two outputs cover both cases.
    """

    def ends(signals):
        return jnp.stack([signals["coning_angle"][-1, 0], signals["dissipated_energy"][-1]])

    # The weights are an argument, so that one program computes both rows.
    @jit
    def pulled_back(weights):
        (slopes,) = jax.vjp(lambda x: ends(run(x)), numbers())[1](weights)
        return jnp.stack([slopes[key] * size for key, (_, size) in KEYS.items()])

    for weights, forward in zip(jnp.eye(2), ends(differentiated[1]), strict=True):
        parts = np.asarray(pulled_back(weights))
        assert abs(parts.sum() - forward) < 1e-9 * np.abs(parts).sum()
        assert abs(forward) > 1e-3 * np.abs(parts).sum()  # the parts do not cancel


@pytest.mark.nightly
def test_a_derivative_of_a_failed_run_is_nan(small):
    """With a fifth of the step, the bound of steps ends the run after a quarter. The observables are NaN
    from there on; so is the reverse gradient of their mean, which would otherwise be that of the rows
    before. Forward mode has the derivative of these rows."""

    def energies(volts, step):
        given = {**small, "output.interval": 5.0, "voltage.value": volts}
        options = {"stepper": GeneralizedAlpha(step, jnp.asarray(0.8)), "max_steps": 50}
        return esail.simulate("baseline", given, save=["kinetic_energy"], **options)["kinetic_energy"]

    slope = jit(jax.grad(lambda volts, step: energies(volts, step).mean()))
    whole, failed = slope(20e3, 0.5), slope(20e3, 0.1)
    assert np.isnan(failed) and np.isfinite(whole) and whole != 0.0
    rows, slopes = jit(lambda v: jax.jvp(lambda v: energies(v, jnp.asarray(0.1)), (v,), (1.0,)))(20e3)
    assert np.array_equal(np.isfinite(rows), [True, True, False, False, False])
    assert np.array_equal(np.isfinite(slopes), np.isfinite(rows))


def test_a_bound_of_steps_leaves_a_derivative_its_room(monkeypatch):
    """A bound of steps with error control asks for more windows, never for fewer than without a bound: the
    number of steps in a window is not known before the run."""
    from esail_jax.simulation import under_trace

    found = []

    def taken(structure, schedule, *rest):
        found.append(schedule.least)
        raise StopIteration

    monkeypatch.setattr(under_trace, "traced_run", taken)
    scene = esail.load_scene("baseline")
    for most in (None, 10, 10**6):
        with pytest.raises(StopIteration):
            under_trace.simulate_traced(scene, max_steps=most)
    assert found[0] == found[1] == under_trace.LEAST_WINDOWS and found[2] > found[0]
    # A wind with a kink every 10 s: 471 within the run.
    gusts = {"solar_wind.time": np.arange(0.0, 5000.0, 10.0), "solar_wind.speed": np.full(500, 4e5)}
    with pytest.raises(StopIteration):
        under_trace.simulate_traced(scene.replace(gusts))
    assert found[3] == -(-471 // under_trace.KINKS_PER_WINDOW)
