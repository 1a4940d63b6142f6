"""Two ways to save time: `jit` compiles quickly, `quickly` marks all cases but some as nightly."""

import functools

import jax
import pytest

from esail_jax.compilation.options import COMPILER_OPTIONS, START_OPTIONS
from esail_jax.scenes.build import build

QUICKLY = COMPILER_OPTIONS | {
    "xla_backend_optimization_level": 0,
    "xla_llvm_disable_expensive_passes": True,
}
"""Compiler options for programs that a test runs once or a few times. A traced run with its derivative
compiles in less than half the time (17 instead of 38 s). Its run time doubles, to some tenths of a
second."""

jit = functools.partial(jax.jit, compiler_options=QUICKLY)

build_jitted = jax.jit(build, static_argnums=0, compiler_options=START_OPTIONS)
"""`build`, as a program."""


def quickly(cases, kept=()):
    """Cases for `parametrize`; all are marked nightly but those in `kept`, or but the first."""
    cases = list(cases)
    kept = kept or cases[:1]
    return [pytest.param(case, marks=[pytest.mark.nightly] * (case not in kept)) for case in cases]
