"""Shared scenes. Compiling is most of a test's time: tests share structures where they can."""

import pytest

pytest_plugins = ["validation_record"]


@pytest.fixture(scope="session")
def small():
    """Overrides of the baseline that most tests share: three tethers of two elements, 20 s."""
    return {"tethers.count": 3, "tethers.elements": 2, "integrator.t_end": 20.0}
