"""Computations behind the figures: units, and power spectra compared with that of a sine."""

import numpy as np
import pytest

from esail_jax.plotting.data import power_spectrum, readable


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([12345.0, -2.0], (1e-3, "kN")),
        ([-999.0, np.nan], (1.0, "N")),
        ([0.02, np.inf], (1e3, "mN")),
        ([3e-5], (1e6, r"$\mu$N")),
        ([0.0], (1.0, "N")),
    ],
)
def test_units_suit_the_largest_value(values, expected):
    factor, unit = readable("N", np.array([0.0]), np.array(values))
    assert (pytest.approx(factor), unit) == expected


def test_spectrum_peaks_where_the_sine_is_and_holds_its_power():
    """The spectrum of 50 whole periods, 500 samples, ignores the shorter last interval."""
    time = np.append(np.arange(500) * 2.0, 999.0)
    signal = 3.0 + 0.2 * np.sin(2.0 * np.pi * 0.05 * time)
    frequency, density = power_spectrum(time, signal)
    assert frequency[np.argmax(density)] == pytest.approx(0.05, rel=1e-12)
    assert density.sum() * frequency[0] == pytest.approx(0.5 * 0.2**2, rel=1e-9)
    assert np.sort(density)[-2] < 1e-12 * density.max()


def test_no_spectrum_of_short_or_constant_signals():
    time = np.arange(20.0)
    assert power_spectrum(time[:7], time[:7]) is None
    assert power_spectrum(time, np.full(20, 0.1)) is None
    assert power_spectrum(time, np.zeros(20)) is None
    assert power_spectrum(time, np.where(time < 5.0, time, np.nan)) is None
