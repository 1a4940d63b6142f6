"""Observables that may be plotted beside a moving picture."""

import numpy as np

from esail_jax.files.reading import SavedRun
from esail_jax.viewing.motion import Signal

NUMBERED = ("tether", "rod")
"""Axes whose entries are told by number, from 1."""

NAMES = {"xyz": "xyz", "angle": ""}
"""Names of the components of other axes; those of angles are in the symbol."""


def signals_of(run: SavedRun, frames: np.ndarray) -> dict[str, Signal]:
    """Returns the observables with at most one axis beside time, at these saved instants. Those that are
    NaN throughout are left out."""
    found = {}
    for name, values in run.rows.items():
        axes = run.attributes[name]["axes"]
        if len(axes) > 1 or (axes and axes[0] not in (*NUMBERED, *NAMES)):
            continue
        columns = values[frames].reshape(len(frames), -1)
        if not np.isfinite(columns).any():
            continue
        symbol = run.attributes[name]["symbol"]
        found[name] = Signal(symbol, run.attributes[name]["unit"], labels(axes, symbol, columns), columns)
    return found


def labels(axes: tuple[str, ...], symbol: str, columns: np.ndarray) -> tuple[str, ...]:
    """Returns the names of an observable's components."""
    if not axes:
        return (symbol,)
    if axes[0] == "angle":
        return tuple(symbol.split(", "))
    if axes[0] == "xyz":
        return tuple(NAMES["xyz"])
    return tuple(f"{axes[0]} {k + 1}" for k in range(columns.shape[1]))
