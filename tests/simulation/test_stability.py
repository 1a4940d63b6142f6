"""The growth of a small perturbation: regular and chaotic motion, the command, and the warning."""

import h5py
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.coordinates import Coordinates
from esail_jax.scenes.loading import parse
from esail_jax.simulation.stability import INSTANTS, WARN_GROWTH, measured, perturbation, stability_of
from esail_jax.steppers.stepper import Point
from esail_jax.system import Power
from support.bits import status_of
from support.quick import jit

PENDULUM = """
[chain]
rods = 2
mass = 1.0
length = 1.0
area = 1e-6
youngs_modulus = 1e7

[gravity]
acceleration = [0.0, -9.81, 0.0]

[initial]
rod_vector = [[1.0, 0.0, 0.0], [0.8, 0.6, 0.0]]
rod_rate = [0.0, 0.0, 0.0]

[integrator]
t_end = 6.0
tolerance = 1e-11

[output]
interval = 1.0
"""
"""A double pendulum that is released above the horizontal: its motion is chaotic."""

TIMES = np.linspace(0.0, 100.0, 201)


@pytest.mark.parametrize(
    ("size", "rate", "chaotic"),
    [
        (np.exp(0.3 * TIMES), 0.3, True),
        (1.0 + TIMES, np.log(101 / 56) / 45.0, False),
        (np.exp(0.05 * TIMES) * np.cos(3.0 * TIMES) ** 2, 0.05, False),
    ],
    ids=["exponential", "linear", "oscillation"],
)
def test_growth_of_known_curves(size, rate, chaotic):
    """The rate of an exponential is its exponent. A linear growth has a rate that falls with the duration.
    Zeros of an oscillation do not matter: its largest value in ten units of time is within 1 % of its
    envelope."""
    found = measured(size, TIMES)
    assert abs(found.growth_rate / rate - 1.0) < 0.02
    assert bool(found.warning) == chaotic
    if chaotic:  # exp(0.3 t) exceeds 10^6 exp(0.3 * 10) at t = 10 + 13.8 / 0.3
        assert abs(found.parted - (10.0 + np.log(WARN_GROWTH) / 0.3)) <= 0.5


@pytest.mark.parametrize("count", [1, 30, 120])
def test_a_perturbed_run_that_fails_counts_until_its_failure(count):
    """The run is NaN from one of its instants on. The instants before give the rate of exp(0.3 t) if there
    are enough of them: 30 are too few, and 1 is only the start. From the first tenth of 60 s to their end
    the curve grows by exp(0.3 * 54), 1.1e7: more than the 10^6 of unstable motion."""
    times = jnp.asarray(TIMES)

    def positions(point):
        size = jnp.where(jnp.arange(201) < count, jnp.exp(0.3 * times), jnp.nan)
        return size[:, None, None] * jnp.sum(point.v.tether) * jnp.ones(3)

    rest = Coordinates(jnp.zeros((2, 3, 2, 3)), None)
    work = Power(jnp.asarray(0.0), jnp.asarray(0.0))
    start = Point(jnp.asarray(0.0), rest, rest, work, jnp.asarray(True))
    found = stability_of(positions, start, TIMES)
    assert found.failed == TIMES[count - 1]
    assert f"the run with it failed after {TIMES[count - 1]:.0f} s" in found.warning
    assert np.isnan(found.growth_rate) == (count < 50)
    assert ("unstable or chaotic" in found.warning) == (count == 120)
    if count == 120:
        assert abs(found.growth_rate / 0.3 - 1.0) < 0.02


@pytest.mark.nightly
def test_growth_in_a_double_pendulum_is_that_of_two_runs():
    """The tangent is the difference of two runs whose starts differ by 1e-7 m/s, while that is small.

    The difference stays below 1e-5 m, so that second-order terms are below 1e-4 of it; the growth, some 25,
    is compared to 1 %. Near its rest the two modes of the pendulum exchange the perturbation, which grows
    3-fold."""
    scene = parse(PENDULUM, "pendulum")
    found = esail.simulate(scene, stability=True).stats["stability"]
    times = np.linspace(0.0, 6.0, INSTANTS)
    start = esail.simulate(scene, times=[0.0]).final_state
    step = 1e-7
    moved = start._replace(v=start.v.axpy(step, perturbation(start)))
    one, other = (
        esail.simulate(scene, times=times.tolist(), start=point, save=["joint_position"])["joint_position"]
        for point in (start, moved)
    )
    size = np.sqrt(np.square((other - one) / step).reshape(INSTANTS, -1).sum(1))
    expected = measured(size, times)
    assert found.growth > 10.0
    assert abs(found.growth / expected.growth - 1.0) < 0.01
    assert abs(found.growth_rate - expected.growth_rate) < 0.01 * abs(expected.growth_rate)
    calm = scene.replace({"initial.rod_vector": [[0.01, -0.99995, 0.0]] * 2})
    regular = esail.simulate(calm, stability=True)
    assert regular.stats["stability"].growth < 5.0 and not regular.stats["message"]


@pytest.mark.nightly
def test_the_command_writes_the_growth_and_warns(tmp_path, capsys):
    """After 60 s of chaos the growth exceeds 10^6: the file says so, and so does `esail info`. A complete
    run is not changed."""
    scene, path = tmp_path / "pendulum.toml", tmp_path / "a.h5"
    scene.write_text(PENDULUM)
    command = ["run", str(scene), "-o", str(path), "--stability", "--t-end", "60"]
    assert main(command) == 0
    assert "The motion is unstable or chaotic" in capsys.readouterr().out
    with h5py.File(path) as file:
        assert file.attrs["growth"] > WARN_GROWTH and file.attrs["growth_rate"] > 0.1
        assert "accurate runs part after" in file.attrs["message"]
    assert status_of(path) == "complete"
    before = path.read_bytes()
    assert main([*command, "--resume"]) == 2
    assert "`--stability` must be given before a run is complete" in capsys.readouterr().err
    assert path.read_bytes() == before


def test_a_traced_run_has_no_stability():
    def coning(volts):
        return esail.simulate("baseline", {"voltage.value": volts}, stability=True)["coning_angle"]

    with pytest.raises(esail.SceneError, match="`stability` must be False under a trace"):
        jax.eval_shape(
            lambda v: esail.simulate("baseline", {"voltage.value": v}, stability=True)["time"], 1e4
        )


@pytest.mark.nightly
def test_a_sail_blown_over_by_the_wind_is_unstable(monkeypatch):
    """Without remote units and with a tenth of the spin, the wind folds the tethers. The perturbation
    exceeds 10^6 between 3,400 and 4,500 s, whatever the rounding errors are. The regular sail's
    perturbation grows in proportion to time: about 1.4 over the duration."""
    monkeypatch.setattr("esail_jax.simulation.stability.jit", jit)
    small = {"tethers.count": 3, "tethers.elements": 2, "output.interval": 100.0}
    weak = {"remote_units.mass": 0.0, "initial.spin_rate": 4e-4, "integrator.t_end": 6000.0}
    blown = esail.simulate("baseline", small | weak, stability=True)
    assert "unstable or chaotic" in blown.stats["message"]
    regular = esail.simulate("baseline", small | {"integrator.t_end": 1571.0}, stability=True)
    assert regular.stats["stability"].growth_rate * 1571.0 < 3.0 and not regular.stats["message"]
