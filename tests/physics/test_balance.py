"""The warning about an energy balance that does not close."""

import numpy as np
import pytest

import esail_jax as esail
from esail_jax.observables.balance import balance_warning

SOUND = {
    "kinetic_energy": np.array([1e4, 1e4 + 5.0]),
    "elastic_energy": np.array([1.0, 1.0]),
    "external_work": np.array([0.0, 5.0]),
    "dissipated_energy": np.array([0.0, 1e-3]),
    "energy_balance_error": np.array([0.0, 4e-3]),
}
"""A balance that closes. The work is 5 J, and the accepted error a thousandth of it."""


def test_a_sound_balance_says_nothing():
    assert balance_warning(SOUND) == ""
    assert balance_warning({"energy_error": np.array([0.0, 9e-4])}) == ""


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (SOUND | {"energy_balance_error": np.array([0.0, -6e-3])}, "off by 6.0e-03 J"),
        (SOUND | {"energy_balance_error": np.array([0.0, 6e-3, np.nan])}, "off by 6.0e-03 J"),
        ({"energy_error": np.array([0.0, 2e-3])}, "2.0e-03 of the energy"),
    ],
)
def test_a_balance_that_is_off_says_so(rows, said):
    """The warning does not depend on the sign, and ignores rows after a failure, which are NaN."""
    assert said in balance_warning(rows)


@pytest.mark.nightly
def test_energy_that_is_dissipated_or_supplied_is_not_missing():
    """Rows of a chain with damping: its energy falls, and its balance holds."""
    assert balance_warning(SOUND | {"energy_error": np.array([0.0, 0.3])}) == ""
    settings = {"integrator.t_end": 0.3, "output.interval": 0.1, "chain.rods": 3}
    settings |= {"chain.axial_damping_time": 1e-3, "initial.rod_vector": [1.0, 0.0, 0.0]}
    run = esail.simulate("hanging-chain", settings)
    assert run["energy_error"][-1] < -0.1 and run.stats["message"] == ""


def test_rounding_is_not_a_loss():
    """A rounding error of 1e-10 of the energy causes no warning if no work is done."""
    still = dict.fromkeys(SOUND, np.zeros(2))
    still["kinetic_energy"], still["energy_balance_error"] = np.full(2, 1e4), np.array([0.0, 1e-6])
    assert balance_warning(still) == ""


@pytest.mark.nightly
def test_a_run_with_too_long_a_step_says_so(tmp_path):
    """Steps of 0.3 rad of spin lose more than a thousandth of the wind's work, which causes a warning.

    The run is complete, and the warning is the same in Python and in the file.
    """
    overrides = {
        "tethers.count": 3, "tethers.elements": 2, "integrator.method": "generalized-alpha",
        "integrator.step": 80.0, "integrator.t_end": 4000.0, "output.interval": 4000.0,
    }  # fmt: skip
    solution = esail.simulate("baseline", overrides)
    assert "energy balance is off" in solution.stats["message"]
    assert solution.stats["rejected_steps"] > 0  # repeated steps are saved like others
    esail.save(solution, tmp_path / "run.h5")
    again = esail.load(tmp_path / "run.h5")
    assert again.stats["status"] == "complete" and "energy balance is off" in again.stats["message"]
