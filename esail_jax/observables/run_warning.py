"""What is to be said of a run that came to its end."""

from collections.abc import Mapping, Sequence

import numpy as np

from esail_jax.observables.balance import balance_warning

WARN_ABOVE = 7e-3
"""Part of the range that tips or forces may be estimated to be off by: half way between the largest
estimate of runs right to 1e-3 (5e-3) and the least of those off by 1e-2 (`experiments/stability`)."""

STEP_ERRORS = {"tip_error": "the tips", "root_force_error": "the forces at the roots"}
"""What methods of fixed steps estimate (`steppers/step_error.py`), in parts of ranges: names and words."""


def run_warning(rows: Mapping[str, np.ndarray], numerics: Mapping[str, np.ndarray]) -> str:
    """A sentence if the energy balance is off, and one if the steps are too long, of a finished run: its
    observables, and what is kept of its steps."""
    parts = [float(numerics[name][-1]) for name in STEP_ERRORS if name in numerics]
    return joined_warnings(rows, parts)


def joined_warnings(rows: Mapping[str, np.ndarray], parts: Sequence[float]) -> str:
    """The same from the estimates themselves; parts: empty where there are none."""
    return " ".join(filter(None, (balance_warning(rows), step_warning(parts))))


def step_warning(parts: Sequence[float]) -> str:
    """A sentence if an estimate, in the order of STEP_ERRORS, exceeds WARN_ABOVE or is no number."""
    named = zip(STEP_ERRORS.values(), parts, strict=False)
    off = [f"{name} by {in_words(part)}" for name, part in named if not part <= WARN_ABOVE]
    return f"{SENTENCE} {' and '.join(off)}." if off else ""


SENTENCE = "The step is too long (try half of it): by the estimate of its errors it puts off"


def in_words(part: float) -> str:
    """A part of the range."""
    return f"about {part:.0e} of their range" if part < 1.0 else "as much as they range over"
