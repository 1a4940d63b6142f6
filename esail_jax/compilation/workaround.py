"""Workaround for two faults in the matrix library of jaxlib 0.10 to 0.12.

`tests/compilation/test_jit.py`, `test_workaround_has_not_expired`, fails when jaxlib is mended.

XLA hands matrix products to this library. If it hands over the operations around a product as well
(`options.FUSED_PRODUCTS`), then two kinds of product are wrong:

1. The right factor is a broadcast whose columns are all equal (jaxlib 0.10.2 to 0.12.0.1). The library
   reads beyond the end of that factor's data. A run rarely contains such a product; a derivative often
   does, where a tangent is zero.
2. The sum runs over the last index of the right factor (A B^T), and B has more than 16,384 rows (jaxlib
   0.10.2, JAX issue 39103). `jax.vmap(lambda r: A @ r)` of as many vectors is such a product. With XLA's
   default options it is wrong, too.

`options.compile_lowered` searches the text of every compiled program for such products and, if there is
one, compiles the program without the option. Programs of a user's own `jax.jit` are compiled with XLA's
default options. `set_flag` therefore changes that default when `esail_jax` is imported. XLA reads its flags
when JAX first uses a device. If that was before the import, `refuse_wrong_products` refuses to put a run
into such a program.
"""

import functools
import os
import re
from importlib import metadata
from typing import NamedTuple

FLAG = "--xla_cpu_experimental_ynn_fusion_type"
"""XLA's flag, and compiler option, that says which operations XLA hands to the library."""

PRODUCTS_ALONE = "LIBRARY_FUSION_TYPE_INDIVIDUAL_DOT"
"""The value with which the library computes matrix products, and none of the operations around them."""

COMPUTATION = re.compile(r"^(%\S+) \([^\n]*\{\n((?: [^\n]*\n)+)\}", re.MULTILINE)
"""Matches one computation of a compiled program; groups: its name, its instructions."""

INSTRUCTION = re.compile(r"^ *(?:ROOT )?(%\S+) = (\S+) ([\w-]+)\((.*?)\)(.*)$", re.MULTILINE)
"""Matches one instruction; groups: name, type, operation, operands, attributes."""

RESHAPING = ("bitcast", "reshape", "transpose", "copy")
"""Operations that rearrange an array and do not compute its numbers."""

STORED = ("parameter", "constant", "dot")
"""Operations whose result is an array in memory."""

MOST_ROWS = 16384
"""Largest number of rows of B for which products A B^T are right."""


def set_flag() -> None:
    """Sets XLA's flag for programs of `jax.jit`, unless the user has set it. XLA ends a process whose flags
    it does not know; the versions of jaxlib that are named here know this one."""
    flags = os.environ.get("XLA_FLAGS", "")
    if FLAG not in flags and metadata.version("jaxlib").startswith(("0.10.", "0.11.", "0.12.")):
        os.environ["XLA_FLAGS"] = f"{flags} {FLAG}={PRODUCTS_ALONE}".strip()


@functools.cache
def products_are_right() -> bool:
    """Compares a product of the second kind, compiled by `jax.jit`, with NumPy (0.05 s)."""
    import jax
    import numpy as np

    if jax.default_backend() != "cpu":
        return True
    matrix = np.arange(9.0).reshape(3, 3)
    rows = np.linspace(-1.0, 1.0, 3 * (MOST_ROWS + 1)).reshape(-1, 3)
    found = jax.jit(jax.vmap(lambda row: ((matrix @ row) ** 2).sum()))(rows)
    return np.allclose(found, ((rows @ matrix.T) ** 2).sum(1), rtol=1e-10)


def refuse_wrong_products() -> None:
    """Raises RuntimeError if programs of `jax.jit` compute long products wrongly in this process."""
    if not products_are_right():
        raise RuntimeError(
            "this version of jaxlib computes some matrix products wrongly under `jax.jit`; use "
            "`esail_jax.jit`, import `esail_jax` before JAX first uses a device, or set the variable "
            f"XLA_FLAGS={FLAG}={PRODUCTS_ALONE}"
        )


class Instruction(NamedTuple):
    """One instruction of a computation, as text. shape: type and shape of its result."""

    shape: str
    operation: str
    operands: str
    attributes: str


def may_be_wrong(program: str) -> bool:
    """True if a compiled program, given as text, hands the library a product that may be wrong.

    The library is wrong for some of these products only; all are avoided."""
    in_library = set(re.findall(r"kind=kCustom, calls=(%[\w.-]+).*__ynn_fusion", program))
    return any(name in in_library and contains_suspect(body) for name, body in COMPUTATION.findall(program))


def contains_suspect(body: str) -> bool:
    """True if one computation contains a product of one of the two kinds."""
    made = {name: Instruction(*rest) for name, *rest in INSTRUCTION.findall(body)}
    products = [x for x in made.values() if x.operation == "dot"]
    return any(has_computed_factor(x, made) or has_long_factor(x, made) for x in products)


def has_computed_factor(product: Instruction, made: dict[str, Instruction]) -> bool:
    """True if the right factor of a product is not an array in memory."""
    factor = made[last_operand(product.operands)]
    while factor.operation in RESHAPING:
        factor = made[last_operand(factor.operands)]
    return factor.operation not in STORED


def has_long_factor(product: Instruction, made: dict[str, Instruction]) -> bool:
    """True if the sum of a product runs over the last index of a right factor with very many rows."""
    inside = re.search(r"\[([\d,]*)\]", made[last_operand(product.operands)].shape)
    summed = re.search(r"rhs_contracting_dims=\{(\d+)\}", product.attributes)
    if inside is None or summed is None:
        return False
    sizes = [int(size) for size in inside[1].split(",")]
    return int(summed[1]) == len(sizes) - 1 and max(sizes[:-1], default=0) > MOST_ROWS


def last_operand(operands: str) -> str:
    """Name of the last operand. The text may give the type of an operand before its name."""
    return operands.split(",")[-1].split()[-1]
