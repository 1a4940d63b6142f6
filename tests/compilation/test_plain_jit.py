"""Matrix products are right under a user's own `jax.jit`, or a run is refused there."""

import jax
import pytest

from esail_jax.compilation.workaround import FLAG
from support.new_process import output_of

HAS_FAULT = jax.__version_info__ < (0, 11)
in_faulty_versions = pytest.mark.skipif(not HAS_FAULT, reason="jaxlib 0.11 has no such fault")

FAULT = """
import jax, jax.numpy as jnp, numpy as np
def error():
    matrix, rows = np.arange(9.0).reshape(3, 3), np.linspace(-1.0, 1.0, 3 * 16385).reshape(-1, 3)
    found = jax.jit(jax.vmap(lambda row: ((matrix @ row) ** 2).sum()))(rows)
    return float(abs(found - ((rows @ matrix.T) ** 2).sum(1)).max())
"""

RUN = """
from esail_jax.compilation.kept import tree_program
from kept_programs.calls import call
f = lambda x: call(tree_program(lambda x: 2.0 * x, (jax.ShapeDtypeStruct((), float),), "twice"), x)
def result(compiled):
    try:
        return float(compiled(1.0))
    except RuntimeError as error:
        return str(error)
print([result(jax.jit(f)), result(esail.jit(f)), result(f)])
"""


def test_import_makes_long_products_right():
    """The sums are of the order 100: some roundings. Without the flag the error is larger than 0.1."""
    assert float(output_of(f"import esail_jax as esail{FAULT}print(error())")) < 1e-11


@in_faulty_versions
def test_without_the_import_long_products_are_wrong():
    """If this fails, jaxlib is mended, and `workaround.py` is no longer needed."""
    x64 = {"JAX_ENABLE_X64": "1"}
    assert float(output_of(f"{FAULT}print(error())", **x64)) > 0.1


@in_faulty_versions
def test_a_run_in_a_plain_jit_is_refused_if_the_import_was_too_late():
    late = output_of(f"import jax; jax.devices(); import esail_jax as esail{RUN}", ESAIL_CACHE="off")
    message, own, eager = eval(late)
    assert message.startswith(
        "this version of jaxlib computes some matrix products wrongly under `jax.jit`"
    )
    assert FLAG in message and own == eager == 2.0


@pytest.mark.parametrize(
    "first", ["import esail_jax as esail; import jax", "import jax; import esail_jax as esail"]
)
def test_a_run_in_a_plain_jit_is_accepted_otherwise(first):
    assert eval(output_of(f"{first}{RUN}", ESAIL_CACHE="off")) == [2.0, 2.0, 2.0]


def test_flags_of_the_user_are_kept():
    code = "import os, esail_jax; print(os.environ['XLA_FLAGS'])"
    mine = "--xla_cpu_enable_fast_math=false"
    assert output_of(code, XLA_FLAGS=mine).split() == [mine, f"{FLAG}=LIBRARY_FUSION_TYPE_INDIVIDUAL_DOT"]
    assert output_of(code, XLA_FLAGS=f"{FLAG}=").split() == [f"{FLAG}="]
