"""A user's voltage law, divided into its structure and its numbers, and put together again.

The numbers are arguments of the compiled programs, so that other numbers need no compilation and have
derivatives. The structure decides which program is compiled.
"""

import dataclasses
import hashlib
import re
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
    """Name and checksum of a law: a run file holds it, so that the run goes on under the same law."""
    digest = hashlib.sha256()
    leaves, tree = jax.tree.flatten(law)
    for leaf in leaves:
        if is_number(leaf):
            digest.update(np.ascontiguousarray(np.asarray(leaf)).tobytes())
        else:
            digest.update(without_addresses(getattr(leaf, "__qualname__", repr(leaf))))
    digest.update(without_addresses(str(tree)))
    return f"{type(law).__module__}.{type(law).__qualname__} {digest.hexdigest()[:16]}"


def without_addresses(text: str) -> bytes:
    """The description of an object without its address in memory, which is another in every process."""
    return re.sub(r" at 0x[0-9a-f]+", "", text).encode()
