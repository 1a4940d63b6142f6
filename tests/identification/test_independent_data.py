"""Fits to what another multibody code, Exudyn, has computed for a small sail
(`experiments/identification/independent/`)."""

from pathlib import Path

import numpy as np
import pytest

import esail_jax as esail
from esail_jax.identification.fit import Problem

FOLDER = Path(__file__).parents[2] / "experiments" / "identification" / "independent"
FREE = ("solar_wind.thrust_factor", "tethers.length", "hub.density")
NOISE = {"angular_velocity_B": 1e-6, "tip_direction_B": 1e-4}


@pytest.mark.nightly
def test_numbers_of_another_code_are_found(validate):
    """Without noise the estimates are off by less than a hundredth of their deviations, so that no error of
    the model is seen beside the noise. With noise they lie within three deviations, and chi squared within
    four of its own."""
    scene = esail.load_scene(str(FOLDER / "sail.toml"))
    problem = Problem.of(scene, str(FOLDER / "telemetry.csv"), FREE, NOISE)
    truth = np.array([p.start for p in problem.parameters])
    (cells,) = problem.cells
    noise = cells.deviations * np.random.default_rng(0).normal(size=cells.values.shape)
    noisy = problem.with_values([cells.values + noise]).solved(truth * [1.05, 0.998, 1.02])
    assert (np.abs(noisy.values - truth) < 3.0 * noisy.sd).all()
    freedom = noisy.degrees_of_freedom
    assert abs(noisy.chi_squared - freedom) < 4.0 * np.sqrt(2.0 * freedom)
    assert not noisy.warnings
    exact = problem.solved()
    error = np.abs((exact.values - truth) / exact.sd).max()
    validate(
        "IDF-3", "three numbers fitted to a run of Exudyn without noise", "numbers of that run",
        "worst estimate / standard deviation", error, 1e-2,
    )  # fmt: skip
