"""Two hundred fits to the same run with other noise: do the error bars hold what they promise?"""

import numpy as np
from common import HERE, NOISE, Timer, small, table
from matplotlib.figure import Figure
from scipy import stats

from esail_jax.identification.fit import Problem
from esail_jax.identification.information import planned

REPEATS = 200
FREE = (
    "solar_wind.thrust_factor", "tethers.length", "hub.torque[1]", "hub.inertia[1,1]", "bias.spin_rate[1]",
    "misalignment.tip_direction_B[1]",
)  # fmt: skip
FIRST = np.array([1.05, 1.001, 0.0, 1.02, 1.0, 1.0])
"""Where the fits start, as a multiple of the truth."""
SHIFT = np.array([0.0, 0.0, 0.0, 0.0, 1e-6, 1e-3])
"""Truth of the instruments: a bias of a micro-radian per second, a camera turned by a milliradian."""


def problem_without_data(scene):
    """The problem with zeros for data, and the true values."""
    cells, parameters = planned(scene, list(FREE), NOISE, None)
    zeros = {"time": np.array(cells.times)}
    shapes = {"angular_velocity_B": (3,), "tip_direction_B": (3, 3), "spin_rate[1]": ()}
    zeros |= {name: np.zeros((len(cells.times), *shape)) for name, shape in shapes.items()}
    problem = Problem.of(scene, zeros, list(FREE), NOISE)
    return problem, np.array([p.start for p in parameters]) + SHIFT


def main():
    timer = Timer()
    problem, truth = problem_without_data(small())
    (cells,), (model,) = problem.cells, problem.models
    exact = model(truth).values
    compiling = timer.read()
    random, timer = np.random.default_rng(2026), Timer()
    fits = []
    for _ in range(REPEATS):
        values = exact + cells.deviations * random.normal(size=exact.shape)
        fits.append(problem.with_values([values]).solved(truth * FIRST))
    wall, process = timer.read()
    print(f"compiling {compiling[0]:.0f} s, {compiling[1]:.0f} s of the process")
    print(f"{REPEATS} fits {wall:.0f} s, {process:.0f} s of the process")
    pulls = np.array([(f.values - truth) / f.sd for f in fits])
    rows = []
    for k, name in enumerate(problem.names):
        rows.append({
            "parameter": name, "truth": truth[k], "sd": np.mean([f.sd[k] for f in fits]),
            "mean pull": pulls[:, k].mean(), "sd of pulls": pulls[:, k].std(ddof=1),
            "within 68 % [%]": 100.0 * (abs(pulls[:, k]) < stats.norm.ppf(0.84134)).mean(),
            "within 95 % [%]": 100.0 * (abs(pulls[:, k]) < stats.norm.ppf(0.975)).mean(),
            "p of Kolmogorov-Smirnov": stats.kstest(pulls[:, k], "norm").pvalue,
        })  # fmt: skip
    chi, freedom = np.array([f.chi_squared for f in fits]), fits[0].degrees_of_freedom
    band = stats.norm.ppf(0.995) * np.sqrt(2.0 * freedom / REPEATS)
    table(HERE / "coverage.csv", rows)
    table(HERE / "chi_squared.csv", [{
        "fits": REPEATS, "degrees of freedom": freedom, "mean chi squared": f"{chi.mean():.1f}",
        "99 % band of the mean": f"{freedom - band:.1f} to {freedom + band:.1f}",
        "sd": chi.std(ddof=1), "sd expected": np.sqrt(2.0 * freedom),
        "p of Kolmogorov-Smirnov": stats.kstest(chi, "chi2", (freedom,)).pvalue,
        "fits with a warning": sum(bool(f.warnings) for f in fits),
        "runs with derivatives per fit": np.mean([f.evaluations for f in fits]),
        "seconds of the process per fit": process / REPEATS,
    }])  # fmt: skip
    figure = Figure((10.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    grid = np.linspace(-3.5, 3.5, 200)
    for k, name in enumerate(problem.names):
        left.step(
            np.sort(pulls[:, k]),
            np.arange(1, REPEATS + 1) / REPEATS,
            where="post",
            label=name,
            linewidth=0.9,
        )
    left.plot(grid, stats.norm.cdf(grid), "k--", label="normal distribution", linewidth=1.2)
    left.set(
        xlabel="(estimate - truth) / standard deviation", ylabel="share of the fits below", xlim=(-3.5, 3.5)
    )
    left.legend(fontsize=7)
    right.hist(chi, bins=24, density=True, color="tab:blue", alpha=0.6)
    grid = np.linspace(*stats.chi2.ppf([1e-3, 0.999], freedom), 200)
    right.plot(
        grid, stats.chi2.pdf(grid, freedom), "k--", linewidth=1.2, label=f"{freedom} degrees of freedom"
    )
    right.set(xlabel="chi squared at the estimate", ylabel="density")
    right.legend(fontsize=8)
    figure.savefig(HERE / "coverage.png", dpi=80)
