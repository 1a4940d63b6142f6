"""Products of matrices that are right whatever their factors: the library they are handed to is not for a
right factor whose rows are one number over and over (`esail_jax/compiler.py`)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.compiler import COMPILER_OPTIONS, TOGETHER, compiled, uniform_factor

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
    """A B to rounding (sums of four products of numbers near one), also where all columns of B are equal:
    from a program of the package, and from a `jax.jit` with its options."""

    def product(left, x):
        return left @ FACTORS[factor](x)

    if how == "compiled":
        program = compiled(jax.jit(product).lower(LEFT, NUMBERS))
    else:
        program = jax.jit(product, compiler_options=COMPILER_OPTIONS)
    expected = LEFT @ np.asarray(FACTORS[factor](NUMBERS))
    np.testing.assert_allclose(program(LEFT, NUMBERS), expected, rtol=0, atol=1e-14)


@pytest.mark.skipif(COMPILER_OPTIONS is None, reason="JAX 0.11 has options of other names")
@pytest.mark.parametrize("factor", FACTORS)
def test_uniform_factor_is_seen(factor):
    """What the library would have to read from a broadcast is seen in the compiled program, and a product
    of two arrays that stand in memory is not taken for it."""
    lowered = jax.jit(lambda left, x: left @ FACTORS[factor](x)).lower(LEFT, NUMBERS)
    text = lowered.compile(compiler_options=TOGETHER).as_text()
    assert "__ynn_fusion" in text
    assert uniform_factor(text) == (factor != "any")
