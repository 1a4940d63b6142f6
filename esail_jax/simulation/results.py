"""What a run hands out on its way, and how it may fail."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from esail_jax.simulation.statistics import Pending
from esail_jax.steppers.results import RESULTS


class Chunk(NamedTuple):
    """Some consecutive saved instants of a run.

    time [s]; observables and numerics by name, first axis `time`; reached: the time [s] that the steps
    have reached."""

    time: np.ndarray
    observables: dict[str, np.ndarray]
    numerics: dict[str, np.ndarray]
    reached: float


class Checkpoint(NamedTuple):
    """Enough to go on, bit for bit.

    motion: the stepper's state and last block (from a file: arrays by path); rows: number of saved
    instants so far that a longer run saves, too; segment: number of switch times passed; pending:
    statistics of the steps since the last of these instants; energy: for a chain the energy at the start
    and the largest kinetic energy so far [J]."""

    motion: Any
    rows: int
    segment: int
    pending: Pending
    energy: tuple[float, float]


class SimulationError(RuntimeError):
    """The solver gave up. The message says when, where, and what to try; result: a member of `RESULTS`."""

    def __init__(self, message: str, result: RESULTS):
        super().__init__(message)
        self.result = result


def join(parts: Sequence[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Rows of consecutive chunks in one."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
