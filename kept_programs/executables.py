"""Executables of compiled programs, and what is known of programs, in the files of a store."""

import contextlib
import pickle
from collections.abc import Callable
from typing import Any

import jax
from jax.experimental import serialize_executable

from kept_programs.cache_hits import HITS
from kept_programs.jax_internals import connect_lapack
from kept_programs.memory import returning_freed_memory
from kept_programs.store import Store

LAPACK = b"lapack_"
"""First letters of the names under which an executable calls LAPACK."""


def load(store: Store, key: str | None, kind: str) -> Any:
    """An object from a store, or None."""
    data = None if key is None else store.load(f"{key}-{kind}")
    if data is None:
        return None
    with contextlib.suppress(Exception):  # from other versions of a library, for example
        return pickle.loads(data)
    return None


def save(store: Store, key: str | None, kind: str, value: Any) -> None:
    """Writes an object to a store."""
    if key is not None:
        store.save(f"{key}-{kind}", pickle.dumps(value))


def is_kept(store: Store, key: str | None) -> bool:
    """Tells whether a store has a file for this executable."""
    return key is not None and store.has(f"{key}-executable")


@returning_freed_memory()
def load_executable(store: Store, key: str | None, trees: tuple | None = None) -> Callable | None:
    """An executable from a store, or None. trees: structures of arguments and results, if these
    are not lists of arrays."""
    kept = load(store, key, "executable")
    if kept is None:
        return None
    with contextlib.suppress(Exception):  # of another version of XLA, for example
        serialised, arguments, results = kept
        if LAPACK in serialised:
            connect_lapack()
        if trees is None:
            trees = jax.tree.structure(((0,) * arguments, {})), jax.tree.structure([0] * results)
        return serialize_executable.deserialize_and_load(serialised, *trees)
    return None


@returning_freed_memory()
def compile_and_save(
    store: Store, key: str | None, compile: Callable[[], jax.stages.Compiled]
) -> jax.stages.Compiled:
    """Compiles a program and writes its executable to a store.

    Executables for several devices are not kept. Neither are those that JAX has loaded from its own
    compilation cache: XLA serialises them without some of their functions."""
    hits = HITS.count
    compiled = compile()
    if key is None or jax.device_count() > 1 or HITS.count > hits or store.location() is None:
        return compiled
    with contextlib.suppress(Exception):  # some programs cannot be serialised
        serialised, arguments, results = serialize_executable.serialize(compiled)
        save(store, key, "executable", (serialised, arguments.num_leaves, results.num_leaves))
    return compiled
