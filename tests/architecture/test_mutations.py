"""The lists of perturbations (`mutations/*.toml`) fit the package and the table of results.

Running the perturbations is no test: `python tests/tools/mutations.py` (how long it takes: DURATIONS.md).
"""

import csv

import pytest

from support.durations import read
from support.gate import COLLECTED, NIGHTLY, gate_tests
from support.perturbations import ROOT, mutations, path_of

MUTATIONS = mutations()


def test_every_perturbation_finds_its_text():
    """The text of every perturbation occurs exactly once. Otherwise something else or nothing would
    change."""
    for mutation in MUTATIONS:
        text = (ROOT / path_of(mutation)).read_text(encoding="utf-8")
        assert text.count(mutation["old"]) == 1, mutation["name"]
        assert mutation["old"] != mutation["new"]
    names = [mutation["name"] for mutation in MUTATIONS]
    assert len(set(names)) == len(names)


def test_every_perturbation_is_noticed_by_the_gate():
    """The table lists every perturbation with a test that failed and that the gate runs: a default test, or
    one that `gate.toml` names. Only so may the other tests be left to the night."""
    with (ROOT / "experiments/mutations/mutations.csv").open(encoding="utf-8") as file:
        table = {row["term"]: row["tests that fail"].split("; ") for row in csv.DictReader(file)}
    assert set(table) == {mutation["name"] for mutation in MUTATIONS}
    gate = read()["default"].keys() | set(gate_tests())
    assert not {name: tests for name, tests in table.items() if not gate & set(tests)}


def test_tests_of_the_gate_exist_and_are_known(request):
    """`durations.json`, which tells which tests are default ones, agrees with the markers of the tests that
    this session has collected, and every name of `gate.toml` is that of a test."""
    known = read()
    collected, nightly = request.config.stash[COLLECTED], request.config.stash[NIGHTLY]
    assert not known["default"].keys() & nightly
    assert not known["nightly"].keys() & collected - nightly
    every = known["default"].keys() | known["gate"].keys() | known["nightly"].keys()
    assert set(gate_tests()) == known["gate"].keys()
    rooms = {name.partition("/")[0] for name in collected}
    if rooms == {name.partition("/")[0] for name in every}:  # all tests: none is missing, none is left over
        assert collected == every, "python -m pytest -m '' --collect-only --write-durations"


WITHOUT_FORMULAS = {"steppers/log.py", "steppers/results.py", "steppers/stepper.py"}
"""Files of these folders without formulas: the log of steps, result codes, the interface of methods."""


@pytest.mark.parametrize("folder", ["elements", "loads", "joints", "environment", "steppers", "equilibria"])
def test_every_room_with_physics_is_perturbed(folder):
    """Every file with formulas has a perturbation."""
    perturbed = {mutation["file"] for mutation in MUTATIONS}
    files = {f"{folder}/{path.name}" for path in (ROOT / "esail_jax" / folder).glob("[a-z]*.py")}
    assert files - WITHOUT_FORMULAS <= perturbed
