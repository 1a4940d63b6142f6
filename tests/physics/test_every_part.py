"""Derivatives by all numbers of a sail with every part: a ring, temperatures, an orbit, a relative wind
with the thrust of a sheath, thrust at the tips, and a power limit (`support/every_part.py`)."""

import pytest

from support.derivatives import check_both_modes
from support.every_part import NUMBERS, signals_of_model


@pytest.mark.nightly
def test_derivatives_by_every_number(validate):
    """Derivatives of the steady start, accelerations, reactions and observables by every number of the
    parts are difference quotients to 1e-6, and both modes agree.

    A run is made of these functions. Its derivative, given theirs, is that of its steps, which
    `steppers/test_every_stepper.py` and the designs check."""
    errors = check_both_modes(signals_of_model, NUMBERS)
    worst = max(errors, key=errors.get)
    validate(
        "PART-1", f"sail with every part, {len(NUMBERS)} numbers", "differences, fourth order",
        "derivatives of start, accelerations, observables", errors[worst], 1e-6,
    )  # fmt: skip
