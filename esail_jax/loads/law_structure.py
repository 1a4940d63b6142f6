"""A user's voltage law, divided into its structure and its numbers, and put together again.

The numbers are arguments of the compiled programs, so that other numbers need no compilation and have
derivatives. The structure decides which program is compiled.
"""

import ast
import contextlib
import dataclasses
import hashlib
import inspect
import re
import textwrap
from collections.abc import Iterator
from types import CodeType, FunctionType
from typing import Any

import jax
import numpy as np

from esail_jax.array_types import Array


@dataclasses.dataclass(frozen=True)
class LawStructure:
    """What is no number in a user's law or term: the tree of its fields, its other leaves with None in
    place of the numbers, and a checksum of what its methods read from outside (`reads_of`)."""

    tree: Any
    others: tuple[Any, ...]
    reads: str = ""

    def law(self, numbers: tuple[Array, ...]) -> Any:
        """The law with the given numbers."""
        rest = iter(numbers)
        leaves = [next(rest) if other is NUMBER else other for other in self.others]
        return jax.tree.unflatten(self.tree, leaves)


LIBRARIES = {"builtins", "equinox", "esail_jax", "jax", "jaxlib", "numpy"}
"""Packages whose code has no part in the checksum of a law."""

NUMBER = None
"""What stands for a number among the leaves of a structure. No leaf is None."""


def divided(law: Any) -> tuple[LawStructure, tuple[Array, ...]]:
    """The structure of a law and its numbers."""
    leaves, tree = jax.tree.flatten(law)
    numbers = tuple(array_of(x) for x in leaves if is_number(x))
    others = tuple(NUMBER if is_number(x) else x for x in leaves)
    written = {"fields": without_addresses(str(tree)).decode(), "others": [repr(x) for x in others]}
    return LawStructure(tree, others, digest_of(reads_of(law) | written)), numbers


def is_number(leaf: Any) -> bool:
    """Tells whether a leaf is an array, a floating-point or a complex number. Other integers and logical
    values decide what is compiled."""
    return isinstance(leaf, jax.Array | np.ndarray | np.inexact | float | complex)


def array_of(leaf: Any) -> Array:
    """A number as an array of a definite type."""
    if isinstance(leaf, jax.core.Tracer):
        return leaf
    return jax.device_put(np.asarray(leaf))


def identity_of(law: Any) -> str:
    """Name and checksum of a law: a run file holds it, so that the run goes on under the same law.

    The checksum is that of the law's numbers, of the source of its methods without comments, and of what
    these read from outside: numbers and texts, and functions of the user's own. A method whose source
    cannot be read has no part in it."""
    digest = hashlib.sha256()
    leaves, tree = jax.tree.flatten(law)
    for leaf in leaves:
        if is_number(leaf):
            digest.update(np.ascontiguousarray(np.asarray(leaf)).tobytes())
        else:
            digest.update(without_addresses(getattr(leaf, "__qualname__", repr(leaf))))
    digest.update(without_addresses(str(tree)))
    for text in sorted({text for own in classes_of(law) for text in sources_of(own)}):
        digest.update(text.encode())
    digest.update(digest_of(reads_of(law)).encode())
    return f"{type(law).__module__}.{type(law).__qualname__} {digest.hexdigest()[:16]}"


def classes_of(law: Any) -> Iterator[type]:
    """The classes of a law and of the laws among its fields, with their bases. Those of libraries are left
    out."""
    for own in type(law).__mro__:
        if own.__module__.partition(".")[0] not in LIBRARIES:
            yield own
    if dataclasses.is_dataclass(law):
        for field in dataclasses.fields(law):
            yield from classes_of(getattr(law, field.name, None))


def methods_of(own: type) -> Iterator[FunctionType]:
    """The functions of the methods and properties of a class."""
    for name in vars(own):
        method = getattr(own, name)
        method = inspect.unwrap(getattr(method, "fget", method))
        if inspect.isfunction(method):
            yield method


def sources_of(own: type) -> Iterator[str]:
    """The sources of the methods of a class, without comments."""
    for method in methods_of(own):
        text = source_of(method)
        if text is not None:
            yield text


def source_of(function: FunctionType) -> str | None:
    """The source of a function without comments; None if it cannot be read, as in a class without a file,
    or of a lambda within a line."""
    try:
        return ast.unparse(ast.parse(textwrap.dedent(inspect.getsource(function))))
    except (OSError, SyntaxError):
        return None


def reads_of(law: Any) -> dict[str, Any]:
    """What the methods of a law read from outside, by name: numbers, texts and lists of them, and the code
    of the user's functions, with what these read. JAX traces a method once; what it reads is then part of
    the program."""
    reads: dict[str, Any] = {
        f"{own.__qualname__}.{name}": value
        for own in classes_of(law)
        for name, value in vars(own).items()
        if not name.startswith("__") and is_plain(value)
    }
    waiting = [method for own in classes_of(law) for method in methods_of(own)]
    while waiting:
        function = waiting.pop()
        for name, value in outside_of(function).items():
            key = f"{function.__module__}.{name}"
            if key in reads or isinstance(value, jax.core.Tracer):
                continue
            if is_plain(value):
                reads[key] = value
            elif inspect.isfunction(value) and value.__module__.partition(".")[0] not in LIBRARIES:
                reads[key] = source_of(value) or value.__code__.co_code.hex()
                waiting.append(value)
    return reads


def outside_of(function: FunctionType) -> dict[str, Any]:
    """The names that a function, and what is defined in it, reads from outside, with their values."""
    names, codes = set(), [function.__code__]
    while codes:
        code = codes.pop()
        names |= set(code.co_names)
        codes += [x for x in code.co_consts if isinstance(x, CodeType)]
    values = {name: function.__globals__[name] for name in names if name in function.__globals__}
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        with contextlib.suppress(ValueError):  # a cell that is still empty
            values[name] = cell.cell_contents
    return values


def is_plain(value: Any) -> bool:
    """Tells whether a value is a number, a text, an array, or a list or dictionary of such."""
    if isinstance(value, list | tuple):
        return all(map(is_plain, value))
    if isinstance(value, dict):
        return all(map(is_plain, value.values()))
    if isinstance(value, jax.core.Tracer):
        return False
    return isinstance(value, bool | int | float | complex | str | np.ndarray | np.generic | jax.Array)


def digest_of(reads: dict[str, Any]) -> str:
    """A checksum of what methods read from outside; empty if that is nothing."""
    if not reads:
        return ""
    digest = hashlib.sha256()
    for key in sorted(reads):
        digest.update(key.encode())
        for leaf in jax.tree.leaves(reads[key]):
            array = np.asarray(leaf) if isinstance(leaf, np.ndarray | jax.Array) else None
            digest.update(without_addresses(repr(leaf)) if array is None else array.tobytes())
    return digest.hexdigest()[:16]


def without_addresses(text: str) -> bytes:
    """The description of an object without its address in memory, which is another in every process."""
    return re.sub(r" at 0x[0-9a-f]+", "", text).encode()
