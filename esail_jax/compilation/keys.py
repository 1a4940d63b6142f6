"""Keys of compiled programs: one text for everything that decides what a program computes.

A key is the SHA-256 of the program's static arguments, the shapes of its arrays, the compiler options, and
the environment: the source of this package, the versions of the libraries, the processor, and the settings
of JAX. A function or class counts by its name, so its source must be part of the environment. A program
that depends on any other code, such as a stepper defined by a user, has no key and is not kept.
"""

import dataclasses
import enum
import functools
import hashlib
import inspect
import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

import jax
import numpy as np

from esail_jax.cores import THREADS, cores, processor

LIBRARIES = ("jax", "jaxlib", "numpy", "equinox", "diffrax", "optax", "scipy")
"""Libraries whose version is part of the environment."""

KNOWN = ("esail_jax", "builtins", "functools", *LIBRARIES)
"""Packages whose functions and classes are known by their names."""

UNRELATED = ("cache", "log", "traceback", "warn", "explain", "dump")
"""Words in the names of JAX's settings that do not change what a program computes."""


class Unkeyed(Exception):
    """A program depends on something that has no lasting name."""


def key_of(*parts: Any) -> str | None:
    """Returns the key of a program that depends on these parts and on the environment. None if a part has
    no lasting name."""
    try:
        text = text_of(parts)
    except Unkeyed:
        return None
    return hashlib.sha256(f"{environment()}\n{settings()}\n{text}".encode()).hexdigest()


def text_of(x: Any) -> str:
    """Returns a text that is equal for equal values, in every process. Raises Unkeyed if there is none."""
    match x:
        case enum.Enum():
            return f"{text_of(type(x))}.{x.name}"
        case None | bool() | int() | float() | complex() | str() | bytes():
            return f"{type(x).__name__} {x!r}"
        case np.ndarray() | np.generic():
            if x.dtype.hasobject:
                raise Unkeyed(x)
            return f"array {x.dtype} {x.shape} {hashlib.sha256(np.ascontiguousarray(x)).hexdigest()}"
        case jax.core.Tracer():
            raise Unkeyed(x)
        case jax.Array():
            return text_of(np.asarray(x))
        case np.dtype():
            return f"dtype {x}"
        case jax.ShapeDtypeStruct():
            return f"shape {x.shape} {x.dtype} {x.weak_type}"
        case tuple() | list():
            return f"{text_of(type(x))}({','.join(map(text_of, x))})"
        case dict():
            return "{" + ",".join(sorted(f"{text_of(k)}:{text_of(v)}" for k, v in x.items())) + "}"
        case set() | frozenset():
            return "{" + ",".join(sorted(map(text_of, x))) + "}"
        case functools.partial():
            return f"partial({text_of(x.func)},{text_of(x.args)},{text_of(x.keywords)})"
    if dataclasses.is_dataclass(x) and not isinstance(x, type):
        values = (f"{f.name}={text_of(getattr(x, f.name, None))}" for f in dataclasses.fields(x))
        return f"{text_of(type(x))}({','.join(values)})"
    if isinstance(x, type) or inspect.isroutine(x) or isinstance(x, np.ufunc):
        return name_of(x)
    raise Unkeyed(x)


def name_of(x: Any) -> str:
    """Returns module and name of a function or class.

    Raises Unkeyed if its package is unknown, or if it was defined within a function: several objects may
    then have one name."""
    module, name = getattr(x, "__module__", None) or "builtins", getattr(x, "__qualname__", x.__name__)
    if module.partition(".")[0] not in KNOWN or "<" in name:
        raise Unkeyed(x)
    return f"{module}.{name}"


# ---- the environment -----------------------------------------------------------------------------


@functools.cache
def environment() -> str:
    """Returns the text of everything that stays the same in a process."""
    source = hashlib.sha256()
    root = Path(__file__).parents[1]
    for path in sorted(root.rglob("*.py")):
        source.update(f"{path.relative_to(root)}\n".encode() + path.read_bytes())
    versions = [f"{name} {version(name)}" for name in LIBRARIES]
    device = jax.devices()[0]
    parts = [
        source.hexdigest(), *versions, platform.python_version(), platform.platform(), platform.machine(),
        processor("flags", "Features"), str(cores()), device.platform, device.device_kind,
        str(jax.device_count()),
        *(f"{name}={os.environ.get(name)}" for name in (THREADS, "XLA_FLAGS")),
    ]  # fmt: skip
    return "\n".join(parts)


def version(library: str) -> str:
    """Returns the version of a library, or an empty text if it is not installed."""
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return ""


def settings() -> str:
    """Returns the settings of JAX that may change a program."""
    names = (name for name in sorted(jax.config.values) if not any(word in name for word in UNRELATED))
    values = jax.config.values  # of the process; an attribute is the value in the current context
    return str([(name, getattr(jax.config, name, values[name])) for name in names])
