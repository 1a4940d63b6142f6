"""Shared scenes. Compiling is most of a test's time: tests share structures where they can."""

from pathlib import Path

import jax
import pytest

pytest_plugins = ["validation_record"]

MAPS = Path("/proc/self/maps")
MOST_MAPS = 25_000
"""Mapped regions of memory of one process. Every compiled program adds dozens, Linux allows 65,530, and
beyond that the next compilation ends the process: some hundred tests get there."""


@pytest.fixture(scope="session")
def small():
    """Overrides of the baseline that most tests share: three tethers of two elements, 20 s."""
    return {"tethers.count": 3, "tethers.elements": 2, "integrator.t_end": 20.0}


@pytest.fixture(autouse=True)
def _room_for_programs():
    """Drops compiled programs before there are too many."""
    if MAPS.exists() and MAPS.read_bytes().count(b"\n") > MOST_MAPS:
        jax.clear_caches()
