"""Compiler options for a CPU, and how programs are lowered that are compiled with them.

XLA can hand matrix products to a library. Its default hands sums over the three components to the library,
too, which makes the baseline 12 % slower; here the library gets matrix products only. The options do not
change what a program computes, apart from rounding.
"""

import contextlib
import contextvars
import os
import threading
import warnings
from collections.abc import Iterator

import jax

from esail_jax.compilation.workaround import FLAG, PRODUCTS_ALONE, PRODUCTS_FUSED, refuse_wrong_products

Options = dict[str, str | bool | int]

FUSION_TYPE = FLAG.removeprefix("--")
"""The option that says which operations XLA hands to the library."""

HAS_LOOP_EMITTER = jax.__version_info__ < (0, 11)
"""True if XLA has its older emitter of loops, which compiles in a third less time and gives equal speed."""

COMPILER_OPTIONS: Options = {FUSION_TYPE: PRODUCTS_ALONE} | (
    {"xla_cpu_use_fusion_emitters": False} if HAS_LOOP_EMITTER else {}
)
"""Options of `jax.jit` on a CPU. Only matrix products use the library, and none of the operations around
them. With XLA's default the library also computes short sums, which makes the baseline 12 % slower and an
iteration of sixteen sails in lockstep 50 % slower."""

REQUEST = "ESAIL_FUSED_PRODUCTS"
"""Environment variable that says `on` to let the library compute the operations around products in the
steps of a run, too. A run of the baseline takes 15 to 20 % less time, but some products may be wrong
(`workaround.py`)."""

STEP_OPTIONS: Options = COMPILER_OPTIONS | (
    {FUSION_TYPE: PRODUCTS_FUSED}
    if os.environ.get(REQUEST, "").lower() in ("on", "1", "yes", "true")
    else {}
)
"""Options for the steps of a sail that is not differentiated."""

CHAIN_OPTIONS: Options = COMPILER_OPTIONS | {FUSION_TYPE: ""}
"""Options for rod chains with explicit methods. Nothing uses the library: its small products make a run of
two bodies joined by ten rods 1.8 times as long."""

LOOK_OPTIONS: Options = COMPILER_OPTIONS | {"xla_backend_optimization_level": 1}
"""Options for programs that compute the observables of saved instants. They compile in 20 % less time and
are as fast."""

START_OPTIONS: Options = COMPILER_OPTIONS | {"xla_backend_optimization_level": 0}
"""Options for programs that run once, such as the start of a run. They compile in a quarter of the time
(0.8 instead of 3.1 s)."""


OURS = contextvars.ContextVar("OURS", default=False)
"""True while a program is traced or lowered that will be compiled with these options."""

LOWERING = threading.RLock()
"""Held by the thread that lowers a program."""


def lower(traced: jax.stages.Traced) -> jax.stages.Lowered:
    """Lowers a traced function that will be compiled with these options.

    An operation keeps its own line of source, but not those of the calls around it: executables are up to a
    third smaller and load in a sixth less time. The setting belongs to the process, so that one thread at a
    time changes it and puts it back."""
    with LOWERING, compiled_by_us():
        whole = jax.config.jax_include_full_tracebacks_in_locations
        jax.config.update("jax_include_full_tracebacks_in_locations", False)
        try:
            return traced.lower()
        finally:
            jax.config.update("jax_include_full_tracebacks_in_locations", whole)


@contextlib.contextmanager
def compiled_by_us() -> Iterator[None]:
    """Context manager: what is traced or lowered within it will be compiled with these options."""
    token = OURS.set(True)
    try:
        yield
    finally:
        OURS.reset(token)


def refuse_in_plain_jit() -> None:
    """Raises RuntimeError if a program of this package becomes part of one that is
    compiled with other options, and that may compute products wrongly."""
    if not OURS.get():
        refuse_wrong_products()


def compiled(lowered: jax.stages.Lowered, options: Options) -> jax.stages.Compiled:
    """Compiles a lowered program, without the options that this version of XLA does not know: a later one
    costs time, not results."""
    try:
        return lowered.compile(compiler_options=options)
    except jax.errors.JaxRuntimeError as error:
        unknown = [name for name in options if f"'{name}'" in str(error)]
        if not unknown:
            raise
    warnings.warn(
        f"this version of jaxlib has no compiler option `{unknown[0]}`, so that programs may be slower",
        stacklevel=2,
    )
    return compiled(lowered, {name: x for name, x in options.items() if name not in unknown})
