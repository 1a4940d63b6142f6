"""Programs derived from other programs: batches, derivatives, and programs with fewer results.

A derived program has a key that follows from that of the other program. It is therefore found in the
program cache without tracing either of them. Reverse mode splits a program in two, as JAX does: `forward`
computes the results and the *residuals*, the values that the linear map of the tangents needs, and
`backward` is the transpose of that map.
"""

import hashlib
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.extend.core import ClosedJaxpr, jaxpr_as_fun
from jax.interpreters import partial_eval as pe

from esail_jax.compilation.keys import key_of
from esail_jax.compilation.program import Leaves, Program
from esail_jax.compilation.remembered import remembered

Mask = tuple[bool, ...]
"""One truth value for every argument, or for every result, of a program."""

derivation = remembered(maxsize=256)
"""Decorator: a program that is derived twice is made, loaded and compiled once."""


@derivation
def batched(program: Program, size: int, axes: tuple[int | None, ...]) -> Program:
    """Returns the program for `size` members. axes: the axis of the members in every argument, None if the
    argument is common to them. In the results it is the first axis. Results that do not depend on the
    members may have no such axis: `Facts.about` is the mask of the others.

    On a CPU the members are computed one after the other: each of them takes the steps and has the bits
    that it has alone, and no member waits for another. Other devices compute all of them in lockstep, and
    so does a CPU if the members differ in nothing but tangents or cotangents: what these have in common,
    such as the steps of a run, is then computed once."""
    fixed = len(axes) if program.fixed is None else program.fixed()
    one_by_one = jax.default_backend() == "cpu" and any(axis is not None for axis in axes[:fixed])
    depends: set[int] = set()

    def in_order(*leaves):
        split = tuple(axis is not None for axis in axes)
        pairs = zip(chosen(leaves, split), chosen(axes, split), strict=True)
        common = chosen(leaves, not_(split))
        depends.update(range(len(program.facts.results)))
        return jax.lax.map(
            lambda member: tuple(as_function(program)(*merged(split, member, common))),
            tuple(jnp.moveaxis(x, axis, 0) for x, axis in pairs),
        )

    def in_lockstep(*leaves):
        def member(*leaves):
            results = as_function(program)(*leaves)
            for place, x in enumerate(results):
                probe(place, x, depends)
            return results

        results = jax.vmap(member, in_axes=axes, axis_size=size)(*leaves)
        return [x if place in depends else x[0] for place, x in enumerate(results)]

    def make():
        types = (
            x if axis is None else x.update(shape=(*x.shape[:axis], size, *x.shape[axis:]))
            for x, axis in zip(types_of(program), axes, strict=True)
        )
        closed = jax.jit(in_order if one_by_one else in_lockstep).trace(*types).jaxpr
        traced, _ = without_unused(closed, [True] * len(closed.out_avals), instantiate=True)  # the probes
        return traced, tuple(place in depends for place in range(len(closed.out_avals)))

    made = Program(make, derived_key(program, "batched", size, axes), program.compile)
    made.fixed = program.fixed
    return made


def probe(place: int, x: Any, depends: set[int]) -> None:
    """Adds a place to the set if `x` is different for the members of a batch that is being traced."""

    @jax.custom_batching.custom_vmap
    def identity(x):
        return x

    @identity.def_vmap
    def _identity_of_a_batch(size, is_batched, x):
        depends.add(place)
        return x, True

    identity(x)


class ForwardMode(Program):
    """The program of results and tangents (`pushed_forward`). primal: the program of the results;
    arguments: the number of its arguments."""

    primal: Program
    arguments: int


@derivation
def pushed_forward(program: Program, moving: Mask) -> ForwardMode:
    """Returns the program of the results, followed by their tangents (forward mode). Its arguments are
    those of `program`, followed by the tangents of the moving ones. Results that are not floating-point
    numbers have no tangents."""

    def function(*leaves):
        primals, tangents = leaves[: len(moving)], leaves[len(moving) :]
        results, moved = jax.jvp(of_moving(program, moving, primals), chosen(primals, moving), tangents)
        return (*results, *chosen(moved, with_tangent(results)))

    def make():
        primals = types_of(program)
        return jax.jit(function).trace(*primals, *chosen(primals, moving)), None

    made = ForwardMode(make, derived_key(program, "pushed forward", moving), program.compile)
    made.primal, made.arguments = program, len(moving)
    made.fixed = lambda: made.arguments
    return made


@derivation
def forward(program: Program, moving: Mask) -> Program:
    """Returns the program of the results, followed by the residuals of the derivative with respect to the
    moving arguments."""

    def make():
        traced, _ = linearised(program, moving)
        return traced, order_of_results(traced.jaxpr)

    return Program(make, derived_key(program, "forward", moving), program.compile)


@derivation
def tangent(program: Program, moving: Mask) -> Program:
    """Returns the program of the tangents of all results that are floating-point numbers. Its arguments are
    the residuals, followed by the tangents of the moving arguments of `program`."""

    def function(*leaves):
        count = len(leaves) - sum(moving)
        moved = jax.tree.unflatten(linearised(program, moving)[1], leaves[:count])(*leaves[count:])
        return chosen(moved, with_tangent(program.facts.results))

    def make():
        split = forward(program, moving).facts
        if split.about != order_of_results(linearised(program, moving)[0].jaxpr):
            raise RuntimeError(
                "the program cache holds another derivative; clear it by `esail cache --clear`"
            )
        residuals = split.results[len(program.facts.results) :]
        return jax.jit(function).trace(*residuals, *chosen(types_of(program), moving)), None

    made = Program(make, derived_key(program, "tangent", moving), program.compile)
    made.fixed = lambda: len(forward(program, moving).facts.results) - len(program.facts.results)
    return made


@remembered(maxsize=16)
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


def order_of_results(closed: ClosedJaxpr) -> str:
    """Returns a checksum of the operations of a function and of which of them give its results. Residuals
    have no names: a kept `forward` fits a linear map of another process if the checksums are equal."""
    made = {id(x): (i, j) for i, e in enumerate(closed.eqns) for j, x in enumerate(e.outvars)}
    operations = [e.primitive.name for e in closed.eqns]
    results = [(made.get(id(x)), str(x.aval)) for x in closed.jaxpr.outvars]
    return hashlib.sha256(repr((operations, results)).encode()).hexdigest()


@derivation
def backward(program: Program, linear: Mask) -> Program:
    """Returns the transpose of a program that is linear in some of its arguments. Its arguments are the
    other ones, followed by the cotangents of the results. Its results are the cotangents of the linear
    arguments."""

    def function(*leaves):
        constants, cotangents = leaves[: linear.count(False)], leaves[linear.count(False) :]
        arguments = types_of(program)

        def of_linear(*x):
            return tuple(as_function(program)(*merged(linear, x, constants)))

        return jax.linear_transpose(of_linear, *chosen(arguments, linear))(cotangents)

    def make():
        constants = chosen(types_of(program), not_(linear))
        return jax.jit(function).trace(*constants, *program.facts.results), None

    made = Program(make, derived_key(program, "backward", linear), program.compile)
    made.fixed = lambda: linear.count(False)
    return made


class Pruned(Program):
    """The program of some results of another one (`pruned`). whole: the other program; used: its results
    that are computed."""

    whole: Program
    used: Mask


@derivation
def pruned(program: Program, used: Mask) -> Pruned:
    """Returns the program of the used results only, without the arguments on which these do not depend.
    What its maker remembers (`Facts.about`) is the mask of the arguments that remain."""

    def make():
        return without_unused(program.traced.jaxpr, used)

    made = Pruned(make, derived_key(program, "pruned", used), program.compile)
    made.whole, made.used = program, used
    if program.fixed is not None:
        made.fixed = lambda: sum(made.facts.about[: program.fixed()])
    return made


# ---- helpers ----------------------------------------------------------------------------------------


def without_unused(
    closed: ClosedJaxpr, used: Sequence[bool], instantiate: bool = False
) -> tuple[jax.stages.Traced, Mask]:
    """Returns the traced function of the used results, and the mask of the arguments that remain: all if
    `instantiate`, otherwise those on which the results depend."""
    shorter, needed = pe.dce_jaxpr(closed.jaxpr, used, instantiate)
    types = (jax.ShapeDtypeStruct(x.shape, x.dtype) for x in chosen(closed.in_avals, needed))
    return jax.jit(jaxpr_as_fun(ClosedJaxpr(shorter, closed.consts))).trace(*types), tuple(needed)


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


def types_of(program: Program) -> tuple[jax.ShapeDtypeStruct, ...]:
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
