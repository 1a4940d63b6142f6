"""The lists of perturbations (`mutations/*.toml`) fit the package and the table of results.

Running the perturbations takes 45 minutes and is no test: `python tests/tools/mutations.py`.
"""

import csv
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LISTS = sorted(Path(__file__).with_name("mutations").glob("*.toml"))
MUTATIONS = [m for path in LISTS for m in tomllib.loads(path.read_text(encoding="utf-8"))["mutation"]]


def test_every_perturbation_finds_its_text():
    """The text of every perturbation occurs exactly once. Otherwise something else or nothing would
    change."""
    for mutation in MUTATIONS:
        text = (ROOT / "esail_jax" / mutation["file"]).read_text(encoding="utf-8")
        assert text.count(mutation["old"]) == 1, mutation["name"]
        assert mutation["old"] != mutation["new"]
    names = [mutation["name"] for mutation in MUTATIONS]
    assert len(set(names)) == len(names)


def test_every_perturbation_has_been_noticed():
    """The table lists every perturbation with a test that failed."""
    with (ROOT / "experiments/mutations/mutations.csv").open(encoding="utf-8") as file:
        table = {row["term"]: row["tests that fail"] for row in csv.DictReader(file)}
    assert set(table) == {mutation["name"] for mutation in MUTATIONS}
    assert all(table.values())


WITHOUT_FORMULAS = {"steppers/log.py", "steppers/results.py", "steppers/stepper.py"}
"""Files of these folders without formulas: the log of steps, result codes, the interface of methods."""


@pytest.mark.parametrize("folder", ["elements", "loads", "joints", "environment", "steppers", "equilibria"])
def test_every_room_with_physics_is_perturbed(folder):
    """Every file with formulas has a perturbation."""
    perturbed = {mutation["file"] for mutation in MUTATIONS}
    files = {f"{folder}/{path.name}" for path in (ROOT / "esail_jax" / folder).glob("[a-z]*.py")}
    assert files - WITHOUT_FORMULAS <= perturbed
