"""Workaround for a fault in the matrix library of jaxlib 0.10. Needed for jaxlib < 0.11 only; delete this
module when the package requires jaxlib 0.11.

XLA hands matrix products to this library. If it hands over the operations around a product as well
(`options.FUSED_PRODUCTS`), and the right factor is a broadcast whose columns are all equal, then the
library of jaxlib 0.10.2 reads beyond the end of that factor's data, and the product is wrong. A run rarely
contains such a product; a derivative often does, where a tangent is zero. `options.compile_lowered`
searches the text of every compiled program for it and, if there is one, compiles the program without the
option.
"""

import re

COMPUTATION = re.compile(r"^(%\S+) \([^\n]*\{\n((?: [^\n]*\n)+)\}", re.MULTILINE)
"""Matches one computation of a compiled program; groups: its name, its instructions."""

INSTRUCTION = re.compile(r"^ *(?:ROOT )?(%\S+) = \S+ ([\w-]+)\((.*?)\)", re.MULTILINE)
"""Matches one instruction; groups: name, operation, operands."""

RESHAPING = ("bitcast", "reshape", "transpose", "copy")
"""Operations that rearrange an array and do not compute its numbers."""

STORED = ("parameter", "constant", "dot")
"""Operations whose result is an array in memory."""


def has_computed_right_factor(program: str) -> bool:
    """True if a compiled program, given as text, hands the library a product whose right factor is computed
    on the fly.

    The library is wrong for some of these (broadcasts), so all are avoided."""
    in_library = set(re.findall(r"kind=kCustom, calls=(%[\w.-]+).*__ynn_fusion", program))
    return any(
        name in in_library and computes_right_factor(body) for name, body in COMPUTATION.findall(program)
    )


def computes_right_factor(body: str) -> bool:
    """True if one computation contains a product whose right factor is not an array in memory."""
    made = {name: (op, operands) for name, op, operands in INSTRUCTION.findall(body)}
    for op, operands in made.values():
        if op == "dot":
            op, operands = made[last_operand(operands)]
            while op in RESHAPING:
                op, operands = made[last_operand(operands)]
            if op not in STORED:
                return True
    return False


def last_operand(operands: str) -> str:
    """Name of the last operand. The text may give the type of an operand before its name."""
    return operands.split(",")[-1].split()[-1]
