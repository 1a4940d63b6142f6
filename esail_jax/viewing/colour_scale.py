"""The colours of lines: a scale that is readable on a white and on a black ground."""

import numpy as np

STOPS = ("#3f63d8", "#2490bf", "#259a6a", "#b8860b", "#d9541e", "#c2267a")
"""Colours from the smallest value to the largest, equally spaced."""

NONE = "#8a8f98"
"""Colour of a line that has no value."""

EQUAL = 1e-9
"""A range counts as a single value if its width is at most this part of its largest value."""


def colours_of(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """The colours (..., 3), each 0 to 255, of values between `low` and `high`; NaN has NONE."""
    stops = np.array([channels(stop) for stop in STOPS], float)
    width = high - low
    share = np.clip((values - low) / width, 0.0, 1.0) if width > 0.0 else np.full(np.shape(values), 0.5)
    place = np.where(np.isfinite(values), share, 0.0) * (len(stops) - 1)
    first = np.minimum(place.astype(int), len(stops) - 2)
    part = (place - first)[..., None]
    mixed = (1.0 - part) * stops[first] + part * stops[first + 1]
    return np.where(np.isfinite(values)[..., None], mixed, channels(NONE))


def channels(colour: str) -> tuple[int, int, int]:
    """red, green and blue of a colour #rrggbb."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue


def locked_range(*signals: np.ndarray) -> tuple[float, float]:
    """The smallest and the largest finite value of all signals: twice the same if they differ by
    rounding only, and 0 if there is none."""
    finite = np.concatenate([signal[np.isfinite(signal)] for signal in signals])
    if not finite.size:
        return 0.0, 0.0
    low, high = float(finite.min()), float(finite.max())
    return (low, low) if high - low <= EQUAL * max(abs(low), abs(high)) else (low, high)
