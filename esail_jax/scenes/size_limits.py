"""Sizes that no machine can compute are refused before anything is compiled: the memory of the model, the
number of saved instants, and the number of fixed steps.

The memory is measured: a sail by collocation takes 0.35 GB plus some 50 kB for every element (12 x 4000
elements: 2.7 GB). A rod of a chain takes less than 10 kB.
"""

import os
from typing import Protocol, runtime_checkable

from esail_jax.scenes.chain_tables import Chain
from esail_jax.scenes.common_tables import Integrator, Output
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.sail_tables import Tethers

BYTES_PER_ELEMENT, BYTES_PER_ROD = 50_000, 10_000
"""Memory [bytes] of an element of a sail, and of a rod of a chain."""

MOST_INSTANTS = 10**8
"""Largest number of saved instants: 1 GB for every number of an observable."""

MOST_STEPS = 10**12
"""Largest number of fixed steps: a year of computing at 30 us a step."""


@runtime_checkable
class Sized(Protocol):
    """The attributes of a `Scene` that decide its size."""

    integrator: Integrator
    output: Output
    tethers: Tethers | None
    chain: Chain | None


def memory_of_machine() -> float:
    """Returns the memory [bytes] of this machine, infinite where it cannot be asked for."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return float("inf")


def check_size(scene: Sized) -> None:
    """Raises SceneError for a scene that is too large for this machine, or whose run has no end."""
    if scene.chain is not None:
        key, count, each = "chain.rods", scene.chain.rods, BYTES_PER_ROD
    else:
        tethers = scene.tethers
        count, each = tethers.count * tethers.elements, BYTES_PER_ELEMENT
        key = "tethers.elements" if tethers.elements > tethers.count else "tethers.count"
    room = memory_of_machine()
    if count * each > room:
        must = f"leave a model that fits into this machine's {room / 1e9:.0f} GB"
        raise SceneError(key, must, f"makes {count:.3g} elements, some {count * each / 1e9:.3g} GB")
    t_end, interval, step = scene.integrator.t_end, scene.output.interval, scene.integrator.step
    if t_end > MOST_INSTANTS * interval:
        must = f"leave at most {MOST_INSTANTS:.0e} saved instants"
        raise SceneError("output.interval", must, f"is {interval:g} with `integrator.t_end` = {t_end:g}")
    if step is not None and t_end > MOST_STEPS * step:
        must = f"leave at most {MOST_STEPS:.0e} steps"
        raise SceneError("integrator.step", must, f"is {step:g} with `integrator.t_end` = {t_end:g}")
