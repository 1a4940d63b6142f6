"""Programs derived from other programs: batches, derivatives, and programs with fewer results.

A derived program has a key that follows from that of the other program. It is therefore found in the
program cache without tracing either of them. Reverse mode splits a program in two, as JAX does: `forward`
computes the results and the *residuals*, the values that the linear map of the tangents needs, and
`backward` is the transpose of that map.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.extend.core import jaxpr_as_fun
from jax.interpreters import partial_eval as pe

from esail_jax.compilation.keys import key_of
from esail_jax.compilation.program import Leaves, Program

Mask = tuple[bool, ...]
"""For every argument, or every result, of a program whether it is meant."""

Types = Sequence[jax.ShapeDtypeStruct]

derivation = functools.lru_cache(maxsize=256)
"""Decorator: a program that is derived twice is made, loaded and compiled once."""


@derivation
def batched(program: Program, size: int, axes: tuple[int | None, ...]) -> Program:
    """Returns the program for `size` members. axes: the axis of the members in every argument, None if the
    argument is common to them. In the results it is the first axis."""

    def types():
        return tuple(
            x if axis is None else x.update(shape=(*x.shape[:axis], size, *x.shape[axis:]))
            for x, axis in zip(types_of(program), axes, strict=True)
        )

    def function(*leaves):
        return jax.vmap(as_function(program), in_axes=axes, axis_size=size)(*leaves)

    return derived(program, "batched", (size, axes), function, types)


@derivation
def pushed_forward(program: Program, moving: Mask) -> Program:
    """Returns the program of the results, followed by their tangents (forward mode). Its arguments are
    those of `program`, followed by the tangents of the moving ones. Results that are not floating-point
    numbers have no tangents."""

    def types():
        primals = types_of(program)
        return (*primals, *chosen(primals, moving))

    def function(*leaves):
        primals, tangents = leaves[: len(moving)], leaves[len(moving) :]
        results, moved = jax.jvp(of_moving(program, moving, primals), chosen(primals, moving), tangents)
        return (*results, *chosen(moved, with_tangent(results)))

    return derived(program, "pushed forward", (moving,), function, types)


@derivation
def forward(program: Program, moving: Mask) -> Program:
    """Returns the program of the results, followed by the residuals of the derivative with respect to the
    moving arguments."""
    return Program(
        lambda: (linearised(program, moving)[0], None), derived_key(program, "forward", moving), program.compile
    )


@derivation
def tangent(program: Program, moving: Mask) -> Program:
    """Returns the program of the tangents of all results that are floating-point numbers. Its arguments are
    the residuals, followed by the tangents of the moving arguments of `program`."""

    def types():
        results = program.facts.results
        residuals = forward(program, moving).facts.results[len(results) :]
        return (*residuals, *chosen(types_of(program), moving))

    def function(*leaves):
        count = len(leaves) - sum(moving)
        moved = jax.tree.unflatten(linearised(program, moving)[1], leaves[:count])(*leaves[count:])
        return chosen(moved, with_tangent(program.facts.results))

    return derived(program, "tangent", (moving,), function, types)


@functools.lru_cache(maxsize=16)
def linearised(program: Program, moving: Mask) -> tuple[jax.stages.Traced, Any]:
    """Returns the traced function of `forward`, and the tree of the linear map, whose leaves are the
    residuals."""
    tree = None

    def function(*leaves):
        nonlocal tree
        results, linear = jax.linearize(of_moving(program, moving, leaves), *chosen(leaves, moving))
        residuals, tree = jax.tree.flatten(linear)
        return (*results, *residuals)

    return jax.jit(function).trace(*types_of(program)), tree


@derivation
def backward(program: Program, linear: Mask, given: Mask) -> Program:
    """Returns the transpose of a program that is linear in some of its arguments. Its arguments are the
    other ones, followed by the given cotangents; the cotangents of the other results are zero. Its results
    are the cotangents of the linear arguments."""

    def types():
        arguments = types_of(program)
        return (*chosen(arguments, not_(linear)), *chosen(program.facts.results, given))

    def function(*leaves):
        constants, cotangents = leaves[: linear.count(False)], leaves[linear.count(False) :]
        arguments = types_of(program)

        def of_linear(*x):
            return chosen(as_function(program)(*merged(linear, x, constants)), given)

        return jax.linear_transpose(of_linear, *chosen(arguments, linear))(cotangents)

    return derived(program, "backward", (linear, given), function, types)


@derivation
def pruned(program: Program, used: Mask) -> Program:
    """Returns the program of the used results only, without the arguments on which these do not depend.
    What its maker remembers (`Facts.about`) is the mask of the arguments that remain."""

    def make():
        closed = program.traced.jaxpr
        shorter, needed = pe.dce_jaxpr(closed.jaxpr, used)
        function = jaxpr_as_fun(jax.extend.core.ClosedJaxpr(shorter, closed.consts))
        return jax.jit(function).trace(*chosen(types_of(program), needed)), tuple(needed)

    return Program(make, derived_key(program, "pruned", used), program.compile)


# ---- helpers ----------------------------------------------------------------------------------------


def derived(
    program: Program, name: str, given: tuple, function: Callable[..., Leaves], types: Callable[[], Types]
) -> Program:
    """Returns the program of a function that is derived from `program`. name and given: what distinguishes
    it from other derivations; types: returns the types of its arguments."""
    return Program(
        lambda: (jax.jit(function).trace(*types()), None), derived_key(program, name, *given), program.compile
    )


def derived_key(program: Program, *how: Any) -> str | None:
    """Returns the key of a derived program."""
    return None if program.key is None else key_of("derived", program.key, *how)


def as_function(program: Program) -> Callable[..., Leaves]:
    """Returns the program as a function that JAX can trace."""
    return jaxpr_as_fun(program.traced.jaxpr)


def of_moving(program: Program, moving: Mask, primals: Leaves) -> Callable[..., Leaves]:
    """Returns the program as a function of the moving arguments. The others have the given values."""
    fixed = chosen(primals, not_(moving))
    return lambda *x: as_function(program)(*merged(moving, x, fixed))


def types_of(program: Program) -> Types:
    """Returns the types of a program's arguments."""
    return tuple(jax.ShapeDtypeStruct(x.shape, x.dtype) for x in program.traced.jaxpr.in_avals)


def with_tangent(values: Leaves) -> Mask:
    """Returns which values are floating-point numbers and therefore have tangents."""
    return tuple(bool(jnp.issubdtype(x.dtype, jnp.inexact)) for x in values)


def chosen(values: Sequence, mask: Sequence[bool]) -> tuple:
    """Returns the values for which the mask is true."""
    return tuple(x for x, is_chosen in zip(values, mask, strict=True) if is_chosen)


def not_(mask: Sequence[bool]) -> Mask:
    """Returns the opposite mask."""
    return tuple(not x for x in mask)


def merged(mask: Mask, where_true: Sequence, where_false: Sequence) -> tuple:
    """Returns one sequence: the values of `where_true` at the places where the mask is true, those of
    `where_false` at the others."""
    true, false = iter(where_true), iter(where_false)
    return tuple(next(true) if x else next(false) for x in mask)
