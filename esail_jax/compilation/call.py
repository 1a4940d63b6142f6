"""Calls of programs inside functions that JAX traces.

A program inside another function is one operation of JAX: the primitive `program`. Outside a trace the
operation runs the program's executable. `jax.vmap` and the derivatives of JAX turn it into operations with
derived programs (`derived.py`). All of them are found in the program cache without being traced, so that a
second process computes the gradient of a run without tracing the run.
"""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.core import ShapedArray, Tracer
from jax.extend.core import Literal, Primitive
from jax.interpreters import ad, batching, mlir
from jax.interpreters import partial_eval as pe

from esail_jax.compilation.derived import (
    ForwardMode,
    Mask,
    Pruned,
    as_function,
    backward,
    batched,
    chosen,
    forward,
    merged,
    not_,
    pruned,
    pushed_forward,
    tangent,
    with_tangent,
)
from esail_jax.compilation.options import OURS
from esail_jax.compilation.program import Leaves, Program, TreeProgram, load, save
from esail_jax.compilation.workaround import refuse_wrong_products

program_p = Primitive("program")
program_p.multiple_results = True


def call(program: TreeProgram, *arguments: Any) -> Any:
    """Returns the result of a program. Some of the arguments may be tracers."""
    leaves = program.leaves(arguments)
    return program.unflatten(bind(program.program, *leaves))


def bind(program: Program, *leaves: Any) -> Leaves:
    """Returns the results of a program of leaves."""
    return program_p.bind(*map(jnp.asarray, leaves), program=program)


@program_p.def_impl
def _run(*leaves, program):
    if jax.device_count() == 1 and jax.default_backend() == "cpu":
        return program(*leaves)
    # The executable is that of one device: `jax.jit` follows the devices of the arguments.
    return ordinary(program)(*leaves)


@functools.lru_cache(maxsize=256)
def ordinary(program: Program) -> Callable[..., Leaves]:
    """Returns the program as a function of `jax.jit`."""
    return jax.jit(as_function(program))


@program_p.def_abstract_eval
def _types(*_, program):
    return [ShapedArray(x.shape, x.dtype, weak_type=x.weak_type) for x in program.facts.results]


def _batch(leaves, axes, *, program):
    """`jax.vmap`."""
    size = next(x.shape[axis] for x, axis in zip(leaves, axes, strict=True) if axis is not None)
    whole = batched(program, size, tuple(axes))
    results = bind(whole, *leaves)
    return results, [0 if depends else None for depends in whole.facts.about]


def _push_forward(primals, tangents, *, program):
    """Forward mode. `jax.linearize` and reverse mode come here, too, with tangents that are unknown: the
    results must then be computed without the tangents."""
    moving = tuple(not isinstance(x, ad.Zero) for x in tangents)
    along = chosen(tangents, moving)
    count = len(program.facts.results)
    if any(isinstance(x, pe.JaxprTracer) for x in along):
        if not any(isinstance(x, Tracer) for x in primals):
            load_transpose_ahead(tangent(program, moving))
        found = bind(forward(program, moving), *primals)
        results, residuals = found[:count], found[count:]
        moved = bind(tangent(program, moving), *residuals, *along)
    else:
        found = bind(pushed_forward(program, moving), *primals, *along)
        results, moved = found[:count], found[count:]
    mask = with_tangent(results)
    none = [ad.Zero(jax.typeof(x).to_tangent_aval()) for x in chosen(results, not_(mask))]
    return results, list(merged(mask, moved, none))


def _transpose(cotangents, *leaves, program):
    """Reverse mode, for a program that is linear in the arguments that are undefined here. Residuals of
    results without a cotangent are left out."""
    linear = tuple(ad.is_undefined_primal(x) for x in leaves)
    given = tuple(not isinstance(x, ad.Zero) for x in cotangents)
    needed = transposed(program, linear, given)
    remember_transpose(program, linear, given)
    arguments = (*chosen(leaves, not_(linear)), *chosen(cotangents, given))
    found = bind(needed, *chosen(arguments, needed.facts.about))
    return list(merged(linear, found, [None] * linear.count(False)))


def transposed(program: Program, linear: Mask, given: Mask) -> Program:
    """Returns the transpose of a program, without the arguments that its results do not need."""
    return pruned(backward(program, linear, given), (True,) * sum(linear))


TRANSPOSE = "transpose"
"""Kind of the file of the program cache that tells which transpose of a program was needed last."""


@functools.lru_cache(maxsize=256)
def remember_transpose(program: Program, linear: Mask, given: Mask) -> None:
    """Writes down, once in a process, that this transpose was needed: for `load_transpose_ahead` in a later
    process."""
    prunings: list[Mask] = []
    whole = program
    while isinstance(whole, Pruned):
        prunings.insert(0, whole.used)
        whole = whole.whole
    found = prunings, linear, given
    if load(whole.key, TRANSPOSE) != found:
        save(whole.key, TRANSPOSE, found)


@functools.lru_cache(maxsize=256)
def load_transpose_ahead(program: Program) -> None:
    """Starts, once in a process, to load the transpose of a program of tangents, if the cache tells which
    one was needed last.
    A gradient needs it after the forward program, whose loading takes longer."""
    found = load(program.key, TRANSPOSE)
    if found is not None:
        prunings, linear, given = found
        transposed(functools.reduce(pruned, prunings, program), linear, given).load_ahead()


def _prune(used, equation):
    """Leaves out unused results, and the arguments that only these need."""
    if not any(used):
        return [False] * len(equation.invars), None
    shorter = pruned(equation.params["program"], tuple(used))
    needed = shorter.facts.about
    return list(needed), equation.replace(
        invars=list(chosen(equation.invars, needed)),
        outvars=list(chosen(equation.outvars, used)),
        params={"program": shorter},
    )


def _split(_, unknown, instantiated, equation):
    """Reverse mode of `jax.checkpoint`, which first differentiates its function in forward mode. It then
    asks for one operation with the results, which are known, and one with the tangents, which are not."""
    program, count = equation.params["program"], len(equation.outvars)
    new = [x for x in chosen(equation.invars, not_(instantiated)) if not isinstance(x, Literal)]
    if not any(unknown):
        return equation, None, [False] * count, [False] * count, []
    if not isinstance(program, ForwardMode) or any(unknown[: program.arguments]):
        return None, equation, [True] * count, [True] * count, new
    results = len(program.primal.facts.results)
    known = equation.replace(
        invars=equation.invars[: program.arguments],
        outvars=equation.outvars[:results],
        params={"program": program.primal},
    )
    moved = [place >= results for place in range(count)]
    _, staged = _prune(moved, equation)
    return known, staged, moved, moved, new


def _lower(context, *leaves, program):
    """Puts the operations of the program into the program that is being compiled."""
    if not OURS.get():
        refuse_wrong_products()
    return mlir.lower_fun(ordinary(program), multiple_results=True)(context, *leaves)


def _name(context, *leaves, program):
    """Puts the key of the program in its place (`NAMED`)."""
    if program.key is None:
        return _lower(context, *leaves, program=program)
    return jax.ffi.ffi_lowering("esail_jax_program")(context, *leaves, key=program.key)


batching.primitive_batchers[program_p] = _batch
ad.primitive_jvps[program_p] = _push_forward
ad.primitive_transposes[program_p] = _transpose
pe.dce_rules[program_p] = _prune
pe.partial_eval_jaxpr_custom_rules[program_p] = _split
mlir.register_lowering(program_p, _lower)

NAMED = mlir.LoweringParameters(override_lowering_rules=((program_p, _name),))
"""Parameter of `jax.stages.Traced.lower`: programs inside the traced function are lowered to their keys.
The text of such a module identifies the function's program. It cannot be compiled."""
