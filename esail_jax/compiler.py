"""Options of the compiler for the package's own programs on a CPU.

A `jax.jit` around `simulate` gets them by `jax.jit(f, compiler_options=esail_jax.COMPILER_OPTIONS)`.
"""

import jax

COMPILER_OPTIONS = (
    {"xla_cpu_experimental_ynn_fusion_type": "LIBRARY_FUSION_TYPE_DOT"}
    if jax.__version_info__ < (0, 11)
    else None
)
"""Only matrix products go to the library of kernels. It takes sums over the three components too, with all
that stands around them, and makes an iteration of sixteen sails in lockstep half as slow again as the
compiler's own loops do. Later versions of JAX have options of other names."""


def with_options(**more: str | bool | int) -> dict[str, str | bool | int] | None:
    """Those and more."""
    return None if COMPILER_OPTIONS is None else COMPILER_OPTIONS | more


QUICK_COMPILE = with_options(xla_cpu_use_fusion_emitters=False)
"""XLA's older way of writing loops for the CPU takes a third less compile time and makes the step of
generalized-alpha a tenth slower (64 for 58 us on the baseline): a gain for every first run shorter than
two hundred thousand steps."""

CHAIN_COMPILE = with_options(xla_cpu_use_fusion_emitters=False, xla_cpu_experimental_ynn_fusion_type="")
"""Of chains by explicit methods: nothing goes to the library, whose small products make a run of two
bodies joined by ten rods 1.8 times as long."""

ROWS_COMPILE = with_options(xla_cpu_use_fusion_emitters=False, xla_backend_optimization_level=1)
"""Of looks at saved instants: another fifth less, and as fast."""

ONCE_COMPILE = with_options(xla_cpu_use_fusion_emitters=False, xla_backend_optimization_level=0)
"""Of what runs once, the start of a run: a quarter of the time, 0.8 for 3.1 s."""
