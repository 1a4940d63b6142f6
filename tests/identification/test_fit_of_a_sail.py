"""Fits of a sail to telemetry that it has made, with noise: truth within the error bars, what is noticed,
and what does not matter."""

import importlib

import numpy as np
import pytest

import esail_jax as esail
from esail_jax.identification import fit
from esail_jax.identification.fit import Problem
from support.measured_sail import NOISE, SAIL, TIMES, sail, served, telemetry, with_noise

pytestmark = pytest.mark.nightly

FREE = ("solar_wind.thrust_factor", "hub.torque[1]", "initial.spin_rate")
TRUTH = {
    "solar_wind.thrust_factor": 0.185, "hub.torque": [1e-3, 0.0, 0.0], "initial.spin_rate": 0.0502,
}  # fmt: skip
VALUES = np.array([0.185, 1e-3, 0.0502])


@pytest.fixture
def _shared(monkeypatch):
    """All fits take their runs from one program."""
    monkeypatch.setattr(importlib.import_module("esail_jax.identification.fit"), "predictor", served)


@pytest.fixture(scope="module")
def data():
    """Telemetry of the sail with the true numbers, with noise."""
    return with_noise(telemetry(TRUTH), 1)


@pytest.mark.usefixtures("_shared")
def test_the_truth_lies_within_the_error_bars(data):
    """Four deviations; chi squared within four of its own. Half of the cells in another order, as two runs,
    give the same as one table with holes, where the search ends, at 1e-10 of the cost."""
    found = fit(sail(), data, FREE, NOISE)
    assert (np.abs(found.values - VALUES) < 4.0 * found.sd).all()
    count = len(TIMES) * 8 - 3
    assert found.degrees_of_freedom == count
    assert abs(found.chi_squared - count) < 4.0 * np.sqrt(2.0 * count)
    assert not found.warnings
    holes = {name: x if name == "time" else x.copy() for name, x in data.items()}
    holes["spin_rate"][::2] = np.nan
    one = {"coning_angle": data["coning_angle"][::-1], "time": TIMES[::-1]}
    two = {
        "time": TIMES[1::2], "spin_rate[2]": data["spin_rate"][1::2, 1],
        "spin_rate[1]": data["spin_rate"][1::2, 0],
    }  # fmt: skip
    three = {"time": TIMES, "angular_velocity_B": data["angular_velocity_B"]}
    whole, parts = fit(sail(), holes, FREE, NOISE), fit(sail(), [one, two, three], FREE[::-1], NOISE)
    assert (np.abs(parts.values[::-1] - whole.values) < 1e-3 * whole.sd).all()
    np.testing.assert_allclose(parts.sd[::-1], whole.sd, rtol=1e-6)
    assert parts.chi_squared == pytest.approx(whole.chi_squared, rel=1e-7)
    assert whole.degrees_of_freedom < count


@pytest.mark.usefixtures("_shared")
@pytest.mark.parametrize(
    "change",
    [{"tethers.length": [300.0, 294.0, 300.0]}, {"hub.torque": [1e-3, 0.0, 1e-3]}],
    ids=["a tether that is 2 % shorter", "a torque about another axis"],
)
def test_a_wrong_model_is_noticed(change):
    """What the parameters cannot do stays in chi squared."""
    found = fit(sail(), with_noise(telemetry(TRUTH | change), 2), FREE, NOISE)
    assert found.probability < 1e-3
    assert any(words.startswith("Chi squared is ") for words in found.warnings)


@pytest.mark.usefixtures("_shared")
def test_number_density_and_factor_are_seen_as_one(data):
    """Thrust follows the factor times the root of the density, and nothing else does; the spin rate is
    known as well as with one of them."""
    pair = ("solar_wind.number_density", *FREE)
    found = fit(sail(), data, pair, NOISE)
    assert np.isinf(found.sd[:2]).all()
    assert found.weakest.words == (
        "solar_wind.number_density and solar_wind.thrust_factor can be told apart only by their product "
        "solar_wind.number_density^0.5 solar_wind.thrust_factor"
    )
    alone = fit(sail(), data, FREE, NOISE)
    np.testing.assert_allclose(found.sd[2:], alone.sd[1:], rtol=1e-4)
    product = np.sqrt(found["solar_wind.number_density"] / 7.3e6) * found["solar_wind.thrust_factor"]
    assert product == pytest.approx(alone["solar_wind.thrust_factor"], abs=1e-3 * alone.sd[0])


@pytest.mark.usefixtures("_shared")
def test_a_bias_does_not_hide_in_what_it_is_not(data):
    """An instrument that shows 1e-4 rad/s too much, and is turned by 3 mrad: both are found."""
    bad = dict(data) | {"spin_rate": data["spin_rate"] + [0.0, 1e-4]}
    theta = 3e-3
    rotation = np.array([
        [np.cos(theta), -np.sin(theta), 0.0], [np.sin(theta), np.cos(theta), 0.0], [0.0, 0.0, 1.0],
    ])  # fmt: skip
    bad["angular_velocity_B"] = data["angular_velocity_B"] @ rotation.T
    found = fit(sail(), bad, (*FREE, "bias.spin_rate[2]", "misalignment.angular_velocity_B[3]"), NOISE)
    expected = np.array([*VALUES, 1e-4, theta])
    assert (np.abs(found.values - expected) < 4.0 * found.sd).all()
    assert found.scene == found.scene.replace({"initial.spin_rate": found["initial.spin_rate"]})


# ---- with programs of their own --------------------------------------------------------------------

POLAR, AXIAL = np.array([1.0, -1.0, 1.0]), np.array([-1.0, 1.0, -1.0])
IMAGE = SAIL | {
    "initial.spin_rate": -SAIL["initial.spin_rate"], "hub.centre": SAIL["hub.centre"] * POLAR,
    "hub.roots": SAIL["hub.roots"] * POLAR, "hub.inertia": SAIL["hub.inertia"] * np.outer(POLAR, POLAR),
}  # fmt: skip
"""The mirror image of the sail in the plane of X_O and Z_O, which spins the other way round."""


@pytest.fixture(scope="module")
def of_truth(data):
    """The problem with a program of its own."""
    return Problem.of(sail(), data, FREE, NOISE)


def test_the_mirror_image_has_the_same_estimates(data, of_truth):
    """Telemetry of the mirror image, fitted with the mirror image of the sail: the factor is the same,
    torque and spin rate have the other sign, to a thousandth of their deviations."""
    shown = dict(data) | {
        "spin_rate": -data["spin_rate"], "angular_velocity_B": data["angular_velocity_B"] * AXIAL,
    }  # fmt: skip
    image = fit(esail.load_scene("truss", IMAGE), shown, FREE, NOISE)
    found = of_truth.solved()
    assert (np.abs(image.values * [1.0, -1.0, -1.0] - found.values) < 1e-3 * found.sd).all()
    np.testing.assert_allclose(image.sd, found.sd, rtol=1e-4)
    assert image.chi_squared == pytest.approx(found.chi_squared, rel=1e-4)


def test_the_error_bars_cover_the_truth_as_often_as_they_say(of_truth):
    """30 repeats: truth within one deviation in 68 % of them, within four standard errors of that fraction
    (Bernoulli), and the mean of chi squared within four of its own."""
    clean = of_truth.models[0](VALUES).values
    random = np.random.default_rng(7)
    noise = of_truth.cells[0].deviations
    fits = [
        of_truth.with_values([clean + noise * random.standard_normal(len(clean))]).solved(VALUES)
        for _ in range(30)
    ]
    inside = np.mean([np.abs(found.values - VALUES) < found.sd for found in fits], axis=0)
    assert (np.abs(inside - 0.6827) < 4.0 * np.sqrt(0.6827 * 0.3173 / 30)).all()
    count = len(clean) - 3
    assert abs(np.mean([found.chi_squared for found in fits]) - count) < 4.0 * np.sqrt(2.0 * count / 30)
