"""Runs and measures behind the statements."""

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np
from kept_runs import CASES, ELEMENTS, MODELS, PAPERS_METHOD, case_run, kept_run, model_run
from signals import DEGREES, norm, peak_frequency, power_spectrum

SPIN = 4e-3 / (2.0 * np.pi)
"""Frequency of the spin [Hz]."""

TIMES = Path(__file__).parents[1] / "pgv_convergence" / "run_times.csv"


class Runs(NamedTuple):
    """All runs: by model and number of elements, by case, and two more for the start."""

    models: dict
    cases: dict
    printed_start: object
    still: object
    times: dict


def all_runs() -> Runs:
    """All runs, from their files if there are any."""
    models = {(model, n): model_run(model, n) for model in MODELS for n in ELEMENTS}
    cases = {case: case_run(case) for case in CASES}
    printed = kept_run("printed-start", "voltage-off", PAPERS_METHOD | {"initial.elongation": "paper"})
    with open(TIMES, encoding="utf-8") as file:
        times = {
            (row["model"], int(row["elements"])): float(row["seconds"]) for row in csv.DictReader(file)
        }
    return Runs(models, cases, printed, cases["voltage-off"], times)


def thrust(run) -> float:
    """The mean thrust [N]."""
    return norm(run["thrust_O"]).mean()


def thrust_angle(run) -> float:
    """The mean thrust angle [deg]."""
    return DEGREES * np.asarray(run["thrust_angle"]).mean()


def strain_of_first(run) -> float:
    """The largest strain of tether 1."""
    return np.asarray(run["max_axial_strain"])[:, 0].max()


def change(measure, runs: Runs, model: str, n: int) -> float:
    """The relative change of a measure from nine cables to this model."""
    return measure(runs.models[model, n]) / measure(runs.models["cable", max(ELEMENTS)]) - 1.0


def run_time(runs: Runs, model: str, n: int) -> float:
    """The processor time of a run [s], from run_times.csv."""
    return runs.times[model, n]


def rms_error(runs: Runs, model: str, n: int, component: int) -> float:
    """The rms difference of an angular rate from nine cables, relative to its range."""
    mine, true = (
        np.asarray(r["angular_velocity_B"])[:, component]
        for r in (runs.models[model, n], runs.models["cable", max(ELEMENTS)])
    )
    return float(np.sqrt(np.mean((mine - true) ** 2)) / np.ptp(true))


def line_of_spin(run) -> float:
    """The frequency [Hz] of the strongest oscillation of the hub's spin rate."""
    return peak_frequency(run, run["angular_velocity_B"][:, 0], 2e-3, 0.02)


def swing_of_spin(run) -> float:
    """The range of the hub's spin rate [rad/s]."""
    return float(np.ptp(run["angular_velocity_B"][:, 0]))


def density_at(run, signal, frequency: float) -> float:
    """The largest spectral density of a signal within 15 % of a frequency."""
    found, density = power_spectrum(np.asarray(run.time), np.asarray(signal))
    near = np.abs(found / frequency - 1.0) < 0.15
    return float(density[near].max())


def prominence(run, signal, frequency: float) -> float:
    """How far a signal's spectrum stands out at a frequency.

    It is the largest density within 15 % of the frequency over the median density from 0.4 to 2.5 times the
    frequency, these 15 % left out."""
    found, density = power_spectrum(np.asarray(run.time), np.asarray(signal))
    ratio = found / frequency
    near, around = np.abs(ratio - 1.0) < 0.15, (ratio > 0.4) & (ratio < 2.5)
    return float(density[near].max() / np.median(density[around & ~near]))
