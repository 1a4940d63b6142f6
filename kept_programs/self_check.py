"""A check of the operation: transformations of a call whose results are known.

The operation rests on names that a release of JAX may change (`jax_internals.py`). It is tried before it is
used for the first time with a version of JAX; the verdict is kept in the store."""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from kept_programs.program import Keeper, tree_program, type_of

X, Y, BATCH = np.asarray(3.0), np.asarray(2.0), np.asarray([1.0, 3.0])
TABLE = np.asarray([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
COUNT = np.asarray(2)


def volume(x, y, count):
    """The function of the check, x^2 y for a count of 2, with a second result that its objective does not
    need."""
    return (count - 1) * x**2 * y, x - y


Objective = Callable[..., jax.Array]
"""A function of x and y, which is x^2 y."""

CHECKS: dict[str, tuple[Callable[[Objective], Any], object]] = {
    "jit": (lambda f: jax.jit(f)(X, Y), 18.0),
    "jvp": (lambda f: jax.jvp(f, (X, Y), (X, Y))[1], 54.0),
    "grad": (lambda f: jax.grad(f)(X, Y), 12.0),
    "grad by two arguments": (lambda f: jax.grad(f, (0, 1))(X, Y), (12.0, 9.0)),
    "vmap": (lambda f: jax.vmap(f, (0, None))(BATCH, Y), [2.0, 18.0]),
    "vmap over another axis": (
        lambda f: jax.vmap(jax.vmap(f, (0, None)), (1, None))(TABLE, Y), 2.0 * TABLE.T**2
    ),
    "vmap of grad": (lambda f: jax.vmap(jax.grad(f), (0, None))(BATCH, Y), [4.0, 12.0]),
    "grad of vmap": (lambda f: jax.grad(lambda y: jax.vmap(f, (0, None))(BATCH, y).sum())(Y), 10.0),
    "jvp of jvp": (lambda f: tangent_of(tangent_of(lambda x: f(x, Y)))(X), 4.0),
    "jvp of grad": (lambda f: tangent_of(lambda x: jax.grad(f)(x, Y))(X), 4.0),
    "grad of grad": (lambda f: jax.grad(lambda y: jax.grad(f)(X, y))(Y), 6.0),
    "grad of jit": (lambda f: jax.grad(jax.jit(f))(X, Y), 12.0),
    "grad of checkpoint": (lambda f: jax.grad(jax.checkpoint(f))(X, Y), 12.0),
    "grad of scan": (lambda f: jax.grad(lambda y: summed(f, y))(Y), 10.0),
}  # fmt: skip
"""Transformations of x^2 y at x = 3 and y = 2, and what they give."""


def tangent_of(f: Callable) -> Callable:
    """The derivative of a function of one number, in forward mode."""
    return lambda x: jax.jvp(f, (x,), (jnp.ones_like(x),))[1]


def summed(f: Objective, y: jax.Array) -> jax.Array:
    """The sum over the batch, in a loop."""
    return jax.lax.scan(lambda total, x: (total + f(x, y), None), jnp.zeros_like(y), BATCH)[0]


def fault(keeper: Keeper) -> str:
    """In a few words what is wrong with the operation, an empty text if nothing is."""
    name = verdict_of(keeper)
    if name is not None and keeper.store.load(name) is not None:
        return ""
    tried = ["import"]
    try:
        with keeper.at_work():
            results = by_executables(keeper, tried) | in_one_program(keeper, tried)
    except Exception as error:
        return f"{tried[-1]}: {type(error).__name__}"
    for what, result in results.items():
        if not np.array_equal(np.asarray(result), np.asarray(CHECKS[what.split(",")[0]][1])):
            return f"{what} differs"
    if name is not None:
        keeper.store.save(name, b"")
    return ""


def verdict_of(keeper: Keeper) -> str | None:
    """The name under which the store has the verdict that nothing is wrong; None if it is not
    kept."""
    key = keeper.environment.key_of("self-check")
    return None if key is None else f"{key}-verdict"


def by_executables(keeper: Keeper, tried: list[str]) -> dict[str, Any]:
    """Gradients that are computed operation by operation, each by the executable of its program:
    the ways to treat the results that have no cotangent. tried: gets the name of each check."""
    from kept_programs.operation import Reverse

    results = {}
    for reverse in (Reverse(expected=(True, False)), Reverse(recompute=True)):
        tried.append(f"grad, {'computed again' if reverse.recompute else 'expected'}")
        with jax.ensure_compile_time_eval():
            results[tried[-1]] = CHECKS["grad"][0](objective(keeper, reverse))
    return results


def in_one_program(keeper: Keeper, tried: list[str]) -> dict[str, Any]:
    """The results of all checks, computed by one program of JAX: their operations become parts of
    it. That is one program to compile in place of some thirty. tried: gets the name of each check."""
    from kept_programs.operation import UNKNOWN

    def every():
        results = {}
        for what, (transform, _) in CHECKS.items():
            tried.append(what)
            results[what] = transform(objective(keeper, UNKNOWN))
        return results

    return jax.jit(every).lower().compile()()  # for a check while a function is traced: not a part of that


def objective(keeper: Keeper, reverse: Any) -> Objective:
    """The function that is transformed: the first result of the operation."""
    from kept_programs.operation import bind

    program = small_program(keeper)
    return lambda x, y: program.unflatten(bind(program.program, x, y, COUNT, reverse=reverse))[0]


@functools.lru_cache(maxsize=1)
def small_program(keeper: Keeper):
    """The program of `volume`."""
    return tree_program(keeper, volume, (type_of(X), type_of(Y), type_of(COUNT)), None)
