"""Observables that may be plotted beside a moving picture."""

import numpy as np

from esail_jax.files.reading import SavedRun
from esail_jax.viewing.motion import Signal

NUMBERED = ("tether", "rod")
"""Axes whose entries are told by number, from 1."""

NEGLIGIBLE = 1e-9
"""Values below this part of the largest one of a signal are shown as zero: they are rounding errors."""

NAMES = {"xyz": "xyz", "angle": ""}
"""Names of the components of other axes; those of angles are in the symbol."""


def signals_of(run: SavedRun, frames: np.ndarray) -> dict[str, Signal]:
    """The observables with at most one axis beside time, at these saved instants. Those that are
    NaN throughout are left out."""
    signals = {}
    for name, values in run.rows.items():
        axes = run.about[name].axes
        if len(axes) > 1 or (axes and axes[0] not in (*NUMBERED, *NAMES)):
            continue
        columns = values[frames].reshape(len(frames), -1)
        if not np.isfinite(columns).any():
            continue
        symbol, unit = run.about[name].symbol, run.about[name].unit
        if unit == "rad":
            unit, columns = "deg", degrees(columns, axes)
        axis = axes[0] if axes else ""
        signals[name] = Signal(symbol, unit, axis, labels(axes, symbol, columns), without_rounding(columns))
    return signals


def degrees(columns: np.ndarray, axes: tuple[str, ...]) -> np.ndarray:
    """Angles [deg] (frame, component), as the figures of `esail plot` show them: those of hub and
    sail without jumps by full turns, as far as they are known without a gap from the start."""
    columns = np.array(columns, float)
    if axes[:1] != ("tether",):
        known = np.isfinite(columns).all(1)
        end = len(known) if known.all() else int(np.argmin(known))
        columns[:end] = np.unwrap(columns[:end], axis=0)
    return np.degrees(columns)


def without_rounding(columns: np.ndarray) -> np.ndarray:
    """Values with zeros in place of those that are rounding errors."""
    largest = np.abs(columns[np.isfinite(columns)]).max()
    return np.where(np.abs(columns) <= NEGLIGIBLE * largest, 0.0, columns)


def labels(axes: tuple[str, ...], symbol: str, columns: np.ndarray) -> tuple[str, ...]:
    """The names of an observable's components."""
    if not axes:
        return (symbol,)
    if axes[0] == "angle":
        return tuple(symbol.split(", "))
    if axes[0] == "xyz":
        return tuple(NAMES["xyz"])
    return tuple(f"{axes[0]} {k + 1}" for k in range(columns.shape[1]))
