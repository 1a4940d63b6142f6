"""The results of a run: success, or the reason of a failure."""

from typing import Any

import equinox as eqx
import jax
import numpy as np


def member(sentence: str) -> Any:
    """The sentence, of which equinox makes a member of its class."""
    return sentence


class RESULTS(eqx.Enumeration):
    """How a run ended; `RESULTS[result]` is the sentence that says so."""

    successful: "RESULTS" = member("The run reached its end time.")
    newton_diverged: "RESULTS" = member("The equations of a step could not be solved.")
    nonfinite: "RESULTS" = member("The state became infinite or undefined.")
    energy_drift: "RESULTS" = member("The energy balance is off by more than a tenth of the energy.")
    min_step_reached: "RESULTS" = member("The step size fell to nothing.")
    too_many_steps: "RESULTS" = member("The run needs more steps than `max_steps` allows.")
    other_start: "RESULTS" = member(
        "The time of `start`, which was traced, is not the first instant of the run."
    )
    tether_ended: "RESULTS" = member("A tether was paid out to its end, or reeled in.")


NAMES = (
    "successful", "newton_diverged", "nonfinite", "energy_drift", "min_step_reached", "too_many_steps",
    "other_start", "tether_ended",
)  # fmt: skip
"""The names of the members of `RESULTS`, as run files store them."""


def name_of(result: RESULTS) -> str:
    """The name of a result that is not a tracer. This compiles nothing."""
    number = number_of(result)
    return next(name for name in NAMES if number_of(getattr(RESULTS, name)) == number)


def number_of(result: RESULTS) -> int:
    """The integer that represents a result."""
    return int(np.asarray(jax.tree.leaves(result)[0]))
