"""The programs of this package that are kept on the disk: `kept_programs` with our store and options."""

import contextlib
import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path

import jax

from esail_jax.compilation.notebook_line import compiler_at_work
from esail_jax.compilation.options import (
    COMPILER_OPTIONS,
    Options,
    compiled,
    compiled_by_us,
    lower,
    refuse_in_plain_jit,
)
from esail_jax.compilation.stored import STORE
from esail_jax.cores import THREADS, cores, processor
from kept_programs import program, remembered
from kept_programs.keys import Environment
from kept_programs.program import Keeper, TreeProgram

SWITCH = "ESAIL_PRIMITIVE"
"""Environment variable that says `off` to call programs through plain `jax.jit`."""

ENVIRONMENT = Environment(
    "esail_jax",
    Path(__file__).parents[1],
    STORE,
    libraries=("equinox", "diffrax", "optax", "scipy"),
    variables=(THREADS, SWITCH),
    machine=lambda: f"{processor('flags', 'Features')} {cores()}",
)


@contextlib.contextmanager
def at_work() -> Iterator[None]:
    """Context manager around the tracing and compiling of our programs."""
    with compiler_at_work(), compiled_by_us():
        yield


KEEPER = Keeper(
    STORE,
    ENVIRONMENT,
    lower=lower,
    before_lowering=refuse_in_plain_jit,
    at_work=at_work,
    switch=SWITCH,
    remedy="clear it by `esail cache --clear`",
)

key_of = ENVIRONMENT.key_of


@dataclasses.dataclass(frozen=True)
class Compile:
    """Compiles a lowered program. options: XLA's, as pairs."""

    options: tuple[tuple[str, str | bool | int], ...]

    def __call__(self, lowered: jax.stages.Lowered) -> jax.stages.Compiled:
        return compiled(lowered, dict(self.options))


def program_of(
    function: Callable, static: tuple, arguments: tuple, options: Options = COMPILER_OPTIONS
) -> TreeProgram:
    """The program of `function(*static, *arguments)`.

    function: of this package; static: hashable; arguments: trees of arrays, tracers or types; options:
    XLA's."""
    compile = Compile(tuple(options.items()))
    return program.program_of(KEEPER, function, static, arguments, compile)


def tree_program(function: Callable, arguments: tuple, key: str | None) -> TreeProgram:
    """The program of `function(*arguments)`. arguments: trees of types; key: name in the store."""
    compile = Compile(tuple(COMPILER_OPTIONS.items()))
    return program.tree_program(KEEPER, function, arguments, key, compile)


def clear_caches() -> None:
    """Frees the memory of the programs of this process, those of JAX included (`jax.clear_caches`). What
    is needed again is loaded from the program cache, or compiled. A function of `esail.jit` keeps its own
    programs as long as it lives.

        esail.clear_caches()     # between two studies in one notebook"""
    remembered.clear_caches()
