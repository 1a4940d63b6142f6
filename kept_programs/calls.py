"""Calls of programs inside functions that JAX traces.

A program inside another function is one operation of JAX (`operation.py`). JAX promises nothing about what
such an operation needs. Where it does not work, or where the keeper's environment variable is `off`, the
function of the program is called through `jax.jit`: the results are the same, and a second process traces
and compiles it again, with JAX's own cache. So it is within `jax.shard_map`, where a result has axes of the
mesh in its type, and under `jax.disable_jit`.
"""

import functools
import os
import warnings
from typing import Any

import jax
import numpy as np

from kept_programs.nan_checks import unchecked
from kept_programs.program import Keeper, TreeProgram
from kept_programs.self_check import fault
from kept_programs.store import CACHE_OF_JAX, OFF


def call(program: TreeProgram, *arguments: Any, recompute: bool = False, expected: Any = None) -> Any:
    """The result of a program. Some of the arguments may be tracers.

    recompute: as in `operation.Reverse`; expected: a function that returns that mask as a tree, from the
    result with types in place of arrays."""
    leaves = program.leaves(arguments)
    if not is_one_operation(program.program.keeper):
        use_cache_of_jax(program.program.keeper)
        return called_plainly(program, arguments)
    from kept_programs.operation import Reverse, bind

    mask = None if expected is None else tuple(jax.tree.leaves(expected(program.result)))
    return program.unflatten(bind(program.program, *leaves, reverse=Reverse(recompute, mask)))


def called_plainly(program: TreeProgram, arguments: tuple) -> Any:
    """The result of a program as that of a function of `jax.jit`. Numbers of Python are arrays, as
    for the operation."""
    program.program.keeper.before_lowering()
    arguments = jax.tree.map(lambda x: x if hasattr(x, "dtype") else np.asarray(x), arguments)
    return unchecked(program.plain, *arguments)


def is_one_operation(keeper: Keeper) -> bool:
    """Tells whether a call is one operation of JAX."""
    plain = jax.config.jax_disable_jit or not jax.sharding.get_abstract_mesh().empty
    return not plain and not is_off(keeper.switch) and works(keeper)


def is_off(variable: str) -> bool:
    """Tells whether an environment variable says `off`."""
    return os.environ.get(variable, "").lower() in OFF


@functools.lru_cache(maxsize=16)
def works(keeper: Keeper) -> bool:
    """Tells whether the operation computes what it should with this version of JAX. Warns, once in a
    process, if it does not."""
    reason = fault(keeper)
    if reason:
        warnings.warn(
            f"with JAX {jax.__version__} derivatives are compiled anew in every process, because its "
            f"interface for operations is another one ({reason}); results are not concerned",
            stacklevel=2,
        )
    return not reason


@functools.lru_cache(maxsize=16)
def use_cache_of_jax(keeper: Keeper) -> None:
    """Lets JAX keep what it compiles, in a folder of the store, unless the user has chosen one."""
    folder = keeper.store.private_folder(create=True)
    if folder is not None and jax.config.jax_compilation_cache_dir is None:
        jax.config.update("jax_compilation_cache_dir", str(folder / CACHE_OF_JAX))
