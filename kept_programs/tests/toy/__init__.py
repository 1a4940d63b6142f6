"""A small package whose programs are kept."""

import enum
from typing import NamedTuple

import jax.numpy as jnp
from jax import lax


class Kind(enum.Enum):
    """Members that differ in their names only."""

    NUMBER = "number"
    INTEGER = "integer"


class Pair(NamedTuple):
    """A type of the package."""

    x: int
    y: int


def square(factor, x):
    """One operation or two."""
    return factor * x**2


def cube(x):
    """One argument."""
    return x**3


def power(n, x):
    """The type of the result depends on that of a static number."""
    return n * x


def inverse(zero, x):
    """The sign of the result depends on that of a zero."""
    return x / zero


def dot(a, b):
    """Scalar products of rows."""
    return (a * b).sum(1)


def pendulums(x, y, count):
    """Steps of pendulums: results of several types, a loop, and a result that depends on one argument."""

    def step(state, _):
        return (state[0] + 0.1 * state[1], state[1] - 0.1 * y * jnp.sin(state[0])), state[0]

    (angle, rate), path = lax.scan(step, (x, jnp.zeros_like(x)), None, length=3)
    return {"angle": angle, "path": path, "steps": count + 3, "length": 9.81 / y, "rate": rate.sum()}
