"""Derivatives along what is perturbed only.

A rule of `jax.custom_jvp` is handed tangents of all its arguments, zeros for those that nothing moves.
Taken as numbers, they cost as much as others: with the voltages alone perturbed, a reverse gradient would
also find those of every length, mass and stiffness.
"""

from collections.abc import Callable
from typing import Any

import jax
from jax.custom_derivatives import SymbolicZero


def jvp_of_perturbed(function: Callable, primals: tuple, tangents: tuple) -> tuple[Any, Any]:
    """`jax.jvp` with the tangents of a rule defined with `symbolic_zeros=True`."""
    leaves, structure = jax.tree.flatten(primals)
    moves = jax.tree.leaves(tangents, is_leaf=lambda x: isinstance(x, SymbolicZero))
    moving = [i for i, move in enumerate(moves) if not isinstance(move, SymbolicZero)]

    def of_moving(*some):
        found = list(leaves)
        for i, x in zip(moving, some, strict=True):
            found[i] = x
        return function(*jax.tree.unflatten(structure, found))

    some, along = (tuple(x[i] for i in moving) for x in (leaves, moves))
    return jax.jvp(of_moving, some, along)


@jax.custom_jvp
def known(value: Any, of: Any) -> Any:
    """`value`, with the derivative of the quantities `of` which it is the value."""
    return value


@known.defjvp
def _known_jvp(primals, tangents):
    return primals[0], tangents[1]
