"""Posteriors of two fits by Hamiltonian Monte Carlo (NUTS of blackjax), beside the fit's normal
distribution and its profiles.

    log p(x | y) = -(1/2) (sum of squared residuals of data and priors) + constant

is the density that `fit` maximises, flat where it has no prior.
"""

import jax
import jax.numpy as jnp
import numpy as np
from common import HERE, Timer, small, table
from matplotlib.figure import Figure
from scipy import special

import esail_jax as esail
from esail_jax.identification.fit import Problem
from esail_jax.identification.model import jacobian_of, steps_with_room

K, N, U = "solar_wind.thrust_factor", "solar_wind.number_density", "solar_wind.speed"
SHORT = {
    "tethers.elements": 1, "integrator.t_end": 60.0, "integrator.tolerance": 1e-6,
    "output.interval": 2.5,
}  # fmt: skip
"""The small sail with one element per tether over a minute: a derivative takes 30 ms."""
NOISE = {"spin_rate[1]": 1e-6, "tip_direction_B": 1e-4}
CASES = {
    "bent": ([K, N, U], {N: (7.3e6, 0.3 * 7.3e6), U: (4e5, 0.1 * 4e5)}),
    "straight": ([K, "initial.spin_rate"], None),
}
"""Free parameters and priors. The data know k sqrt(n) u to 0.5 %, the priors n to 30 %
and u to 10 %."""
CHAINS, WARM_UP, DRAWS = 4, 50, 250
STEP = 0.8
"""Of the leapfrog method, in standard deviations of the fit: adaptation has nothing to do."""
LEVELS = special.ndtr([-1.0, 0.0, 1.0])
"""15.9, 50 and 84.1 %: mean and one deviation on either side, of a normal distribution."""


def problem_of(free, priors):
    """The problem with the run of the scene and noise for data."""
    scene, random = small(SHORT), np.random.default_rng(2026)
    times = np.arange(2.5, 60.1, 2.5)
    run = esail.simulate(scene, save=("spin_rate", "tip_direction_B"), times=times.tolist())
    exact = {
        "spin_rate[1]": np.asarray(run["spin_rate"])[:, 0],
        "tip_direction_B": np.asarray(run["tip_direction_B"]),
    }
    data = {name: x + NOISE[name] * random.normal(size=x.shape) for name, x in exact.items()}
    return Problem.of(scene, {"time": times, **data}, free, NOISE, priors)


class Posterior:
    """The density of a problem's parameters p in coordinates z with p = g(centre + scale z). g is the
    exponential function for numbers that must be positive, so that no step leaves their bounds. centre and
    scale are those of the fit, so that z has deviations of about 1."""

    def __init__(self, problem, fit):
        (cells,) = problem.cells
        self.positive = jnp.array([p.low >= 0.0 for p in problem.parameters])
        slope = np.where(self.positive, fit.values, 1.0)
        self.centre = jnp.where(self.positive, jnp.log(fit.values), fit.values)
        self.scale = jnp.linalg.cholesky(fit.covariance / np.outer(slope, slope))
        room = steps_with_room(problem.scene, cells)
        both = jacobian_of(problem.scene, problem.parameters, cells, room)

        def half(p):
            """Half of the squares of the residuals, and its gradient, by forward mode."""
            shown, jacobian = both(p)
            r = (shown - cells.values) / cells.deviations
            value, slope = 0.5 * r @ r, (r / cells.deviations) @ jacobian
            for k, (mean, sd) in problem.priors.items():
                value += 0.5 * ((p[k] - mean) / sd) ** 2
                slope = slope.at[k].add((p[k] - mean) / sd**2)
            return value, slope

        @jax.custom_vjp
        def squares(p):
            return half(p)[0]

        squares.defvjp(half, lambda slope, cotangent: (cotangent * slope,))
        self.squares = squares

    def parameters(self, z):
        x = self.centre + self.scale @ z
        return jnp.where(self.positive, jnp.exp(x), x)

    def log_density(self, z):
        """Of z; minus infinity where the run fails."""
        x = self.centre + self.scale @ z
        value = -self.squares(self.parameters(z)) + jnp.where(self.positive, x, 0.0).sum()
        return jnp.where(jnp.isfinite(value), value, -jnp.inf)


def sampled(posterior, chains=CHAINS, warm_up=WARM_UP, draws=DRAWS):
    """Draws (chain, draw, parameter) of chains that start at random by the fit's normal distribution, and
    what the sampler says of them: acceptance of every chain, divergences, evaluations. (A chain that began
    at a density of eight deviations of its prior stayed there: the step is too long for its slopes.)"""
    import blackjax

    count = len(posterior.centre)
    nuts = blackjax.nuts(posterior.log_density, STEP, jnp.ones(count))

    @jax.jit
    def chain(key, start):
        def step(state, key):
            state, info = nuts.step(key, state)
            kept = (posterior.parameters(state.position), info.acceptance_rate, info.is_divergent,
                    info.num_integration_steps)  # fmt: skip
            return state, kept

        return jax.lax.scan(step, nuts.init(start), jax.random.split(key, warm_up + draws))[1]

    keys = jax.random.split(jax.random.key(2026), chains)
    starts = jax.random.normal(jax.random.key(11), (chains, count))
    found = [jax.tree.map(np.asarray, chain(*one)) for one in zip(keys, starts, strict=True)]
    x, acceptance, divergent, steps = (np.stack(part) for part in zip(*found, strict=True))
    after = np.s_[:, warm_up:]
    return x[after], acceptance[after].mean(1), int(divergent[after].sum()), int(steps.sum())


def in_closed_form(product):
    """Quantiles of k, n and u if the product k sqrt(n) u, as k at the means of n and u, were known exactly:
    of weights on a grid of n and u. A density that is flat in k has the factor 1 / (sqrt(n) u) there."""
    (n, sn), (u, su) = CASES["bent"][1].values()
    x, y = np.meshgrid(np.linspace(1e-3, 3.0, 3000), np.linspace(0.3, 1.7, 701), indexing="ij")
    weight = np.exp(-0.5 * (((x - 1.0) * n / sn) ** 2 + ((y - 1.0) * u / su) ** 2)) / (np.sqrt(x) * y)
    values = (product / (np.sqrt(x) * y), n * x, u * y)
    return [quantiles(one.ravel(), weight.ravel()) for one in values]


def quantiles(values, weights):
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    return np.interp(LEVELS, (share - 0.5 * weights[order]) / share[-1], values[order])


def compared(case):
    """Rows of the table of a case, its fit and its draws."""
    import blackjax

    problem = problem_of(*CASES[case])
    fit = problem.solved()
    profiles = [fit.profile(name) for name in problem.names]
    print(fit, profiles, flush=True)
    timer = Timer()
    x, acceptance, divergent, steps = sampled(Posterior(problem, fit))
    print(
        f"{case}: acceptance {acceptance.round(2)}, divergences {divergent}, runs with derivatives {steps}"
    )
    print(f"{timer.read()[0]:.0f} s, {timer.read()[1]:.0f} s of the process", flush=True)
    bulk, tail, rhat = blackjax.ess_bulk(x), blackjax.ess_tail(x), blackjax.rhat(x)
    rows = []
    for k, name in enumerate(problem.names):
        low, middle, high = np.quantile(x[..., k], LEVELS)
        rows.append({
            "case": case, "parameter": name, "mean": x[..., k].mean(), "sd": x[..., k].std(ddof=1),
            "sd of the fit / sd": fit.sd[k] / x[..., k].std(ddof=1),
            "16 %": low, "50 %": middle, "84 %": high, "estimate": fit.values[k],
            "estimate - sd": fit.values[k] - fit.sd[k], "estimate + sd": fit.values[k] + fit.sd[k],
            "profile, low": profiles[k][0], "profile, high": profiles[k][1],
            "ESS, bulk": f"{bulk[k]:.0f}", "ESS, tail": f"{tail[k]:.0f}", "R-hat": f"{rhat[k]:.4f}",
        })  # fmt: skip
    return rows, fit, x


def main():
    rows, drawn = [], {}
    for case in CASES:
        more, fit, x = compared(case)
        rows += more
        drawn[case] = (more, fit, x)
        table(HERE / "sampling.csv", rows)
    (rows, fit, x) = drawn["bent"]
    k = x[..., 0].ravel()
    product = k * np.sqrt(x[..., 1].ravel() / 7.3e6) * x[..., 2].ravel() / 4e5
    print(f"k sqrt(n) u: {product.mean():.6f} +- {100.0 * product.std() / product.mean():.3f} %")
    print("in closed form:", *(q.round(5) for q in in_closed_form(product.mean())))
    print("k, flat in ln k:", quantiles(k, 1.0 / k).round(5))
    picture(rows, fit, x.reshape(-1, 3))


def picture(rows, fit, x):
    """The draws of k and n with the fit's ellipse, and the marginal density of k with the intervals."""
    figure = Figure((10.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    ellipse = np.linalg.cholesky(fit.covariance[:2, :2]) @ np.stack([np.cos(angle), np.sin(angle)])
    left.plot(x[:, 1], x[:, 0], ".", markersize=2, alpha=0.4, label="draws")
    left.plot(*(fit.values[1::-1, None] + ellipse[::-1]), "k-", label="fit: one standard deviation")
    left.set(xlabel="number_density [1/m^3]", ylabel="thrust_factor", ylim=(0.05, 0.5))
    left.legend(fontsize=8)
    right.hist(
        x[:, 0], bins=np.linspace(0.05, 1.5, 117), density=True, color="tab:blue", alpha=0.6, label="draws"
    )
    grid = np.linspace(0.05, 0.5, 300)
    density = np.exp(-0.5 * ((grid - fit.values[0]) / fit.sd[0]) ** 2) / (fit.sd[0] * np.sqrt(2.0 * np.pi))
    right.plot(grid, density, "k-", label="fit")
    row = rows[0]
    top = right.get_ylim()[1]
    for height, colour, label, ends in (
        (0.95, "tab:blue", "68 %, draws", ("16 %", "84 %")),
        (0.90, "k", "68 %, fit", ("estimate - sd", "estimate + sd")),
        (0.85, "tab:orange", "68 %, profile", ("profile, low", "profile, high")),
    ):
        right.plot([row[end] for end in ends], [height * top] * 2, "|-", color=colour, label=label)
    right.set(xlabel="thrust_factor", ylabel="density", xlim=(0.05, 0.5))
    right.legend(fontsize=8)
    figure.savefig(HERE / "sampling.png", dpi=80)
