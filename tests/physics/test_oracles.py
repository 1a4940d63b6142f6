"""Every equation of both papers, as printed, is compared with automatic differentiation or a derivation.

The entries are in `oracles/`; `experiments/paper_errata` lists the equations that are printed wrongly.
"""

import importlib
import pkgutil
import re

import numpy as np
import pytest

import oracles
from oracles.ledger import ENTRIES

VISIBLE = 1e-6
"""Least error of a form that counts as misprinted; it is far above rounding."""

for module in sorted(m.name for m in pkgutil.iter_modules(oracles.__path__)):
    importlib.import_module(f"oracles.{module}")


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.name)
def test_printed_form_and_right_form(entry):
    """The right form agrees with the reference; the printed form agrees exactly if the entry says so."""
    errors = entry.check()
    assert np.isfinite(errors.right) and errors.right <= entry.tolerance
    if entry.holds:
        assert errors.printed <= entry.tolerance
    else:
        assert errors.printed > max(VISIBLE, 2.0 * entry.tolerance)


def test_names_are_unique():
    """Every equation or claim has one entry."""
    names = [entry.name for entry in ENTRIES]
    assert len(names) == len(set(names))


def test_a_misprint_says_what_is_right_and_what_it_does():
    for entry in ENTRIES:
        if not entry.holds:
            assert entry.printed and entry.right and entry.consequence, entry.name


@pytest.mark.parametrize(("paper", "last"), [("PGV", 134), ("MW", 31)])
def test_every_equation_has_an_entry(paper, last):
    """Every numbered equation of both papers has an entry."""
    found = (re.match(r"\d+(?![\d.])", entry.equation) for entry in ENTRIES if entry.paper == paper)
    numbers = {number[0] for number in found if number}
    spans = [
        range(int(a), int(b) + 1)
        for e in ENTRIES
        if e.paper == paper
        for a, b in re.findall(r"^(\d+)-(\d+)", e.equation)
    ]
    covered = {int(n) for n in numbers} | {n for span in spans for n in span}
    assert set(range(1, last + 1)) <= covered
