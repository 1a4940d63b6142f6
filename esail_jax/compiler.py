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

QUICK_COMPILE = (
    COMPILER_OPTIONS | {"xla_cpu_use_fusion_emitters": False} if COMPILER_OPTIONS is not None else None
)
"""XLA's older way of writing loops for the CPU takes a third less compile time and makes the step of
generalized-alpha a tenth slower (64 for 58 us on the baseline): a gain for every first run shorter than
two hundred thousand steps."""
