"""A user's voltage law, divided into its structure and its numbers, and put together again.

The numbers are arguments of the compiled programs, so that other numbers need no compilation and have
derivatives. The structure decides which program is compiled.
"""

import ast
import dataclasses
import hashlib
import inspect
import re
import textwrap
from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

from esail_jax.array_types import Array


@dataclasses.dataclass(frozen=True)
class LawStructure:
    """What is no number in a user's law: the tree of its fields, and its other leaves with None in place of
    the numbers."""

    tree: Any
    others: tuple[Any, ...]

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
    return LawStructure(tree, tuple(NUMBER if is_number(x) else x for x in leaves)), numbers


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

    The checksum is that of the law's numbers and of the source of its methods, without comments. A function
    that a method calls is not part of it, and neither is a method whose source cannot be read."""
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


def sources_of(own: type) -> Iterator[str]:
    """The sources of the methods of a class, without comments."""
    for name in vars(own):
        method = getattr(own, name)
        method = inspect.unwrap(getattr(method, "fget", method))  # also the function of a property
        if inspect.isfunction(method):
            try:
                tree = ast.parse(textwrap.dedent(inspect.getsource(method)))
            except (OSError, SyntaxError):  # a class without a file, or a lambda within a line
                continue
            yield ast.unparse(tree)


def without_addresses(text: str) -> bytes:
    """The description of an object without its address in memory, which is another in every process."""
    return re.sub(r" at 0x[0-9a-f]+", "", text).encode()
