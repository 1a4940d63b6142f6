"""Programs derived from other programs: batches, derivatives, and programs with fewer results.

A derived program has a key that follows from that of the other program. It is therefore found in the
program cache without tracing either of them. Reverse mode splits a program in two, as JAX does: `forward`
computes the results and the *residuals*, the values that the linear map of the tangents needs, and
`backward` is the transpose of that map.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp

from kept_programs.jax_internals import function_of, order_of_results, without_unused
from kept_programs.masks import Mask, chosen, merged, not_, with_tangent
from kept_programs.program import Leaves, Program
from kept_programs.remembered import remembered

derivation = remembered(maxsize=256)
"""Decorator: a program that is derived twice is made, loaded and compiled once."""


@derivation
def batched(program: Program, size: int, axes: tuple[int | None, ...]) -> Program:
    """The program for `size` members. axes: the axis of the members in every argument, None if the
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

    made = derived(Program, program, make, "batched", size, axes)
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
    """The program of the results, followed by their tangents (forward mode). Its arguments are
    those of `program`, followed by the tangents of the moving ones. Results that are not floating-point
    numbers have no tangents."""

    def function(*leaves):
        primals, tangents_in = leaves[: len(moving)], leaves[len(moving) :]
        of_primals = of_moving(program, moving, primals)
        results, tangents_out = jax.jvp(of_primals, chosen(primals, moving), tangents_in)
        return (*results, *chosen(tangents_out, with_tangent(results)))

    def make():
        primals = types_of(program)
        return jax.jit(function).trace(*primals, *chosen(primals, moving)), None

    made = derived(ForwardMode, program, make, "pushed forward", moving)
    made.primal, made.arguments = program, len(moving)
    made.fixed = lambda: made.arguments
    return made


@derivation
def forward(program: Program, moving: Mask) -> Program:
    """The program of the results, followed by the residuals of the derivative with respect to the
    moving arguments."""

    def make():
        traced, _ = linearised(program, moving)
        return traced, order_of_results(traced.jaxpr)

    return derived(Program, program, make, "forward", moving)


@derivation
def tangent(program: Program, moving: Mask) -> Program:
    """The program of the tangents of all results that are floating-point numbers. Its arguments are
    the residuals, followed by the tangents of the moving arguments of `program`."""

    def function(*leaves):
        count = len(leaves) - sum(moving)
        residuals, tangents_in = leaves[:count], leaves[count:]
        linear = jax.tree.unflatten(linearised(program, moving)[1], residuals)
        return chosen(linear(*tangents_in), with_tangent(program.facts.results))

    def make():
        split = forward(program, moving).facts
        # Residuals have no names: a kept `forward` fits this linear map if both have the same operations.
        if split.about != order_of_results(linearised(program, moving)[0].jaxpr):
            raise RuntimeError(f"the program cache holds another derivative; {program.keeper.remedy}")
        residuals = split.results[len(program.facts.results) :]
        return jax.jit(function).trace(*residuals, *chosen(types_of(program), moving)), None

    made = derived(Program, program, make, "tangent", moving)
    made.fixed = lambda: len(forward(program, moving).facts.results) - len(program.facts.results)
    return made


@remembered(maxsize=16)
def linearised(program: Program, moving: Mask) -> tuple[jax.stages.Traced, Any]:
    """The traced function of `forward`, and the tree of the linear map, whose leaves are the
    residuals."""
    tree = None

    def function(*leaves):
        nonlocal tree
        results, linear = jax.linearize(of_moving(program, moving, leaves), *chosen(leaves, moving))
        residuals, tree = jax.tree.flatten(linear)
        return (*results, *residuals)

    return jax.jit(function).trace(*types_of(program)), tree


@derivation
def backward(program: Program, linear: Mask) -> Program:
    """The transpose of a program that is linear in some of its arguments. Its arguments are the
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

    made = derived(Program, program, make, "backward", linear)
    made.fixed = lambda: linear.count(False)
    return made


class Pruned(Program):
    """The program of some results of another one (`pruned`). whole: the other program; used: its results
    that are computed."""

    whole: Program
    used: Mask


@derivation
def pruned(program: Program, used: Mask) -> Pruned:
    """The program of the used results only, without the arguments on which these do not depend.
    What its maker remembers (`Facts.about`) is the mask of the arguments that remain."""

    def make():
        return without_unused(program.traced.jaxpr, used)

    made = derived(Pruned, program, make, "pruned", used)
    made.whole, made.used = program, used
    if program.fixed is not None:
        made.fixed = lambda: sum(made.facts.about[: program.fixed()])
    return made


# ---- helpers ----------------------------------------------------------------------------------------


Kind = TypeVar("Kind", bound=Program)


def derived(kind: type[Kind], program: Program, make: Callable, *how: Any) -> Kind:
    """A program that follows from another one and is compiled in the same way. how: what tells its
    key from those of others."""
    key = None if program.key is None else program.keeper.environment.key_of("derived", program.key, *how)
    return kind(program.keeper, make, key, program.compile)


def as_function(program: Program) -> Callable[..., Leaves]:
    """The program as a function that JAX can trace."""
    return function_of(program.traced.jaxpr)


def of_moving(program: Program, moving: Mask, primals: Leaves) -> Callable[..., Leaves]:
    """The program as a function of the moving arguments. The others have the given values."""
    fixed = chosen(primals, not_(moving))
    return lambda *x: as_function(program)(*merged(moving, x, fixed))


def types_of(program: Program) -> tuple[jax.ShapeDtypeStruct, ...]:
    """The types of a program's arguments."""
    return tuple(jax.ShapeDtypeStruct(x.shape, x.dtype) for x in program.traced.jaxpr.in_avals)
