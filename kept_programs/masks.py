"""Masks: one truth value for every argument, or for every result, of a program.

A program may lose arguments, and a mask of its arguments then loses the same places. With `kept` =
(T, F, T) for the arguments that remain, `chosen(mask, kept)` goes from the old arguments to the new ones,
such as from (F, T, T) to (F, T), and `placed(kept, mask)` goes back, to (F, F, T): what was left out is
false.
"""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp

Mask = tuple[bool, ...]


def chosen(values: Sequence, mask: Sequence[bool]) -> tuple:
    """The values for which the mask is true."""
    return tuple(x for x, is_chosen in zip(values, mask, strict=True) if is_chosen)


def not_(mask: Sequence[bool]) -> Mask:
    """The opposite mask."""
    return tuple(not x for x in mask)


def both(mask: Sequence[bool], other: Sequence[bool]) -> Mask:
    """The mask that is true where two masks are."""
    return tuple(x and y for x, y in zip(mask, other, strict=True))


def merged(mask: Sequence[bool], where_true: Sequence, where_false: Sequence) -> tuple:
    """One sequence: the values of `where_true` at the places where the mask is true, those of
    `where_false` at the others."""
    true, false = iter(where_true), iter(where_false)
    return tuple(next(true) if x else next(false) for x in mask)


def placed(mask: Mask, values: Mask) -> Mask:
    """A mask with these values at the places where `mask` is true, and false elsewhere."""
    return merged(mask, values, (False,) * mask.count(False))


def with_tangent(values: Sequence[Any]) -> Mask:
    """Which values are floating-point numbers and therefore have tangents."""
    return tuple(bool(jnp.issubdtype(x.dtype, jnp.inexact)) for x in values)
