"""Fits of functions in closed form in the place of runs: estimates, error bars, intervals, warnings.

The parameters and the cells are those of a sail; what the sail does is replaced (`with_model`).
"""

import itertools
import json

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

import esail_jax as esail
from esail_jax.identification import Prior, fit
from esail_jax.identification.fit import LOSSES, Problem, Profile
from esail_jax.identification.fit_file import result_of, write_json
from esail_jax.identification.priors import as_prior
from support.measured_sail import sail, with_model

T = np.linspace(0.0, 6.0, 25)
LINE = ("bias.kinetic_energy", "hub.torque[1]")
NOISE = {"kinetic_energy": 0.5}


def measured(values, times=T):
    """Data with one column."""
    return {"time": times, "kinetic_energy": values}


def line(p):
    """a + b t."""
    return p[0] + p[1] * jnp.asarray(T)


def problem(values, model=line, free=LINE, noise=NOISE, **more):
    """A problem with one run in the form of a function."""
    return with_model(Problem.of(sail(), measured(values), free, noise, **more), model)


@pytest.fixture(scope="module")
def noisy():
    """A line with noise of the size of `NOISE`."""
    return 2.0 - 0.7 * T + 0.5 * np.random.default_rng(1).standard_normal(len(T))


def test_a_straight_line(noisy):
    """Estimates, covariance and chi squared are those of linear least squares, to 1e-9: the fit ends where
    the cost changes by 1e-10 of itself, and its last step is that of Newton's method."""
    found = problem(noisy).solved()
    design = np.stack([np.ones_like(T), T], axis=1)
    expected, (square,), *_ = np.linalg.lstsq(design, noisy, rcond=None)
    covariance = 0.25 * np.linalg.inv(design.T @ design)
    np.testing.assert_allclose(found.values, expected, rtol=1e-9)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-9)
    np.testing.assert_allclose(found.sd, np.sqrt(np.diag(covariance)), rtol=1e-9)
    assert found.correlation[0, 1] == pytest.approx(covariance[0, 1] / np.prod(found.sd), rel=1e-9)
    assert found.chi_squared == pytest.approx(square / 0.25, rel=1e-9)
    assert found.degrees_of_freedom == len(T) - 2
    assert found.probability == pytest.approx(stats.chi2.sf(square / 0.25, len(T) - 2), rel=1e-8)
    np.testing.assert_allclose(found.residuals[0][:, 0], (design @ expected - noisy) / 0.5, atol=1e-8)
    assert found["hub.torque[1]"] == found.values[1] and found.units == ("J", "N m")
    assert found.scene.hub.torque == (found.values[1], 0.0, 0.0)  # the bias is not in the scene
    assert not found.warnings


@pytest.mark.nightly
def test_the_expected_chi_squared_is_the_number_of_degrees_of_freedom():
    """Over 200 repeats its mean is within four standard errors, and the estimate within one deviation of
    the truth in 68 % of them, within four standard errors of that fraction (Bernoulli)."""
    random = np.random.default_rng(5)
    base = problem(2.0 - 0.7 * T)
    found = []
    for _ in range(200):
        values = 2.0 - 0.7 * T + 0.5 * random.standard_normal(len(T))
        fitted = base.with_values([values]).solved()
        found.append((fitted.chi_squared, *(np.abs(fitted.values - [2.0, -0.7]) < fitted.sd)))
    chi_squared, *inside = np.array(found).T
    count = len(T) - 2
    assert abs(chi_squared.mean() - count) < 4.0 * np.sqrt(2.0 * count / 200)
    share = stats.norm.cdf(1.0) - stats.norm.cdf(-1.0)
    assert (np.abs(np.mean(inside, axis=1) - share) < 4.0 * np.sqrt(share * (1.0 - share) / 200)).all()


def test_missing_cells_do_not_count(noisy):
    """As if their rows were not there; their residuals are NaN."""
    holes = noisy.copy()
    holes[3:20:4] = np.nan
    known = np.isfinite(holes)
    found = problem(holes, lambda p: line(p)[known]).solved()
    less = with_model(
        Problem.of(sail(), measured(noisy[known], T[known]), LINE, NOISE), lambda p: line(p)[known]
    ).solved()
    np.testing.assert_allclose(found.values, less.values, rtol=1e-12)
    np.testing.assert_array_equal(np.isnan(found.residuals[0][:, 0]), ~known)
    assert found.degrees_of_freedom == known.sum() - 2


def test_a_prior_is_a_measurement_of_its_parameter(noisy):
    """F = J^T J / s^2 + 1 / s_p^2 and the weighted mean, exactly; it counts in chi squared and in the
    degrees of freedom."""
    found = problem(noisy, priors={"hub.torque[1]": Prior(0.3, 0.02)}).solved()
    design = np.stack([np.ones_like(T), T], axis=1) / 0.5
    known = design.T @ design + np.diag([0.0, 0.02**-2])
    expected = np.linalg.solve(known, design.T @ (noisy / 0.5) + [0.0, 0.3 / 0.02**2])
    np.testing.assert_allclose(found.values, expected, rtol=1e-9)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(known), rtol=1e-9)
    residuals = design @ expected - noisy / 0.5
    square = residuals @ residuals + ((expected[1] - 0.3) / 0.02) ** 2
    assert found.chi_squared == pytest.approx(square, rel=1e-9)
    assert found.degrees_of_freedom == len(T) + 1 - 2
    text = problem(noisy, priors={"hub.torque[1]": " normal:0.3:2e-2"}).solved()
    np.testing.assert_array_equal(text.values, found.values)


def test_two_runs_are_two_sets_of_data(noisy):
    """The fit of a line to both halves of its data, as runs of their own, is that of the whole; residuals
    keep the form of their data."""
    parts = slice(0, 9), slice(9, len(T))
    halves = Problem.of(sail(), [measured(noisy[k], T[k]) for k in parts], LINE, NOISE)
    found = with_model(halves, *(lambda p, k=k: line(p)[k] for k in parts)).solved()
    whole = problem(noisy).solved()
    np.testing.assert_allclose(found.values, whole.values, rtol=1e-9)
    np.testing.assert_allclose(found.covariance, whole.covariance, rtol=1e-9)
    assert found.chi_squared == pytest.approx(whole.chi_squared, rel=1e-9)
    np.testing.assert_allclose(np.concatenate(found.residuals), whole.residuals[0], atol=1e-8)
    assert [data.name for data in found.data] == ["data[0]", "data[1]"]


def test_the_order_of_names_does_not_matter(noisy):
    found = problem(noisy).solved()
    other = problem(noisy, lambda p: line(p[::-1]), LINE[::-1]).solved()
    np.testing.assert_allclose(other.values[::-1], found.values, rtol=1e-9)
    np.testing.assert_allclose(other.covariance[::-1, ::-1], found.covariance, rtol=1e-9)


def test_a_bound_that_is_reached_is_said():
    """A mass cannot be negative, whatever the data say."""
    found = problem(np.full(len(T), -1.0), lambda p: p[0] + 0.0 * T, ("hub.mass",)).solved()
    assert 0.0 <= found["hub.mass"] < 1e-6
    assert "hub.mass is at its bound 0: its error bar has no meaning." in found.warnings


def test_a_robust_loss_does_without_an_outlier(noisy):
    """One value that is wrong by a hundred deviations moves the constant by more than four of its
    deviations under the linear loss, and by less than one under the others."""
    bad = noisy.copy()
    bad[12] += 50.0
    good = problem(noisy).solved()
    moved = {
        loss: abs(problem(bad, loss=loss).solved().values[0] - good.values[0]) / good.sd[0]
        for loss in ("linear", "soft_l1", "huber", "cauchy")
    }
    assert moved.pop("linear") > 4.0
    assert max(moved.values()) < 1.0


@pytest.mark.parametrize("loss", ["soft_l1", "huber", "cauchy"])
def test_error_bars_under_a_robust_loss_count_weights(noisy, loss):
    """Half of the values are wrong by a hundred deviations, up and down in turn: the covariance is
    (J^T W J)^-1 with the derivatives of the loss, W = d rho/d r^2, by differences; wider than without the
    weights."""
    bad = noisy.copy()
    bad[::2] += 50.0 * (-1.0) ** np.arange(len(bad[::2]))
    found = problem(bad, loss=loss).solved()
    rows = np.stack([np.ones_like(T), T], axis=1) / NOISE["kinetic_energy"]
    square, step = found.residuals[0][:, 0] ** 2, 1e-6
    slope = (LOSSES[loss](square * (1.0 + step)) - LOSSES[loss](square * (1.0 - step))) / (
        2.0 * step * square
    )
    expected = np.linalg.inv((rows * slope[:, None]).T @ rows)
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-5)
    assert (found.sd > 1.2 * np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))).all()
    assert any("under the loss" in words for words in found.warnings)


def test_a_run_that_fails_near_the_estimate_is_said(noisy):
    """Within one deviation of the estimate the model has no numbers: the errors are not those of a normal
    distribution, and the interval ends before."""

    def model(p):
        return jnp.where(p[0] < 1.99, jnp.nan, line(p))

    found = problem(2.0 - 0.7 * T, model).solved([2.0, -0.7])
    assert found.sd[0] > 0.02
    assert any("not those of a normal distribution" in words for words in found.warnings)
    low, high = found.profile(LINE[0])
    assert 1.98 < low < 2.0 and abs(high - 2.0 - found.sd[0]) < 0.01 * found.sd[0]


def test_a_wrong_model_is_noticed_by_chi_squared(noisy):
    """A parabola of six deviations in the data, and a line for a model."""
    found = problem(noisy + (T - 3.0) ** 2 / 3.0).solved()
    assert found.probability < 1e-3
    assert any(words.startswith("Chi squared is ") for words in found.warnings)


def test_as_many_measurements_as_parameters_test_nothing():
    at = measured([1.0, 3.0], [0.0, 2.0])
    found = with_model(Problem.of(sail(), at, LINE, NOISE), lambda p: p[0] + p[1] * jnp.array([0.0, 2.0]))
    result = found.solved()
    np.testing.assert_allclose(result.values, [1.0, 1.0], rtol=1e-9)
    assert result.degrees_of_freedom == 0 and np.isnan(result.probability)
    assert "There are no more measurements than parameters: nothing tests the model." in result.warnings


PAIR = ("solar_wind.number_density", "solar_wind.thrust_factor", "hub.torque[1]")


def product(p):
    """A slope that follows sqrt(n) f, as thrust does, and a parabola."""
    return jnp.sqrt(p[0] / 7.3e6) * p[1] * T + p[2] * T**2


def test_what_the_data_do_not_see_is_named_and_is_null_in_the_file(tmp_path):
    """Number density and factor are seen as sqrt(n) f only. A prior on one of them is enough."""
    found = problem(0.2 * T + 0.1 * T**2, product, PAIR).solved()
    assert np.isinf(found.sd[:2]).all() and np.isfinite(found.sd[2])
    assert found["hub.torque[1]"] == pytest.approx(0.1, rel=1e-8)
    words = (
        "solar_wind.number_density and solar_wind.thrust_factor can be told apart only by their product "
        "solar_wind.number_density^0.5 solar_wind.thrust_factor"
    )
    assert found.weakest.words == words and f"Not seen: {words}." in found.warnings
    write_json(tmp_path / "fit.json", result_of(found, {}))
    text = (tmp_path / "fit.json").read_text()
    content = json.loads(text, parse_constant=pytest.fail)
    assert content["sd"] == [None, None, found.sd[2]] and content["weakest"]["sd"] is None
    assert content["values"] == found.values.tolist()
    with pytest.raises(esail.SceneError, match="must be a parameter that the data see, but is solar_wind"):
        found.profile("solar_wind.number_density")
    known = {"solar_wind.number_density": (7.3e6, 1e5)}
    again = problem(0.2 * T + 0.1 * T**2, product, PAIR, priors=known).solved()
    assert again["solar_wind.number_density"] == pytest.approx(7.3e6, rel=1e-6)
    assert again.sd[0] == pytest.approx(1e5, rel=1e-6)
    assert again["solar_wind.thrust_factor"] == pytest.approx(0.2, rel=1e-6)


# ---- intervals -------------------------------------------------------------------------------------


def test_the_profile_of_a_linear_parameter_is_its_deviation(noisy):
    """Also of correlated ones: chi squared least over the other grows by (dp / sd)^2. The search ends at
    1e-3 of the deviation."""
    found = problem(noisy).solved()
    for k, name in enumerate(LINE):
        low, high = found.profile(name)
        assert high - found[name] == pytest.approx(found.sd[k], rel=3e-3)
        assert found[name] - low == pytest.approx(found.sd[k], rel=3e-3)


def test_an_interval_that_ends_where_the_search_looks_first(noisy, monkeypatch):
    """Chi squared of a straight line grows by 1 in one deviation, where the search looks first, but for
    rounding. If another look finds less than 1 there, the end is found nevertheless."""
    found = problem(noisy).solved()
    looks = itertools.count()

    def grown(self, value):
        rounding = 1e-12 - 1e-11 * next(looks)
        return ((value - found.values[0]) / found.sd[0]) ** 2 + rounding

    monkeypatch.setattr(Profile, "grown", grown)
    low, high = found.profile(LINE[0])
    np.testing.assert_allclose(
        [low, high], found.values[0] + found.sd[0] * np.array([-1.0, 1.0]), rtol=1e-3
    )


def test_the_profile_of_a_bent_posterior():
    """y = m^2 with an error of 0.7 at m = 1: the interval is from sqrt(0.3) to sqrt(1.7), and the
    deviation 0.35; the fit says that errors are not normal. With a hundredth of the error it does not."""
    square = lambda p: p[0] ** 2 + 0.0 * T  # noqa: E731
    ones, free = np.ones(len(T)), ("hub.mass",)
    found = problem(ones, square, free, {"kinetic_energy": 3.5}).solved([2.0])
    assert found.sd[0] == pytest.approx(0.35, rel=1e-6)
    np.testing.assert_allclose(found.profile("hub.mass"), np.sqrt([0.3, 1.7]), rtol=0, atol=5e-4)
    (words,) = found.warnings
    assert words.startswith(
        "The errors are not those of a normal distribution along hub.mass: one standard"
    )
    assert words.endswith("`profile` gives intervals.")
    assert not problem(ones, square, free, {"kinetic_energy": 0.035}).solved([2.0]).warnings


def test_ends_of_an_interval_that_are_a_bound_or_infinite():
    """A mass of 0.3 with a deviation of 0.5 may be zero; exp(-m) = 0.1 with an error of 0.2 has no upper
    end, and the lower one is -ln 0.3."""
    free = ("hub.mass",)
    flat = problem(np.full(len(T), 0.3), lambda p: p[0] + 0.0 * T, free, {"kinetic_energy": 2.5}).solved()
    low, high = flat.profile("hub.mass")
    assert low == 0.0 and high == pytest.approx(0.8, abs=1e-3)
    decay = lambda p: jnp.exp(-p[0]) + 0.0 * T  # noqa: E731
    late = problem(np.full(len(T), 0.1), decay, free, {"kinetic_energy": 1.0}).solved([1.0])
    low, high = late.profile("hub.mass")
    assert low == pytest.approx(-np.log(0.3), abs=3e-3) and high == np.inf


def test_a_profile_of_what_is_no_parameter_is_refused(noisy):
    with pytest.raises(esail.SceneError) as error:
        problem(noisy).solved().profile("hub.mass")
    assert (
        str(error.value) == f"`name` must be a parameter of the fit ({', '.join(LINE)}), but is 'hub.mass'"
    )


def test_a_profile_needs_the_loss_of_normal_noise(noisy):
    """Chi squared is not what another loss has made least."""
    with pytest.raises(esail.SceneError, match=r"^`loss` must be linear for a profile, but is huber$"):
        problem(noisy, loss="huber").solved().profile(LINE[0])


# ---- course of a fit -------------------------------------------------------------------------------


def bent_line(p):
    """A model in which the search takes some steps."""
    return jnp.exp(p[0]) + p[1] ** 3 * T


def test_better_points_are_handed_on(noisy):
    """The first is the start; costs fall; the last is the estimate, with half of chi squared."""
    points = []
    clean = np.asarray(bent_line(np.array([0.5, 0.8]))) + noisy - 2.0 + 0.7 * T
    found = problem(clean, bent_line).solved([0.0, 2.0], told=points.append)
    costs = [point.cost for point in points]
    assert len(points) > 3 and (np.diff(costs) < 0.0).all()
    np.testing.assert_array_equal(points[0].values, [0.0, 2.0])
    np.testing.assert_array_equal(points[-1].values, found.values)
    assert costs[-1] == pytest.approx(0.5 * found.chi_squared, rel=1e-12)
    assert [p.evaluations for p in points] == sorted(p.evaluations for p in points)
    # From a point in the middle it ends at the same estimates.
    again = problem(clean, bent_line).solved(points[2].values)
    np.testing.assert_allclose(again.values, found.values, rtol=1e-6)


def test_a_fit_that_has_not_ended_says_so(noisy):
    found = problem(noisy, bent_line).solved([0.0, 2.0], evaluations=2)
    assert "The fit has not ended after 2 evaluations." in found.warnings


def test_a_run_that_fails_on_the_way_is_no_estimate():
    """Beyond 1.5 the run fails, and the first step leads there; the fit goes on with shorter ones."""
    fails = lambda p: jnp.where(p[0] > 1.5, jnp.nan, jnp.exp(p[0])) + 0.0 * T  # noqa: E731
    free = ("bias.kinetic_energy",)
    found = problem(np.full(len(T), np.e), fails, free).solved([0.0])
    assert found.values[0] == pytest.approx(1.0, rel=1e-6)
    with pytest.raises(
        esail.SimulationError, match="The run at the start of the fit fails: see `esail run`"
    ):
        problem(np.full(len(T), np.e), fails, free).solved([2.0])


# ---- refusals --------------------------------------------------------------------------------------

REFUSALS = {
    "prior of another": (
        {"priors": {"hub.mass": (1.0, 1.0)}},
        f"`priors` must be of free parameters ({', '.join(LINE)}), but has 'hub.mass'",
    ),
    "text": (
        {"priors": {LINE[0]: "uniform:0:1"}},
        f"`priors[{LINE[0]}]` must be normal:MEAN:SD, or a pair of numbers, but is 'uniform:0:1'",
    ),
    "deviation": (
        {"priors": {LINE[0]: (0.0, 0.0)}},
        f"`priors[{LINE[0]}]` must have a finite mean and a positive deviation, but is (0.0, 0.0)",
    ),
    "no runs": ({"data": []}, "`data` must be that of one run or more, but is empty"),
    "start": (
        {"start": [1.0]},
        "`start` must have a value within its bounds for every parameter, but is [1.0]",
    ),
    "bounds": (
        {"free": ["hub.mass"], "start": [-1.0]},
        "`start` must have a value within its bounds for every parameter, but is [-1.0]",
    ),
    "evaluations": ({"evaluations": 0}, "`evaluations` must be positive, but is 0"),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_a_wrong_argument_is_refused_before_anything_is_compiled(case, nothing_compiles):
    change, message = REFUSALS[case]
    given = {"data": measured(np.zeros(len(T))), "free": LINE, "noise": NOISE} | change
    with pytest.raises(esail.SceneError) as error:
        fit(sail(), **given)
    assert str(error.value) == message


@pytest.mark.parametrize(
    "text", ["normal:1", "normal:a:1", "normal:1:2:3", ("x", 1.0), 3.0, (1.0, 2.0, 3.0)]
)
def test_what_is_no_prior(text):
    with pytest.raises(esail.SceneError, match=r"must be normal:MEAN:SD, or a pair of numbers"):
        as_prior("hub.mass", text)
