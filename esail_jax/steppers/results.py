"""The results of a run: success, or the reason of a failure."""

import equinox as eqx
import jax
import numpy as np


class RESULTS(eqx.Enumeration):
    """How a run ended; `RESULTS[result]` is the sentence that says so."""

    successful = "The run reached its end time."
    newton_diverged = "The equations of a step could not be solved."
    nonfinite = "The state became infinite or undefined."
    energy_drift = "The energy balance is off by more than a tenth of the energy."
    min_step_reached = "The step size fell to nothing."
    too_many_steps = "The run needs more steps than `max_steps` allows."
    other_start = "The time of `start`, which was traced, is not the first instant of the run."


NAMES = (
    "successful", "newton_diverged", "nonfinite", "energy_drift", "min_step_reached", "too_many_steps",
    "other_start",
)  # fmt: skip
"""The names of the members of `RESULTS`, as run files store them."""


def name_of(result: RESULTS) -> str:
    """The name of a result that is not a tracer. This compiles nothing."""
    number = number_of(result)
    return next(name for name in NAMES if number_of(getattr(RESULTS, name)) == number)


def number_of(result: RESULTS) -> int:
    """The integer that represents a result."""
    return int(np.asarray(jax.tree.leaves(result)[0]))
