"""Keys of compiled programs: one text for everything that decides what a program computes.

A key is the SHA-256 of the program's static arguments, the shapes of its arrays, the compiler options, and
the environment: the sources of the programs, the versions of the libraries, the binary of jaxlib, the
processor, and the settings of JAX. A function or class counts by its name, so its source must be part of
the environment. A program that depends on any other code, such as a function of a user's, has no key and is
not kept.
"""

import dataclasses
import enum
import functools
import hashlib
import inspect
import os
import platform
import sys
import time
from collections.abc import Callable
from importlib import metadata, util
from pathlib import Path
from typing import Any

import jax
import numpy as np

from kept_programs.jax_internals import all_settings
from kept_programs.store import Store

OWN = Path(__file__).parent
"""The folder of this package, whose source is part of every environment."""

KNOWN = ("builtins", "functools", "kept_programs")
"""Packages whose functions and classes are known by their names in every environment."""


def processor() -> str:
    """What the processor can do, as Linux lists it; its name where the system does not."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    flags = (line.partition(":")[2].strip() for line in lines if line.startswith(("flags", "Features")))
    return next(flags, platform.processor() or platform.machine())


UNRELATED = ("cache", "log", "traceback", "warn", "explain", "dump")
"""Words in the names of JAX's settings that do not change what a program computes."""


class Unkeyed(Exception):
    """A program depends on something that has no lasting name."""


class Environment:
    """What the programs of a package depend on, besides their arguments.

    package: its name; source: its folder; libraries: those whose functions it uses, beside JAX; variables:
    environment variables that change what is compiled, beside XLA_FLAGS; machine: returns a text about the
    machine; store: where the digest of jaxlib's binary is kept.

    A file of the source that has changed since the environment was made may not be what has been imported:
    from then on no program of this process has a key."""

    def __init__(
        self,
        package: str,
        source: Path,
        store: Store,
        libraries: tuple[str, ...] = (),
        variables: tuple[str, ...] = (),
        machine: Callable[[], str] = processor,
    ):
        self.source, self.store, self.machine, self.made = source, store, machine, time.time()
        self.variables = ("XLA_FLAGS", *variables)
        self.libraries = ("jax", "jaxlib", "numpy", *libraries)
        self.known = (package, *KNOWN, *self.libraries)

    def key_of(self, *parts: Any) -> str | None:
        """The key of a program that depends on these parts and on the environment. None if a part
        has no lasting name, or if the source has changed."""
        if self.has_changed():
            return None
        try:
            text = self.text_of(parts)
        except Unkeyed:
            return None
        return hashlib.sha256(f"{self.text}\n{settings()}\n{text}".encode()).hexdigest()

    @functools.cached_property
    def files(self) -> list[tuple[Path, Path]]:
        """The files of the source, each after its folder."""
        return [(root, path) for root in (self.source, OWN) for path in sorted(root.rglob("*.py"))]

    def has_changed(self) -> bool:
        """Tells whether a file of the source may be another one than when the environment was made."""
        try:
            return any(path.stat().st_mtime > self.made for _, path in self.files)
        except OSError:  # removed
            return True

    @functools.cached_property
    def text(self) -> str:
        """The text of everything that stays the same in a process."""
        source = hashlib.sha256()
        for root, path in self.files:
            source.update(f"{path.relative_to(root)}\n".encode() + path.read_bytes())
        device = jax.devices()[0]
        parts = [
            source.hexdigest(), *(f"{name} {version(name)}" for name in self.libraries),
            digest_of(binary_of_jaxlib(), self.store), platform.python_version(), platform.platform(),
            platform.machine(), self.machine(), device.platform, device.device_kind,
            str(jax.device_count()), *(f"{name}={os.environ.get(name)}" for name in self.variables),
        ]  # fmt: skip
        return "\n".join(parts)

    def text_of(self, x: Any) -> str:
        """A text that is equal for equal values, in every process. Raises Unkeyed if there is
        none."""
        text_of = self.text_of
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
            return self.name_of(x)
        raise Unkeyed(x)

    def name_of(self, x: Any) -> str:
        """Module and name of a function or class.

        Raises Unkeyed if its package is unknown, or if the object of that name is another one: functions
        that are made within functions, and methods of objects, may share a name."""
        module, name = getattr(x, "__module__", None) or "builtins", getattr(x, "__qualname__", x.__name__)
        if isinstance(x, np.ufunc):
            module = "numpy"
        if module.partition(".")[0] not in self.known or named(module, name) is not x:
            raise Unkeyed(x)
        return f"{module}.{name}"


def named(module: str, name: str) -> Any:
    """The object of that name in a module that has been imported; None if there is none."""
    value = sys.modules.get(module)
    for part in name.split("."):
        value = getattr(value, part, None)
    return value


def version(library: str) -> str:
    """The version of a library, or an empty text if it is not installed."""
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return ""


def settings() -> str:
    """The settings of JAX that may change a program."""
    return str([x for x in all_settings() if not any(word in x[0] for word in UNRELATED)])


def binary_of_jaxlib() -> Path | None:
    """The largest shared library in the folder of jaxlib, which holds XLA; None if there is
    none."""
    spec = util.find_spec("jaxlib")
    places = () if spec is None else spec.submodule_search_locations or ()
    libraries = [
        path for place in places for path in Path(place).iterdir()
        if path.suffix in (".so", ".pyd", ".dylib", ".dll") or ".so." in path.name
    ]  # fmt: skip
    return max(libraries, key=lambda path: path.stat().st_size, default=None)


def digest_of(path: Path | None, store: Store) -> str:
    """The SHA-256 of a file, an empty text without one and if nothing is kept. Several hundred
    megabytes take some tenths of a second: the digest is kept in the store, under path, size and time of
    the file."""
    if path is None or store.location() is None:
        return ""
    seen = path.stat()
    identity = f"{path} {seen.st_size} {seen.st_mtime_ns}"
    name = f"digest-{hashlib.sha256(identity.encode()).hexdigest()}"
    kept = store.load(name)
    if kept is not None:
        return kept.decode()
    with open(path, "rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    store.save(name, digest.encode())
    return digest
