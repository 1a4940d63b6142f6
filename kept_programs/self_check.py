"""A check of the operation: transformations of a call whose results are known.

The operation rests on names that a release of JAX may change (`jax_internals.py`). It is tried before it is
used for the first time with a version of JAX; the verdict is kept in the store."""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from kept_programs.program import Keeper, tree_program, type_of

X, Y, BATCH = np.asarray(3.0), np.asarray(2.0), np.asarray([1.0, 3.0])


def volume(x, y):
    """The function of the check, x^2 y, with a second result that its objective does not need."""
    return x**2 * y, x - y


Objective = Callable[..., jax.Array]
"""A function of x and y, which is x^2 y."""

CHECKS: dict[str, tuple[Callable[[Objective], jax.Array], object]] = {
    "jit": (lambda f: jax.jit(f)(X, Y), 18.0),
    "jvp": (lambda f: jax.jvp(f, (X, Y), (X, Y))[1], 54.0),
    "grad": (lambda f: jax.grad(f)(X, Y), 12.0),
    "vmap": (lambda f: jax.vmap(f, (0, None))(BATCH, Y), [2.0, 18.0]),
    "vmap of grad": (lambda f: jax.vmap(jax.grad(f), (0, None))(BATCH, Y), [4.0, 12.0]),
    "grad of vmap": (lambda f: jax.grad(lambda y: jax.vmap(f, (0, None))(BATCH, y).sum())(Y), 10.0),
    "jvp of jvp": (lambda f: tangent_of(tangent_of(lambda x: f(x, Y)))(X), 4.0),
    "jvp of grad": (lambda f: tangent_of(lambda x: jax.grad(f)(x, Y))(X), 4.0),
    "grad of jit": (lambda f: jax.grad(jax.jit(f))(X, Y), 12.0),
    "grad of checkpoint": (lambda f: jax.grad(jax.checkpoint(f))(X, Y), 12.0),
    "grad of scan": (lambda f: jax.grad(lambda y: summed(f, y))(Y), 10.0),
}
"""Transformations of x^2 y at x = 3 and y = 2, and what they give."""


def tangent_of(f: Callable) -> Callable:
    """Returns the derivative of a function of one number, in forward mode."""
    return lambda x: jax.jvp(f, (x,), (jnp.ones_like(x),))[1]


def summed(f: Objective, y: jax.Array) -> jax.Array:
    """Returns the sum over the batch, in a loop."""
    return jax.lax.scan(lambda total, x: (total + f(x, y), None), jnp.zeros_like(y), BATCH)[0]


def fault(keeper: Keeper) -> str:
    """Returns in a few words what is wrong with the operation, an empty text if nothing is."""
    name = verdict_of(keeper)
    if keeper.store.has(name):
        return ""
    found = ""
    try:
        for what in CHECKS:
            found = found or failed(keeper, what)
    except Exception as error:
        found = f"{what}: {type(error).__name__}"
    if not found:
        keeper.store.save(name, b"")
    return found


def verdict_of(keeper: Keeper) -> str:
    """Returns the name under which the store has the verdict that nothing is wrong."""
    return f"{keeper.environment.key_of('self-check')}-verdict"


def failed(keeper: Keeper, what: str) -> str:
    """Returns the name of a check if it fails, otherwise an empty text."""
    from kept_programs.operation import bind

    transform, expected = CHECKS[what]
    program = small_program(keeper)
    with keeper.at_work(), jax.ensure_compile_time_eval():
        found = transform(lambda x, y: program.unflatten(bind(program.program, x, y))[0])
    return "" if np.array_equal(found, np.asarray(expected)) else f"{what} differs"


@functools.lru_cache(maxsize=1)
def small_program(keeper: Keeper):
    """Returns the program of `volume`."""
    return tree_program(keeper, volume, (type_of(X), type_of(Y)), None)
