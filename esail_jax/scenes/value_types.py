"""Types of the values that the keys of a scene take.

The aliases are the annotations of the tables' fields: what a key may be given. `Shape` and `Kind` are their
counterparts for the checks at run time.
"""

import enum
import sys
from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np


@runtime_checkable
class SupportsArray(Protocol):
    """An array of NumPy or JAX, traced or not. A scene is read and checked without importing JAX, which
    takes longer than the rest."""

    def __array__(self) -> np.ndarray: ...


Number = float | SupportsArray
"""One number: an int, a float, or an array of shape ()."""

NumberList = Sequence[float] | SupportsArray
"""A list, tuple or array of numbers."""

PerMember = Number | NumberList
"""One number for all members (tethers or rods), or a list with one number per member."""

Series = Number | NumberList
"""One number, or a list with one number per instant."""

Vector = NumberList
"""Three numbers: x, y, z."""

Vectors = NumberList | Sequence[NumberList]
"""One vector for all members, or a list with one vector per member."""

Matrix = SupportsArray | Sequence[NumberList]
"""Three rows of three numbers."""

Grid = NumberList | Sequence[NumberList]
"""A list with one number per row, or a list of rows with one number per member."""


History = NumberList | Sequence[NumberList] | Number
"""One number, a list with one number per member, or a list with one of these per instant."""


class Shape(enum.Enum):
    """How many numbers a key takes. *Members* are the tethers of a sail or the rods of a chain."""

    SCALAR = "number"
    """One number."""

    MEMBER = "number, or list with one number per member"
    """One number for all members, or a list with one number per member."""

    VECTOR = "list of three numbers"
    """Three numbers: x, y, z."""

    VECTORS = "list of three numbers, or list with one such list per member"
    """One vector for all members, or a list with one vector per member."""

    MATRIX = "list of three lists of three numbers"
    """A tensor: three rows of three numbers."""

    LIST = "list of numbers"
    """A list of any length."""

    SERIES = "number, or list of numbers"
    """One number, or a list of any length."""

    GRID = "list of numbers, or list of lists with one number per member"
    """A list with one number per row, or a list of rows with one number per member."""

    HISTORY = "number, or list with one number per member, or list with one of these per instant"
    """One number, a list with one number per member, or a list with one of these per instant. Whether a
    list of numbers belongs to members or instants, other keys tell."""


class Kind(enum.Enum):
    """What sort of value a key takes."""

    NUMBER = "number"
    """Real numbers: the only kind that may be a JAX array."""

    INTEGER = "integer"
    """Positive integers."""

    CHOICE = "choice"
    """One of a few names."""

    SWITCH = "switch"
    """True or false."""


def is_traced(value: Any) -> bool:
    """Tells whether a value is a tracer: a number under `jit`, `grad` or `vmap`."""
    return "jax" in sys.modules and isinstance(value, sys.modules["jax"].core.Tracer)


def is_jax_array(value: Any) -> bool:
    """Tells whether a value is a JAX array, traced or not."""
    return "jax" in sys.modules and isinstance(value, sys.modules["jax"].Array)
