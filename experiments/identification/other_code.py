"""Fits to the telemetry of another code, Exudyn (`independent/exudyn_run.py`): are they unbiased?"""

import numpy as np
from common import HERE, table

import esail_jax as esail
from esail_jax.identification.fit import Problem

FOLDER = HERE / "independent"
FREE = ["solar_wind.thrust_factor", "tethers.length", "hub.density"]
NOISE = {"angular_velocity_B": 1e-6, "tip_direction_B": 1e-4}
START = np.array([1.05, 0.998, 1.02])
"""Where fits start, as a multiple of the truth."""
SEEDS = 20


def main():
    scene = esail.load_scene(str(FOLDER / "sail.toml"))
    problem = Problem.of(scene, str(FOLDER / "telemetry.csv"), FREE, NOISE)
    truth = np.array([p.start for p in problem.parameters])
    (cells,) = problem.cells
    exact = problem.solved(truth * START)
    away = problem.models[0](truth).values - cells.values
    for name in NOISE:
        print(f"largest difference of {name}: {abs(away[np.array(cells.name) == name]).max():.2e}")
    squares = ((away / cells.deviations) ** 2).sum()
    print(f"sum of the squared differences, in units of the noise: {squares:.2e}")
    fits = []
    for seed in range(SEEDS):
        noise = cells.deviations * np.random.default_rng(seed).normal(size=cells.values.shape)
        fits.append(problem.with_values([cells.values + noise]).solved(truth * START))
    pulls = np.array([(fit.values - truth) / fit.sd for fit in fits])
    chi = np.array([fit.chi_squared for fit in fits])
    table(HERE / "other_code.csv", [
        {
            "parameter": name, "truth": truth[k], "sd": np.mean([fit.sd[k] for fit in fits]),
            "bias without noise, in sd": (exact.values[k] - truth[k]) / exact.sd[k],
            "mean pull": pulls[:, k].mean(), "sd of pulls": pulls[:, k].std(ddof=1),
            "largest pull": abs(pulls[:, k]).max(),
        }
        for k, name in enumerate(problem.names)
    ])  # fmt: skip
    freedom = fits[0].degrees_of_freedom
    print(f"{SEEDS} fits, 2/sqrt({SEEDS}) = {2.0 / np.sqrt(SEEDS):.3f}")
    print(f"chi squared {chi.mean():.1f} +- {chi.std(ddof=1):.1f}, {chi.min():.0f} to {chi.max():.0f}")
    print(f"degrees of freedom {freedom}, deviation expected {np.sqrt(2.0 * freedom):.1f}")
    print(f"fits with a warning: {sum(bool(fit.warnings) for fit in fits)}")
