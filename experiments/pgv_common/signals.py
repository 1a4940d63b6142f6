"""Signals that the figures and the statements share: time in spin periods, norms, spectra."""

from typing import Any

import numpy as np

from esail_jax.plotting.data import DEGREES, power_spectrum, spin_period

__all__ = ["DEGREES", "norm", "peak_frequency", "per_period", "power_spectrum", "spin_period", "turns"]


def turns(run: Any) -> np.ndarray:
    """The saved instants in spin periods."""
    return np.asarray(run.time) / spin_period(run)


def norm(vectors: Any) -> np.ndarray:
    """The norms of vectors (time, 3)."""
    return np.linalg.norm(np.asarray(vectors), axis=-1)


def peak_frequency(run: Any, signal: np.ndarray, above: float = 0.0, below: float = np.inf) -> float:
    """The frequency [Hz] of the largest value of the spectrum of a signal within a band.

    The maximum of a parabola through the logarithms of the three highest values is taken, so that the
    result is finer than the spacing of the spectrum. A Hann window keeps the neighbours of a strong line
    out of the band.
    """
    times = np.asarray(run.time)
    uniform = int(np.isclose(np.diff(times), times[1] - times[0]).sum()) + 1
    window = np.hanning(uniform)
    part = np.asarray(signal)[:uniform]
    frequency, density = power_spectrum(times[:uniform], (part - part.mean()) * window)
    inside = np.flatnonzero((frequency >= above) & (frequency <= below))
    top = inside[np.argmax(density[inside])]
    if 0 < top < len(density) - 1:
        low, mid, high = np.log(density[top - 1 : top + 2])
        top += 0.5 * (low - high) / (low - 2.0 * mid + high)
    return float(np.interp(top, np.arange(len(frequency)), frequency))


def per_period(run: Any, signal: np.ndarray, measure: Any) -> np.ndarray:
    """A measure (such as np.ptp) of a signal within each whole spin period."""
    turn = turns(run)
    count = round(turn[-1])
    return np.array([measure(signal[(turn >= k) & (turn <= k + 1)]) for k in range(count)])
