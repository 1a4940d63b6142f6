"""Access to the saved observables of a run that may have failed, or that may lack some of them."""

from typing import Any

import numpy as np


def observable(run: Any, name: str, factor: float = 1.0) -> np.ndarray | None:
    """A factor times an observable, time first; None if the run lacks it or all of it is NaN."""
    if name not in run.observables:
        return None
    values = np.asarray(run[name])
    return factor * values if np.isfinite(values).any() else None


def per_tether(value: Any, count: int) -> np.ndarray:
    """A number for all tethers, or one per tether, as an array (tether)."""
    return np.broadcast_to(np.asarray(value, float), (count,))


def leading_finite(*signals: np.ndarray) -> int:
    """Number of leading instants at which all signals (time, ...) are finite: a failed run is NaN
    from the failure on."""
    finite = np.ones(len(signals[0]), bool)
    for signal in signals:
        finite &= np.isfinite(signal).reshape(len(signal), -1).all(1)
    return len(finite) if finite.all() else int(np.argmin(finite))
