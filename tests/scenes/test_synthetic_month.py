"""The synthetic month of `experiments/measured_wind`, as the package reads it."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import esail_jax as esail

FOLDER = Path(__file__).parents[2] / "experiments" / "measured_wind"
HOUR, MONTH = 3600.0, 30 * 86400.0


@pytest.fixture(scope="module")
def synthetic():
    """The module that makes the wind."""
    spec = importlib.util.spec_from_file_location("synthetic", FOLDER / "synthetic.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def read(synthetic, path, largest_gap, gaps=True):
    """The table [solar_wind] of a month in the written wind."""
    synthetic.write(path, gaps)
    changes = {"file": str(path), "largest_gap": largest_gap}
    changes = {f"solar_wind.{key}": value for key, value in changes.items()}
    changes |= {"initial.epoch": synthetic.EPOCH.isoformat(), "integrator.t_end": MONTH}
    return esail.load_scene("baseline", changes).solar_wind


def test_hours_with_fill_values_are_gaps_and_all_others_are_rows(synthetic, tmp_path):
    """An hour is placed at its middle. The longest gap, of eleven hours, lasts twelve from the row before
    to the row behind, and is refused if less is to be bridged."""
    wind = read(synthetic, tmp_path / "wind.dat", 12 * HOUR)
    hours = np.asarray(wind.time) / HOUR
    gaps = synthetic.MISSING + synthetic.DENSITY_MISSING
    lost = {first + k + 0.5 for first, count in gaps for k in range(count)}
    assert len(lost) == 31
    assert sorted({*(np.arange(722) - 0.5)} - lost) == hours.tolist()
    with pytest.raises(esail.SceneError, match="2027-03-27T16:30:00 to 2027-03-28T02:30:00"):
        read(synthetic, tmp_path / "wind.dat", 11 * HOUR)


def test_speed_and_density_are_those_of_a_wind_at_one_au(synthetic, tmp_path):
    """Mean and median, spread and anticorrelation of the month; and each shock is a jump of the speed and
    of the density from one hour to the next."""
    wind = read(synthetic, tmp_path / "whole.dat", HOUR, gaps=False)
    time, speed, density = (np.asarray(x) for x in (wind.time, wind.speed, wind.number_density))
    assert abs(speed.mean() - 430e3) < 10e3 and abs(np.median(density) - 5e6) < 0.3e6
    assert np.corrcoef(np.log(speed), np.log(density))[0, 1] < -0.3
    for shock in synthetic.SHOCKS:
        k = np.searchsorted(time, shock.hour * HOUR)
        assert speed[k] - speed[k - 1] > 0.8e3 * shock.jump
        assert density[k] / density[k - 1] > 2.0
