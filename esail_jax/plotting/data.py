"""Data for the figures of a run: periods, readable units, spectra."""

from typing import Any, NamedTuple

import numpy as np
from scipy.signal import periodogram

from esail_jax.observables.saved_rows import leading_finite
from esail_jax.scenes.scene import releases

DEGREES = 180.0 / np.pi
"""Degrees in a radian."""

KILOMETRE = 1e3
"""Length of a kilometre [m]."""

PREFIXES = ((1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, r"$\mu$"))
"""Prefixes of units and their factors, the largest first."""

MOST_NUMBERED = 3
"""Largest number of released tethers that a legend names one by one."""

LEAST_SAMPLES = 8
"""Smallest number of samples for a spectrum."""

ROUNDING = 1e-13
"""A signal counts as constant if its range, relative to its largest value, is at most this."""


class Mark(NamedTuple):
    """An instant [s] that is marked in a figure: its label in the legend, None for none, and its colour."""

    time: float
    label: str | None
    colour: Any = "0.35"


def release_marks(run: Any) -> list[Mark]:
    """The instants of the run at which tethers are released. The first one has the label of all."""
    scene, time = run.scene, np.asarray(run.time)
    released = {t: tethers for t, tethers in releases(scene).items() if len(time) and t <= time[-1]}
    numbers = sorted(number for tethers in released.values() for number in tethers)
    named = f"tether{'s' * (len(numbers) > 1)} {', '.join(map(str, numbers))}"
    label = f"{named if len(numbers) <= MOST_NUMBERED else f'{len(numbers)} tethers'} released"
    return [Mark(t, None if k else label) for k, t in enumerate(released)]


def change(values: np.ndarray | None) -> np.ndarray | None:
    """Values minus the first one."""
    return None if values is None else values - values[0]


def spin_period(run: Any) -> float | None:
    """The spin period T_s [s]; None without spin."""
    rate = abs(float(run.scene.initial.spin_rate))
    return 2.0 * np.pi / rate if rate > 0.0 else None


def orbital_period(run: Any) -> float | None:
    """The period [s] of the scene's orbit; None without an orbit."""
    orbit = run.scene.orbit
    return None if orbit is None else 2.0 * np.pi / float(orbit.mean_motion)


def readable(unit: str, *signals: np.ndarray) -> tuple[float, str]:
    """A factor and the name of the SI multiple in which the largest value of the signals lies
    between 1 and 1000."""
    largest = max(np.abs(signal[np.isfinite(signal)]).max(initial=0.0) for signal in signals)
    for size, prefix in PREFIXES:
        if largest >= size:
            return 1.0 / size, prefix + unit
    return 1.0, unit


def power_spectrum(times: np.ndarray, signal: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """The frequencies [Hz] above zero and the one-sided power spectral density [signal^2/Hz] of the
    signal minus its mean; None for a short or constant signal.

    The last saved interval is left out if it is shorter than the others.
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
