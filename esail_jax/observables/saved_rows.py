"""Access to the saved observables of a run that may have failed, or that may lack some of them."""

from typing import Any

import numpy as np


def observable(run: Any, name: str, factor: float = 1.0) -> np.ndarray | None:
    """`factor` times an observable (time, ...); None if the run lacks it or all of it is NaN."""
    if name not in run.observables:
        return None
    values = np.asarray(run[name])
    return factor * values if np.isfinite(values).any() else None


def per_tether(value: Any, count: int) -> np.ndarray:
    """An array (tether) from one number for all tethers or one per tether."""
    return np.broadcast_to(np.asarray(value, float), (count,))


def leading_finite(*signals: np.ndarray) -> int:
    """The number of leading instants at which all signals (time, ...) are finite. A failed run is
    NaN after its failure."""
    finite = np.ones(len(signals[0]), bool)
    for signal in signals:
        finite &= np.isfinite(signal).reshape(len(signal), -1).all(1)
    return len(finite) if finite.all() else int(np.argmin(finite))
