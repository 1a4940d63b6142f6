"""Workaround for two faults in the matrix library of jaxlib 0.10 to 0.12.

`tests/compilation/test_jit.py`, `test_workaround_has_not_expired`, fails when jaxlib is mended.

XLA hands matrix products to this library. If it hands over the operations around a product as well
(`PRODUCTS_FUSED`), then two kinds of product are wrong:

1. The right factor is a broadcast whose columns are all equal (jaxlib 0.10.2 to 0.12.0.1). The library
   reads beyond the end of that factor's data. A run rarely contains such a product; a derivative often
   does, where a tangent is zero.
2. The sum runs over the last index of the right factor (A B^T), and B has more than 16,384 rows (jaxlib
   0.10.2, JAX issue 39103). `jax.vmap(lambda r: A @ r)` of as many vectors is such a product. With XLA's
   default options it is wrong, too.

The programs of this package are therefore compiled without that option, unless it is asked for the steps
of a run (`options.REQUEST`). Programs of a user's own `jax.jit` are compiled with XLA's default options.
`set_flag` changes that default when `esail_jax` is imported. XLA reads its flags when JAX first uses a
device. If that was before the import, `refuse_wrong_products` refuses to put a run into such a program.
"""

import functools
import os
from importlib import metadata

FLAG = "--xla_cpu_experimental_ynn_fusion_type"
"""XLA's flag, and compiler option, that says which operations XLA hands to the library."""

PRODUCTS_ALONE = "LIBRARY_FUSION_TYPE_INDIVIDUAL_DOT"
"""The value with which the library computes matrix products, and none of the operations around them."""

PRODUCTS_FUSED = "LIBRARY_FUSION_TYPE_DOT"
"""The value with which it computes the operations around them as well."""

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
    """Compares a product of the second kind, compiled by `jax.jit`, with NumPy (0.05 s), also while JAX
    traces."""
    import jax
    import numpy as np

    if jax.default_backend() != "cpu":
        return True
    matrix = np.arange(9.0).reshape(3, 3)
    rows = np.linspace(-1.0, 1.0, 3 * (MOST_ROWS + 1)).reshape(-1, 3)
    with jax.ensure_compile_time_eval():
        products = jax.jit(jax.vmap(lambda row: ((matrix @ row) ** 2).sum()))(rows)
    return np.allclose(products, ((rows @ matrix.T) ** 2).sum(1), rtol=1e-10)


def refuse_wrong_products() -> None:
    """Raises RuntimeError if programs of `jax.jit` compute long products wrongly in this process."""
    if not products_are_right():
        raise RuntimeError(
            "this version of jaxlib computes some matrix products wrongly under `jax.jit`; use "
            "`esail_jax.jit`, import `esail_jax` before JAX first uses a device, or set the variable "
            f"XLA_FLAGS={FLAG}={PRODUCTS_ALONE}"
        )
