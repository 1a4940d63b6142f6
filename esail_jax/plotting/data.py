"""What the figures take from a run: observables that may be absent, numbers per tether, spectra."""

from typing import Any

import numpy as np
from scipy.signal import periodogram

from esail_jax.observables.saved_rows import leading_finite

DEGREES = 180.0 / np.pi
"""In a radian."""

KILOMETRE = 1e3
"""[m]"""

PREFIXES = ((1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, r"$\mu$"))
"""Of units, by size, the largest first."""

LEAST_SAMPLES = 8
"""Samples below which a spectrum says nothing."""

ROUNDING = 1e-13
"""Variation, relative to the largest value, below which a signal is constant."""


def change(values: np.ndarray | None) -> np.ndarray | None:
    """Values less the first."""
    return None if values is None else values - values[0]


def spin_period(run: Any) -> float | None:
    """T_s [s]; None without spin."""
    rate = abs(float(run.scene.initial.spin_rate))
    return 2.0 * np.pi / rate if rate > 0.0 else None


def orbital_period(run: Any) -> float | None:
    """Of the orbit that the scene is on [s]; None without one."""
    orbit = run.scene.orbit
    return None if orbit is None else 2.0 * np.pi / float(orbit.mean_motion)


def readable(unit: str, *signals: np.ndarray) -> tuple[float, str]:
    """A factor and the name of the multiple of an SI unit in which the largest value of the signals is
    neither long nor a small fraction."""
    largest = max(np.abs(signal[np.isfinite(signal)]).max(initial=0.0) for signal in signals)
    for size, prefix in PREFIXES:
        if largest >= size:
            return 1.0 / size, prefix + unit
    return 1.0, unit


def power_spectrum(times: np.ndarray, signal: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Frequencies [Hz] above zero and one-sided power spectral density [signal^2/Hz] of the signal
    less its mean. None for a short or constant signal.

    The last saved interval may be shorter than the others and is left out.
    """
    known = leading_finite(signal)
    if known > 2:
        steps = np.diff(times[:known])
        known -= not np.isclose(steps[-1], steps[0], rtol=1e-6)
    if known < LEAST_SAMPLES:
        return None
    signal = np.asarray(signal)[:known]
    if np.ptp(signal) <= ROUNDING * np.abs(signal).max():
        return None
    sampling = 1.0 / (times[1] - times[0])
    frequency, density = periodogram(signal, fs=sampling, detrend="constant")
    return frequency[1:], density[1:]
