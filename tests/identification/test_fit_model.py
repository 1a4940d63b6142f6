"""What a fit predicts is what the instruments show of runs of the scene, and its derivative that of runs.

All tests share the program of `support/measured_sail.py`.
"""

import functools
import importlib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from esail_jax.identification import information
from esail_jax.identification.fit import Problem
from support.measured_sail import NOISE, SAIL, TIMES, cell_names, sail, served, telemetry, whole

pytestmark = pytest.mark.nightly

STEPS = {
    "solar_wind.thrust_factor": 0.05, "solar_wind.number_density": 1.5e5,
    "tethers.length": 0.1, "hub.inertia": 0.05, "hub.centre": 0.01,
    "hub.torque": 1e-3, "bias.spin_rate": 1e-3, "misalignment.angular_velocity_B": 0.01,
    "initial.spin_rate": 1e-4, "hub.roots": 3e-3,
}  # fmt: skip
"""Steps of the difference quotients: small beside the size over which a run is no straight line in the
number, and large beside the tolerance of the run over the size of its derivative."""


@pytest.fixture(scope="module")
def start():
    return np.array([p.start for p in whole().parameters])


def names_of_all():
    """The names of all parameters of the program."""
    return [parameter.name for parameter in whole().parameters]


def in_cells(data):
    """Telemetry in the order of the cells of the program."""
    row = {time: k for k, time in enumerate(TIMES)}
    names = cell_names(whole().cells[0])
    return np.array([data[name][row[time]][place] for time, name, place in names])


@functools.cache
def run_of(numbers):
    """What a run of the scene shows, with numbers at the places of the parameters, by hand."""
    given = dict(numbers)
    inertia, centre, roots = (SAIL[f"hub.{name}"].copy() for name in ("inertia", "centre", "roots"))
    inertia[0, 1] = inertia[1, 0] = given["hub.inertia[1,2]"]
    centre[0], roots[1, 1] = given["hub.centre[1]"], given["hub.roots[2,2]"]
    return telemetry({
        "solar_wind.thrust_factor": given["solar_wind.thrust_factor"],
        "solar_wind.number_density": given["solar_wind.number_density"], "hub.inertia": inertia,
        "tethers.length": [given[f"tethers.length[{k}]"] for k in (1, 2, 3)], "hub.centre": centre,
        "hub.torque": [given[f"hub.torque[{k}]"] for k in (1, 2, 3)],
        "initial.spin_rate": given["initial.spin_rate"], "hub.roots": roots,
    })  # fmt: skip


def by_runs(values):
    """What instruments show at values of all parameters: a run, turned and with its bias."""
    given = dict(zip((p.name for p in whole().parameters), values.tolist(), strict=True))
    of_scene = [p.name for p in whole().parameters if not p.of_instrument]
    shown = dict(run_of(tuple((name, given[name]) for name in of_scene)))
    theta = [given[f"misalignment.angular_velocity_B[{k}]"] for k in (1, 2, 3)]
    shown["angular_velocity_B"] = Rotation.from_rotvec(theta).apply(shown["angular_velocity_B"].copy())
    shown["spin_rate"] = shown["spin_rate"] + [given[f"bias.spin_rate[{k}]"] for k in (1, 2)]
    return in_cells(shown)


def quotients(values, k):
    """The derivative of what instruments show by parameter k: central differences of order four."""
    step = STEPS[whole().parameters[k].key]
    one, two = (
        by_runs(values + n * step * unit) - by_runs(values - n * step * unit)
        for n, unit in ((n, np.eye(len(values))[k]) for n in (1.0, 2.0))
    )
    return (8.0 * one - two) / (12.0 * step)


def test_predictions_are_those_of_runs_of_the_scene(start):
    """At the numbers of the scene and at others, every observable to 1e-9 of its largest entry."""
    other = start + 2.0 * np.array([STEPS[p.key] for p in whole().parameters])
    names = np.array(whole().cells[0].name)
    for values in (start, other):
        found, expected = whole().models[0](values).values, by_runs(values)
        for name in NOISE:
            mine = names == name
            assert np.abs(found - expected)[mine].max() < 1e-9 * np.abs(expected[mine]).max(), name
    assert np.abs(by_runs(other) - by_runs(start)).max() > 1e-3


CHECKED = (
    "solar_wind.thrust_factor", "solar_wind.number_density", "tethers.length[2]", "hub.inertia[1,2]",
    "hub.centre[1]", "hub.torque[1]", "hub.torque[3]", "bias.spin_rate[2]",
    "misalignment.angular_velocity_B[1]", "misalignment.angular_velocity_B[3]", "initial.spin_rate",
    "hub.roots[2,2]",
)  # fmt: skip


@pytest.mark.parametrize("name", CHECKED)
def test_the_jacobian_is_that_of_runs(start, name):
    """To 1e-6 of the largest entry of the column: the tolerance of the run, 1e-10, over the change that a
    step makes, and truncation of the same size."""
    k = names_of_all().index(name)
    quotient = quotients(start, k)
    assert np.abs(whole().models[0](start).jacobian[:, k] - quotient).max() < 1e-6 * np.abs(quotient).max()


def test_some_parameters_and_cells_in_another_order_predict_the_same(start):
    """A problem with three parameters, the rows of the data turned round and half of them missing has the
    same numbers, from its own program, as the part of the program of all."""
    times = TIMES[::-2]
    free = ("initial.spin_rate", "bias.spin_rate[2]", "tethers.length[2]")
    data = {"coning_angle[2]": np.zeros(len(times)), "time": times, "spin_rate": np.zeros((len(times), 2))}
    data["spin_rate"][0, 1] = np.nan
    own = Problem.of(sail(), data, free, {"spin_rate": 1e-6, "coning_angle": 1e-5})
    at = np.array([0.0501, 1e-4, 300.2])
    part = served(own.scene, own.parameters, own.cells[0])(at)
    found = own.models[0](at)
    np.testing.assert_allclose(found.values, part.values, rtol=0, atol=1e-9)
    scale = np.abs(part.jacobian).max(0)
    np.testing.assert_allclose(found.jacobian / scale, part.jacobian / scale, rtol=0, atol=1e-7)


def test_a_run_that_fails_predicts_no_numbers(start):
    """NaN in place of a number that is wrong: negative tethers."""
    values = start.copy()
    values[names_of_all().index("tethers.length[1]")] = -300.0
    assert np.isnan(whole().models[0](values).values).any()


@pytest.fixture
def _shared(monkeypatch):
    """Fisher information takes its derivatives from the program of all."""
    module = importlib.import_module("esail_jax.identification.information")
    monkeypatch.setattr(module, "predictor", served)


@pytest.mark.usefixtures("_shared")
def test_information_is_the_sum_over_the_cells(start):
    """J^T J in units of the noise, with J by differences of runs as above: to 1e-6 of the root of the
    product of two diagonal entries. `times` chooses rows, a place of an observable a column."""
    free = ("hub.torque[1]", "hub.torque[3]", "initial.spin_rate")
    noise = {"spin_rate[2]": 1e-6, "angular_velocity_B": 2e-6}
    times = TIMES[3::3]
    names, found = information(sail(), free, noise, times)
    assert names == free
    columns = [quotients(start, names_of_all().index(name)) for name in names]
    cells = cell_names(whole().cells[0])
    weight = np.array([
        (time in times) * {"spin_rate": (place == (1,)) / 1e-6, "angular_velocity_B": 1 / 2e-6}.get(name, 0)
        for time, name, place in cells
    ])  # fmt: skip
    jacobian = np.stack(columns, axis=1) * weight[:, None]
    expected = jacobian.T @ jacobian
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-6)


@pytest.mark.usefixtures("_shared")
def test_the_inverse_of_the_information_is_the_covariance_of_a_fit(start):
    """At the same point, to rounding enlarged by the condition of the matrix: data without noise, so that
    the fit ends where it starts."""
    free = ("solar_wind.thrust_factor", "initial.spin_rate", "bias.spin_rate[2]")
    problem = Problem.of(sail(), telemetry(), free, NOISE)
    problem.__dict__["models"] = [served(sail(), problem.parameters, problem.cells[0])]
    fit = problem.solved()
    names, matrix = information(sail(), free, NOISE, TIMES)
    assert names == fit.parameters
    np.testing.assert_allclose(fit.values, [p.start for p in problem.parameters], rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(np.linalg.inv(matrix), fit.covariance, rtol=1e-5)
