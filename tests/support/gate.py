"""The tests of the gate: default tests, and the nightly ones that `tests/gate.toml` names.

python -m pytest                                default tests
python -m pytest -m "gate or not nightly"       the gate
python -m pytest -m ""                          all tests
"""

import tomllib
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]

NIGHTLY = pytest.StashKey[set[str]]()
"""Names of the collected tests that neither the default run nor the gate has."""

COLLECTED = pytest.StashKey[set[str]]()
"""Names of all collected tests, before some are left out by marker or keyword."""


def gate_tests() -> list[str]:
    """The names of the nightly tests that the gate runs, without `tests/`."""
    groups = tomllib.loads((TESTS / "gate.toml").read_text(encoding="utf-8"))["group"]
    return [test for group in groups for test in group["tests"]]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Marks the gate's tests, and remembers which tests are nightly only, before pytest selects some."""
    named = set(gate_tests())
    found = {item.nodeid.removeprefix("tests/"): item for item in items}
    for name in named & found.keys():
        found[name].add_marker(pytest.mark.gate)
    config.stash[NIGHTLY] = {
        name for name, item in found.items() if item.get_closest_marker("nightly") and name not in named
    }
    config.stash[COLLECTED] = set(found)
