"""The ledger of the two papers: every equation or claim as printed, compared with a reference.

An entry transcribes one printed formula exactly as it stands, misprints included. It compares the formula
on random non-degenerate states with a "judge": automatic differentiation of the package's energies, or a
derivation that shares no code with the package. If the printed form is wrong, the entry carries a form
that agrees. `tests/tools/errata.py` writes the errata (`experiments/paper_errata`) from this ledger, and
`test_oracles.py` checks every entry.

Papers: PGV (Pacheco-Ramos, Garcia-Vallejo, Vazquez: multibody E-sail), MW (Ma, Wang: elastic rods).
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

ROUNDING = 1e-10
"""Relative error up to which two forms of a formula count as equal in double precision: 1e-16 per
operation, some hundred operations, and condition numbers up to 1e3."""


class Errors(NamedTuple):
    """Relative errors against the judge.

    printed: error of the printed form, inf if it cannot be evaluated; right: error of the right form,
    which is the printed form if that holds.
    """

    printed: float
    right: float


@dataclasses.dataclass(frozen=True)
class Entry:
    """One equation or claim.

    paper, equation: its place; title: what it states; holds: whether the printed form agrees; printed,
    right: both forms in words or TeX, for the errata page; consequence: the effect of using the printed
    form; tolerance: relative error that counts as agreement (for a printed number, half a unit of its last
    digit).
    """

    paper: str
    equation: str
    title: str
    check: Callable[[], Errors]
    holds: bool
    printed: str = ""
    right: str = ""
    consequence: str = ""
    tolerance: float = ROUNDING

    @property
    def name(self) -> str:
        """The identifier in test reports."""
        return f"{self.paper} {self.equation}"


ENTRIES: list[Entry] = []
"""All entries, in the order in which the modules of this folder are imported and written."""


def holds(paper: str, equation: str, title: str, *, tolerance: float = ROUNDING, note: str = ""):
    """Decorator for an entry whose printed form is right. The function returns its relative error."""

    def enter(check: Callable[[], float]) -> Callable[[], float]:
        def errors() -> Errors:
            error = float(check())
            return Errors(error, error)

        ENTRIES.append(Entry(paper, equation, title, errors, True, consequence=note, tolerance=tolerance))
        return check

    return enter


def fails(
    paper: str,
    equation: str,
    title: str,
    *,
    printed: str,
    right: str,
    consequence: str,
    tolerance: float = ROUNDING,
):
    """Decorator for an entry whose printed form is wrong. The function returns `Errors`."""

    def enter(check: Callable[[], Errors]) -> Callable[[], Errors]:
        ENTRIES.append(Entry(paper, equation, title, check, False, printed, right, consequence, tolerance))
        return check

    return enter


def relative_error(value, truth) -> float:
    """The largest difference divided by the largest entry of the truth; inf if the shapes do not
    fit."""
    value, truth = np.asarray(value, float), np.asarray(truth, float)
    if value.shape != truth.shape:
        return float("inf")
    scale = np.abs(truth).max()
    return float(np.abs(value - truth).max() / (scale if scale > 0.0 else 1.0))
