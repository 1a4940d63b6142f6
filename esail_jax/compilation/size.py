"""Size of programs. The compile time grows with the number of equations and instructions."""

import re
from typing import Any, NamedTuple

from kept_programs.program import Program

INSTRUCTION = re.compile(r"^ +(?:ROOT )?%\S+ = ", re.MULTILINE)
"""Matches the beginning of one instruction in the text of a compiled program."""


class Size(NamedTuple):
    """Size of a program. equations: of its jaxpr, which JAX traces; instructions: of the compiled program,
    after XLA's optimisations."""

    equations: int
    instructions: int


def size_of(program: Program) -> Size:
    """The size of a program. It is traced, and compiled or loaded, unless it was before."""
    text = program.executable.as_text()
    return Size(count_equations(program.traced.jaxpr), len(INSTRUCTION.findall(text)))


def count_equations(jaxpr: Any) -> int:
    """The number of equations of a jaxpr (`jax.make_jaxpr`), with those of the jaxprs within it.

    A jaxpr that is called from several places is counted at each of them."""
    equations = getattr(jaxpr, "jaxpr", jaxpr).eqns
    return len(equations) + sum(
        count_equations(part)
        for equation in equations
        for value in equation.params.values()
        for part in (value if isinstance(value, tuple | list) else (value,))
        if hasattr(getattr(part, "jaxpr", part), "eqns")
    )
