"""Compiled matrix products are right for any right factor.

The library that computes them is wrong if each row of the right factor repeats one number
(`esail_jax/compiler.py`).
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.compiler import COMPILER_OPTIONS, compiled, uniform_factor

LEFT = np.random.default_rng(0).normal(size=(4, 4))

FACTORS = {
    "one number": lambda x: jnp.broadcast_to(x[0], (4, 12)),
    "one number a row": lambda x: jnp.broadcast_to(x[:4, None], (4, 12)),
    "four numbers three times a row": lambda x: jnp.broadcast_to(x[:4], (4, 3, 4)).reshape(4, 12),
    "any": lambda x: x.reshape(4, 12),
}
NUMBERS = np.random.default_rng(1).normal(size=48)


@pytest.mark.parametrize("factor", FACTORS)
@pytest.mark.parametrize("how", ["compiled", "options"])
def test_product_with_any_right_factor(factor, how):
    """A B is right to rounding, also if all columns of B are equal.

    The programs are compiled by `compiled`, or by `jax.jit` with the package's options. Entries are sums
    of four products of numbers near one.
    """

    def product(left, x):
        return left @ FACTORS[factor](x)

    if how == "compiled":
        program = compiled(jax.jit(product).lower(LEFT, NUMBERS))
    else:
        program = jax.jit(product, compiler_options=COMPILER_OPTIONS)
    expected = LEFT @ np.asarray(FACTORS[factor](NUMBERS))
    np.testing.assert_allclose(program(LEFT, NUMBERS), expected, rtol=0, atol=1e-14)


IN_LIBRARY = """
%computation (left: f64[4,4], x: {given}) -> f64[4,12] {{
  %left = f64[4,4]{{1,0}} parameter(0)
  %x = {given}{{0}} parameter(1)
{lines}
  ROOT %product = f64[4,12]{{1,0}} dot(%left, %right), lhs_contracting_dims={{1}}
}}

ENTRY %main (l: f64[4,4], x.1: {given}) -> f64[4,12] {{
  ROOT %made = f64[4,12]{{1,0}} fusion(%l, %x.1), kind={kind}, calls=%computation, backend_config={config}
}}
"""
"""The text of a compiled program, as jaxlib 0.10.2 writes it."""

BROADCAST = "  %right = f64[4,12]{1,0} broadcast(%x), dimensions={0}"
SPREAD = "  %y = f64[4,3,4]{2,1,0} broadcast(%x), dimensions={2}\n  %right = f64[4,12]{1,0} bitcast(%y)"
ARRAY = "  %right = f64[4,12]{1,0} bitcast(%x)"
LIBRARY = {"kind": "kCustom", "config": '{"fusion_config":{"kind":"__ynn_fusion"}}'}
LOOP = {"kind": "kLoop", "config": "{}"}


@pytest.mark.parametrize(
    ("given", "lines", "place", "refused"),
    [
        ("f64[4]", BROADCAST, LIBRARY, True),
        ("f64[4]", SPREAD, LIBRARY, True),
        ("f64[48]", ARRAY, LIBRARY, False),
        ("f64[4]", BROADCAST, LOOP, False),
    ],
    ids=["broadcast", "reshaped broadcast", "array", "outside the library"],
)
def test_uniform_factor_is_seen(given, lines, place, refused):
    """A right factor that the library would read from a broadcast is found in the text of a compiled
    program.

    This includes reshaped broadcasts. Arrays in memory and products outside the library are not reported.
    """
    assert uniform_factor(IN_LIBRARY.format(given=given, lines=lines, **place)) == refused
