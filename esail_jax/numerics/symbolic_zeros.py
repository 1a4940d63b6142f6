"""Derivatives along what is perturbed only.

A rule of `jax.custom_jvp` is handed tangents of all its arguments, zeros for those that nothing moves.
Taken as numbers, they cost as much as others: with the voltages alone perturbed, a reverse gradient would
also find those of every length, mass and stiffness.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero

from esail_jax.array_types import Array


def jvp_of_perturbed(function: Callable, primals: tuple, tangents: tuple) -> tuple[Any, Any]:
    """`jax.jvp` with the tangents of a rule defined with `symbolic_zeros=True`."""
    return jax.jvp(*perturbed(function, primals, tangents))


def perturbed(function: Callable, primals: tuple, tangents: tuple) -> tuple[Callable, tuple, tuple]:
    """The function of those numbers alone that something moves, with these and their tangents."""
    leaves, structure = jax.tree.flatten(primals)
    moves = jax.tree.leaves(tangents, is_leaf=is_symbolic)
    moving = [i for i, move in enumerate(moves) if not is_symbolic(move)]

    def of_moving(*some):
        found = list(leaves)
        for i, x in zip(moving, some, strict=True):
            found[i] = x
        return function(*jax.tree.unflatten(structure, found))

    return of_moving, *(tuple(x[i] for i in moving) for x in (leaves, moves))


def is_symbolic(tangent: Any) -> bool:
    """Is it the zero of something that nothing moves?"""
    return isinstance(tangent, SymbolicZero)


def materialised(tangent: Any) -> Array:
    """A tangent, a zero as numbers."""
    return jnp.zeros(tangent.shape, tangent.dtype) if is_symbolic(tangent) else tangent


def unused_matvec(x: Any) -> Any:
    """For `lax.custom_linear_solve` with both its solutions given: it asks for the matrix only to find the
    derivative by what that is made of, which must carry none. The true one would be traced for nothing."""
    return x


@jax.custom_jvp
def with_tangent_of(value: Any, of: Any) -> Any:
    """`value`, with the derivative of the quantities `of` which it is the value."""
    return value


@with_tangent_of.defjvp
def _with_tangent_of_jvp(primals, tangents):
    return primals[0], tangents[1]
