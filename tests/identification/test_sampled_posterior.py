"""Posteriors by Hamiltonian Monte Carlo (NUTS of blackjax) beside what a fit says of them. Models are in
closed form: a run with derivatives costs 40 ms and a chain needs thousands
(`experiments/identification/sampling.py` has those)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.identification.fit import Problem
from support.measured_sail import sail, with_model

blackjax = pytest.importorskip("blackjax")
pytestmark = pytest.mark.nightly

T = np.linspace(0.5, 6.0, 25)
K, N, U = "solar_wind.thrust_factor", "solar_wind.number_density", "solar_wind.speed"
PRIORS = {N: (7.3e6, 0.3 * 7.3e6), U: (4e5, 0.1 * 4e5)}
CHAINS, WARM_UP, DRAWS = 4, 50, 1000


def product(p):
    """A slope that is proportional to k sqrt(n) u, as the thrust is."""
    return p[0] * jnp.sqrt(p[1] / 7.3e6) * p[2] / 4e5 * jnp.asarray(T)


def line(p):
    """A straight line whose height, slope and curvature are free."""
    return p[0] + p[1] * jnp.asarray(T) + p[2] * jnp.asarray(T**2)


def problem_of(model, truth, free, deviation, priors=None):
    """The problem with noise of one seed."""
    noise = deviation * np.random.default_rng(5).standard_normal(len(T))
    data = {"time": T, "kinetic_energy": np.asarray(model(jnp.array(truth))) + noise}
    return with_model(Problem.of(sail(), data, free, {"kinetic_energy": deviation}, priors), model)


def draws_of(problem, model, fit, logarithms):
    """Draws (chain, draw, parameter) of exp(-chi squared / 2), flat in the parameters, in coordinates of
    which the fit says that they have deviations of 1: the logarithms of the parameters, or these."""
    (cells,) = problem.cells
    slope = fit.values if logarithms else np.ones(len(fit.values))
    centre = np.log(fit.values) if logarithms else fit.values
    scale = np.linalg.cholesky(fit.covariance / np.outer(slope, slope))

    def parameters(z):
        x = centre + scale @ z
        return jnp.exp(x) if logarithms else x

    def log_density(z):
        p = parameters(z)
        chi = (((model(p) - cells.values) / cells.deviations) ** 2).sum()
        chi += sum(((p[k] - prior.mean) / prior.sd) ** 2 for k, prior in problem.priors.items())
        return -0.5 * chi + (jnp.log(p).sum() if logarithms else 0.0)

    count = len(fit.values)
    nuts = blackjax.nuts(log_density, 0.9, jnp.ones(count))

    @jax.jit
    def chain(key, start):
        def step(state, key):
            state, info = nuts.step(key, state)
            return state, (parameters(state.position), info.is_divergent)

        return jax.lax.scan(step, nuts.init(start), jax.random.split(key, WARM_UP + DRAWS))[1]

    starts = 2.0 * jax.random.normal(jax.random.key(1), (CHAINS, count))
    found = [chain(*one) for one in zip(jax.random.split(jax.random.key(2), CHAINS), starts, strict=True)]
    x, divergent = (np.stack([np.asarray(one[k])[WARM_UP:] for one in found]) for k in (0, 1))
    assert not divergent.any()
    assert (np.asarray(blackjax.rhat(x)) < 1.01).all()
    return x


def test_deviations_of_a_straight_line_are_those_of_the_draws():
    """The posterior is normal. Within four errors of sampling: sd / sqrt(ESS) of a mean and
    sd / sqrt(2 ESS) of a deviation, with at least 1000 draws that count."""
    free = ("bias.kinetic_energy", "hub.torque[1]", "hub.torque[2]")
    problem = problem_of(line, [2.0, -0.7, 0.1], free, 0.5)
    fit = problem.solved()
    assert not fit.warnings
    x = draws_of(problem, line, fit, logarithms=False)
    size = np.asarray(blackjax.ess_bulk(x))
    assert (size > 1000.0).all()
    sd = x.std(axis=(0, 1), ddof=1)
    assert (np.abs(x.mean((0, 1)) - fit.values) < 4.0 * fit.sd / np.sqrt(size)).all()
    np.testing.assert_allclose(sd / fit.sd, 1.0, rtol=4.0 / np.sqrt(2.0 * size.min()))


def test_a_profile_is_nearer_to_the_draws_than_the_error_bar_of_a_bent_posterior():
    """Data that know k sqrt(n) u to 0.1 %, and priors of 30 % and 10 %: the fit says that errors are not
    normal, and both ends of the profile of k lie nearer to the 16 and 84 % of the draws than one standard
    deviation does. These lie higher than the profile has them: a density that is flat in k weighs n and u
    with 1/(sqrt(n) u), and a least chi squared knows no such weight. Flat in ln k, which is weights of 1/k,
    the profile is off by 0.04 and 0.09 deviations and the error bar by 0.19 and 0.33; an error of sampling
    is 0.03."""
    problem = problem_of(product, [0.18, 7.3e6, 4e5], (K, N, U), 2e-3, PRIORS)
    fit = problem.solved()
    assert all(words.startswith("The errors are not those of a normal") for words in fit.warnings)
    assert fit.warnings
    k = draws_of(problem, product, fit, logarithms=True)[..., 0].ravel()
    bar, profile = fit["solar_wind.thrust_factor"] + fit.sd[0] * np.array([-1.0, 1.0]), fit.profile(K)
    ends = np.quantile(k, [0.1587, 0.8413])
    assert (np.abs(profile - ends) < 0.8 * np.abs(bar - ends)).all()
    order = np.argsort(k)
    share = np.cumsum(1.0 / k[order]) / (1.0 / k).sum()
    logarithmic = np.interp([0.1587, 0.8413], share, k[order])
    assert (np.abs(profile - logarithmic) < 0.6 * np.abs(bar - logarithmic)).all()
