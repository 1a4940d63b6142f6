"""Forward derivatives that skip inputs with a symbolic zero tangent.

A rule of `jax.custom_jvp` receives the tangents of all its arguments, symbolic zeros for those that do not
depend on the differentiated inputs. Turned into arrays of zeros, they cost as much as other tangents: a
reverse gradient with respect to the voltages would then also compute the derivatives with respect to every
length, mass and stiffness.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.custom_derivatives import SymbolicZero

from esail_jax.array_types import Array
from esail_jax.numerics.own_derivative import custom_jvp


def jvp_of_perturbed(function: Callable, primals: tuple, tangents: tuple) -> tuple[Any, Any]:
    """Computes `jax.jvp` for the tangents that a rule defined with `symbolic_zeros=True` receives."""
    return jax.jvp(*perturbed(function, primals, tangents))


def perturbed(function: Callable, primals: tuple, tangents: tuple) -> tuple[Callable, tuple, tuple]:
    """`function` as a function of only those leaves whose tangent is not a symbolic zero, with
    these leaves and their tangents."""
    leaves, structure = jax.tree.flatten(primals)
    moves = jax.tree.leaves(tangents, is_leaf=is_symbolic)
    moving = [i for i, move in enumerate(moves) if not is_symbolic(move)]

    def of_moving(*some):
        merged = list(leaves)
        for i, x in zip(moving, some, strict=True):
            merged[i] = x
        return function(*jax.tree.unflatten(structure, merged))

    at, along = (tuple(x[i] for i in moving) for x in (leaves, moves))
    return of_moving, at, along


def is_symbolic(tangent: Any) -> bool:
    """Tells whether a tangent is a symbolic zero."""
    return isinstance(tangent, SymbolicZero)


def materialised(tangent: Any) -> Array:
    """A tangent as an array; a symbolic zero becomes an array of zeros."""
    return jnp.zeros(tangent.shape, tangent.dtype) if is_symbolic(tangent) else tangent


def nothing_of(like: Any) -> Any:
    """Zeros of the same shapes and types."""
    return jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), like)


def bundled(rhs: Any) -> Any:
    """The right-hand sides of a `lax.custom_linear_solve` as one bundle: if one of them has a
    tangent, all have. JAX cannot transpose the solve if some of several right-hand sides have none.

    JAX 0.11 and later cannot transpose a barrier one of whose operands is constant. There every right-hand
    side gets a zero added that depends on all of them, which the compiler removes."""
    if CONSTANTS_IN_BARRIERS:
        return lax.optimization_barrier(rhs)
    zero = linear_zero(jax.tree.leaves(rhs))
    return lax.optimization_barrier(jax.tree.map(lambda x: x + zero, rhs))


def linear_zero(arrays: list[Array]) -> Array | int:
    """Zero as a sum that is linear in the arrays, and zero for any of them, infinite ones
    included."""
    return sum(jnp.where(False, x.sum(), 0.0) for x in arrays)


def tied(values: Any, other: Any) -> Any:
    """The values as results that depend on other results of the same `lax.custom_linear_solve`:
    with a zero added that is linear in these, and that the compiler removes.

    The cotangent of a result that nothing needs is a constant. Its tangent is a symbolic zero, of which JAX
    makes no array where it differentiates the solve once more."""
    zero = linear_zero(jax.tree.leaves(other))
    return jax.tree.map(lambda x: x + zero, values)


CONSTANTS_IN_BARRIERS = jax.__version_info__ < (0, 11)
"""True if JAX transposes a barrier with constant operands (jax/_src/lax/lax.py, optimization_barrier)."""


@custom_jvp
def with_tangent_of(value: Any, of: Any) -> Any:
    """`value` with the tangent of `of`: the two are numerically equal, but only `of` is
    differentiated."""
    return value


@with_tangent_of.defjvp
def _with_tangent_of_jvp(primals, tangents):
    return with_tangent_of(*primals), tangents[1]


@jax.custom_jvp
def with_tangents(values: Any, of: Any) -> Any:
    """The values. If anything in `of` is differentiated, every value has a tangent that is an
    array, also where it would be a symbolic zero.

    JAX traces the derivative of a `lax.scan` again until the set of symbolic zeros in the carry no longer
    changes. If no part of the first carry is a symbolic zero, it is traced once."""
    return of_every_member(values, of)


@with_tangents.defjvp
def _with_tangents_jvp(primals, tangents):
    leaves = jax.tree.leaves(tangents[1])
    moves = [jnp.asarray(t) for t in leaves if np.result_type(t) != jax.dtypes.float0]
    zero = linear_zero(moves)
    return of_every_member(*primals), jax.tree.map(lambda t: t + zero, tangents[0])


def of_every_member(values: Any, of: Any) -> Any:
    """The values as numbers of every member, if `of` differs between the members of a batch: JAX
    0.10 fails where tangents differ and values do not. The compiler removes the selection."""
    numbers = [jnp.asarray(x) for x in jax.tree.leaves(of)]
    # Both choices are the values: the condition is there for its axis of members only (`lockstep.py`).
    token = linear_zero([x for x in numbers if jnp.issubdtype(x.dtype, jnp.floating)])
    return jax.tree.map(lambda x: jnp.where(token == token, x, x), values)
