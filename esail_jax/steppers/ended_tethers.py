"""The end of a run in which a tether is paid out to its end, or reeled in (`elements/winch.py`)."""

from esail_jax.array_types import Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.steppers.results import RESULTS, name_of
from esail_jax.system import System


def with_ended_tethers(
    system: System, q: Coordinates, v: Coordinates, h: Scalar, shortest: bool, result: RESULTS
) -> RESULTS:
    """The result of a run that stands before a step of length h [s], or a tether's end if it is within that
    step. shortest: tells whether the method tries no shorter step."""
    if not system.has_unknown_lengths:
        return result
    ends = system.payout.ends(q.reel, v.reel, h)
    if not shortest:
        ends &= system.payout.is_short(v.reel, h)
    return RESULTS.where(ends, RESULTS.tether_ended, result)


def message_of(system: System, time: float, q: Coordinates, result: RESULTS) -> str | None:
    """When the run ended, and which tether; None if another reason ended it."""
    if name_of(result) != "tether_ended":
        return None
    return f"At t = {time:.6g} s {system.payout.ended(q.reel)}"
