"""Programs that a test runs once or a few times: compiled quickly, not well; and cases run by default."""

import functools

import jax
import pytest

from esail_jax.compiler import COMPILER_OPTIONS

QUICKLY = (COMPILER_OPTIONS or {}) | {
    "xla_backend_optimization_level": 0,
    "xla_llvm_disable_expensive_passes": True,
}
"""Compiler options. A whole run under a trace, with its derivative, compiles in less than half
the time (measured: 17 for 38 s) and runs in twice that, which is some tenths of a second."""

jit = functools.partial(jax.jit, compiler_options=QUICKLY)


def quickly(cases):
    """Cases for `parametrize`, all but the first slow."""
    return [pytest.param(case, marks=[pytest.mark.slow] * (i > 0)) for i, case in enumerate(cases)]
