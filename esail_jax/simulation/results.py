"""What a run hands out on its way, and how it may end."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np


class RESULTS(eqx.Enumeration):
    """How a run ended."""

    successful = "The run reached its end time."
    newton_diverged = "The equations of a step could not be solved."
    nonfinite = "The state became infinite or undefined."
    energy_lost = "The energy balance is off by more than a tenth of the energy."
    step_vanished = "The step size fell to nothing."
    too_many_steps = "A saved interval needs more steps than a run under a trace may take."


CAUSES = (
    RESULTS.nonfinite,
    RESULTS.energy_lost,
    RESULTS.step_vanished,
    RESULTS.too_many_steps,
)
"""Of a failure, but for equations that could not be solved."""


def result_of(message: str) -> RESULTS:
    """The cause that a failed run's message begins with."""
    found = [cause for cause in CAUSES if message.startswith(RESULTS[cause])]
    return found[0] if found else RESULTS.newton_diverged


class SimulationError(RuntimeError):
    """The solver gave up; the message says when, where and how far it was. result: of `RESULTS`;
    seen: what the entry that failed saw before."""

    def __init__(self, message: str, result: RESULTS, seen: "Piece"):
        super().__init__(message)
        self.result, self.seen = result, seen


class Piece(NamedTuple):
    """What the host gets from an entry or a call. numerics: per saved instant, since the one before."""

    rows: dict[str, np.ndarray]
    time: np.ndarray
    numerics: dict[str, np.ndarray]
    reached: float


class Checkpoint(NamedTuple):
    """Enough to go on, bit for bit: the carry after `position` entries or calls, `rows` saved so far,
    `steps` taken, what had been tallied since the last saved instant, and for a chain the energy at
    the start and the largest kinetic energy so far [J]."""

    carry: Any
    position: int
    rows: int
    steps: int
    tally: tuple[float, ...]
    energy: tuple[float, float] = (float("nan"), 0.0)


def join(parts: Sequence[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Rows of consecutive pieces in one."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
