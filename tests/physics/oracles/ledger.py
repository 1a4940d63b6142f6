"""The ledger of the two papers: every equation or claim, as printed, against a judge.

An entry transcribes one printed formula exactly as it stands (misprints included) and compares it, on
random non-degenerate states, with automatic differentiation of the package's energies or with a
derivation that shares no code with the package. Where the print fails, the entry carries a form that
agrees. The errata (`experiments/paper_errata`) are written from this ledger, and `test_oracles.py`
checks that each entry says the truth.

Papers: PGV (Pacheco-Ramos, Garcia-Vallejo, Vazquez: multibody E-sail), MW (Ma, Wang: elastic rods).
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

ROUNDING = 1e-10
"""Relative error up to which two forms of one formula are the same in double precision: 1e-16 per
operation, some hundred operations, condition numbers up to 1e3."""


class Errors(NamedTuple):
    """Relative errors against the judge. printed: of the form as printed (inf where it cannot be
    evaluated at all); right: of the form that stands beside it (the printed one, if it holds)."""

    printed: float
    right: float


@dataclasses.dataclass(frozen=True)
class Entry:
    """One equation or claim.

    paper, equation: where; title: what it states; holds: does the printed form agree; printed, right:
    both forms in words or TeX, for the errata page; consequence: what happens to those who use the
    printed form; tolerance: relative error that counts as agreement (of a printed number: half a unit
    of its last digit).
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
        """Identifier in test reports."""
        return f"{self.paper} {self.equation}"


ENTRIES: list[Entry] = []
"""In the order in which the modules of this folder are imported and written."""


def holds(paper: str, equation: str, title: str, *, tolerance: float = ROUNDING, note: str = ""):
    """Decorator: the printed form is right. The function returns its relative error."""

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
    """Decorator: the printed form is wrong. The function returns `Errors`."""

    def enter(check: Callable[[], Errors]) -> Callable[[], Errors]:
        ENTRIES.append(Entry(paper, equation, title, check, False, printed, right, consequence, tolerance))
        return check

    return enter


def relative_error(value, truth) -> float:
    """Largest difference over the largest entry of the truth; inf where shapes do not fit."""
    value, truth = np.asarray(value, float), np.asarray(truth, float)
    if value.shape != truth.shape:
        return float("inf")
    scale = np.abs(truth).max()
    return float(np.abs(value - truth).max() / (scale if scale > 0.0 else 1.0))
