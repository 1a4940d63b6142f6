"""Statements of [PGV] and how each is judged: a function measures runs and says whether it holds."""

from collections.abc import Callable
from typing import Any, NamedTuple

HOLDS, IN_PART, FAILS = "holds", "in part", "does not hold"


class Verdict(NamedTuple):
    """The verdict on a statement and the numbers behind it."""

    word: str
    numbers: str


class Statement(NamedTuple):
    """A statement of the paper: section, figure or table, what it says, and its judge."""

    section: str
    figure: str
    says: str
    judge: Callable[[Any], Verdict]


STATEMENTS: list[Statement] = []
"""All statements, in the order of the paper."""


def statement(section: str, figure: str, says: str):
    """A decorator that adds a judge to STATEMENTS."""

    def add(judge: Callable[[Any], Verdict]) -> Callable[[Any], Verdict]:
        STATEMENTS.append(Statement(section, figure, says, judge))
        return judge

    return add


def holds_if(condition: Any, numbers: str, otherwise: str = FAILS) -> Verdict:
    """The verdict HOLDS if the condition is true."""
    return Verdict(HOLDS if bool(condition) else otherwise, numbers)


def listed(values: Any, form: str = ".3g") -> str:
    """Numbers as a text, separated by commas."""
    return ", ".join(format(float(x), form) for x in values)
