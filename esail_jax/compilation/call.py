"""Calls of programs inside functions that JAX traces.

A program inside another function is one operation of JAX: the primitive `program`. Outside a trace the
operation runs the program's executable. `jax.vmap` and the derivatives of JAX turn it into operations with
derived programs (`derived.py`). All of them are found in the program cache without being traced, so that a
second process computes the gradient of a run without tracing the run.
"""

import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.core import ShapedArray, Tracer
from jax.extend.core import Literal, Primitive
from jax.interpreters import ad, batching, mlir
from jax.interpreters import partial_eval as pe

from esail_jax.compilation.derived import (
    ForwardMode,
    Mask,
    Pruned,
    as_function,
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
from esail_jax.compilation.nan_checks import unchecked
from esail_jax.compilation.options import OURS
from esail_jax.compilation.program import Leaves, Program, TreeProgram, load, save
from esail_jax.compilation.remembered import remembered
from esail_jax.compilation.transposed import (
    TangentAgain,
    of_whole,
    tangent_again,
    transposed,
    with_fewer_results,
)
from esail_jax.compilation.workaround import refuse_wrong_products

program_p = Primitive("program")
program_p.multiple_results = True


class Reverse(NamedTuple):
    """What is known of a call for its derivative in reverse mode.

    recompute: the program is computed again instead of saving residuals. This suits a program that is cheap
    beside others: only the results with a cotangent are differentiated, and these are not known yet when
    residuals are computed. expected: a mask of the results that usually have a cotangent, None if these are
    unknown. The transpose for them is compiled while the program itself is compiled."""

    recompute: bool = False
    expected: Mask | None = None


UNKNOWN = Reverse()


def call(program: TreeProgram, *arguments: Any, recompute: bool = False, expected: Any = None) -> Any:
    """Returns the result of a program. Some of the arguments may be tracers.

    recompute: as in `Reverse`; expected: a function that returns that mask as a tree, from the result with
    types in place of arrays."""
    leaves = program.leaves(arguments)
    mask = None if expected is None else tuple(jax.tree.leaves(expected(program.result)))
    return program.unflatten(bind(program.program, *leaves, reverse=Reverse(recompute, mask)))


def bind(program: Program, *leaves: Any, reverse: Reverse = UNKNOWN) -> Leaves:
    """Returns the results of a program of leaves."""
    return program_p.bind(*leaves, program=program, reverse=reverse)


@program_p.def_impl
def _run(*leaves, program, reverse):
    if uses_executables():
        return program(*leaves)
    # The executable is that of one device: `jax.jit` follows the devices of the arguments.
    return unchecked(program.on_devices(lambda: jax.jit(as_function(program))), *leaves)


def uses_executables() -> bool:
    """Tells whether programs are run by their executables, which is so on a single CPU device."""
    return jax.device_count() == 1 and jax.default_backend() == "cpu"


@remembered(maxsize=256)
def ordinary(program: Program) -> Callable[..., Leaves]:
    """Returns the program as a function of `jax.jit`."""
    return jax.jit(as_function(program))


@program_p.def_abstract_eval
def _types(*_, program, reverse):
    return [ShapedArray(x.shape, x.dtype, weak_type=x.weak_type) for x in program.facts.results]


def _batch(leaves, axes, *, program, reverse):
    """`jax.vmap`."""
    size = next(x.shape[axis] for x, axis in zip(leaves, axes, strict=True) if axis is not None)
    whole = batched(program, size, tuple(axes))
    results = bind(whole, *leaves, reverse=Reverse(reverse.recompute))
    return results, [0 if depends else None for depends in whole.facts.about]


def _push_forward(primals, tangents, *, program, reverse):
    """Forward mode. `jax.linearize` and reverse mode come here, too, with tangents that are unknown: the
    results must then be computed without the tangents."""
    moving = tuple(not isinstance(x, ad.Zero) for x in tangents)
    along = chosen(tangents, moving)
    count = len(program.facts.results)
    if not any(isinstance(x, pe.JaxprTracer) for x in along):
        found = bind(pushed_forward(program, moving), *primals, *along)
        results, moved = found[:count], found[count:]
    elif reverse.recompute:
        results = bind(program, *primals, reverse=reverse)
        moved = bind(tangent_again(program, moving), *primals, *along)
    else:
        first, linear = forward(program, moving), tangent(program, moving)
        expected = reverse.expected and chosen(reverse.expected, with_tangent(program.facts.results))
        if uses_executables() and not any(map(is_traced, primals)):
            prepare(program, moving, expected)
        found = bind(first, *primals)
        results, residuals = found[:count], found[count:]
        moved = bind(linear, *residuals, *along, reverse=Reverse(expected=expected))
    mask = with_tangent(results)
    none = [ad.Zero(jax.typeof(x).to_tangent_aval()) for x in chosen(results, not_(mask))]
    return results, list(merged(mask, moved, none))


def _transpose(cotangents, *leaves, program, reverse):
    """Reverse mode, for a program that is linear in the arguments that are undefined here. Residuals of
    results without a cotangent are left out."""
    linear = tuple(ad.is_undefined_primal(x) for x in leaves)
    given = tuple(not isinstance(x, ad.Zero) for x in cotangents)
    expected = reverse.expected
    if expected and not any(map(operator.gt, given, expected)) and not any(map(is_traced, leaves)):
        given = expected
        cotangents = [zeros_of(x) if y else x for x, y in zip(cotangents, given, strict=True)]
    found = transposed(program, linear, given)
    remember_transpose(program, linear, given)
    arguments = *chosen(leaves, found.arguments), *chosen(cotangents, given)
    results = iter(bind(found.program, *arguments) if any(found.reached) else ())
    return [next(results) if is_reached else None for is_reached in found.reached]


def zeros_of(cotangent: Any) -> Any:
    """Returns a cotangent as an array. Zeros are made by NumPy: for JAX they would be a program to
    compile."""
    if not isinstance(cotangent, ad.Zero):
        return cotangent
    return np.zeros(cotangent.aval.shape, cotangent.aval.dtype)


TRANSPOSE = "transpose"
"""Kind of the file of the program cache that tells which transpose of a program was needed last."""


@remembered(maxsize=256)
def remember_transpose(program: Program, linear: Mask, given: Mask) -> None:
    """Writes down, once in a process, that this transpose was needed: for `prepare` in a later process."""
    while isinstance(program, Pruned):
        program, linear, given = of_whole(program, linear, given)
    if load(program.key, TRANSPOSE) != (linear, given):
        save(program.key, TRANSPOSE, (linear, given))


@remembered(maxsize=256)
def prepare(program: Program, moving: Mask, expected: Mask | None) -> None:
    """Starts, once in a process, to load or compile the two programs of reverse mode side by side. The
    transpose is the one that was needed last, or else the one for the expected cotangents."""
    first, linear = forward(program, moving), tangent(program, moving)
    first.prepare()
    found = load(linear.key, TRANSPOSE)
    if found is None and expected is not None:
        residuals = len(first.facts.results) - len(program.facts.results)
        found = (False,) * residuals + (True,) * sum(moving), expected
    if found is not None:
        transposed(linear, *found).program.prepare()


def is_traced(x: Any) -> bool:
    """Tells whether the value of an array is unknown."""
    return isinstance(x, Tracer)


def _prune(used, equation):
    """Leaves out unused results, and the arguments that only these need. Results with an expected cotangent
    stay, because their transpose is prepared."""
    if not any(used):
        return [False] * len(equation.invars), None
    reverse = equation.params["reverse"]
    if reverse.expected is not None:
        used = list(map(operator.or_, used, reverse.expected))
        reverse = reverse._replace(expected=chosen(reverse.expected, used))
    program = equation.params["program"]
    if isinstance(program, TangentAgain):
        shorter, needed = with_fewer_results(program, tuple(used))
    else:
        shorter = pruned(program, tuple(used))
        needed = shorter.facts.about
    return list(needed), equation.replace(
        invars=list(chosen(equation.invars, needed)),
        outvars=list(chosen(equation.outvars, used)),
        params={"program": shorter, "reverse": reverse},
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
        params={"program": program.primal, "reverse": UNKNOWN},
    )
    moved = [place >= results for place in range(count)]
    _, staged = _prune(moved, equation)
    return known, staged, moved, moved, new


def _lower(context, *leaves, program, reverse):
    """Puts the operations of the program into the program that is being compiled."""
    if not OURS.get():
        refuse_wrong_products()
    return mlir.lower_fun(ordinary(program), multiple_results=True)(context, *leaves)


def _name(context, *leaves, program, reverse):
    """Puts the key of the program in its place (`NAMED`)."""
    if program.key is None:
        return _lower(context, *leaves, program=program, reverse=reverse)
    return jax.ffi.ffi_lowering("esail_jax_program")(context, *leaves, key=program.key)


batching.primitive_batchers[program_p] = _batch
ad.primitive_jvps[program_p] = _push_forward
ad.primitive_transposes[program_p] = _transpose
pe.dce_rules[program_p] = lambda used, *rest: _prune(used, rest[-1])  # JAX 0.12 has an argument between
pe.partial_eval_jaxpr_custom_rules[program_p] = _split
mlir.register_lowering(program_p, _lower)

NAMED = mlir.LoweringParameters(override_lowering_rules=((program_p, _name),))
"""Parameter of `jax.stages.Traced.lower`: programs inside the traced function are lowered to their keys.
The text of such a module identifies the function's program. It cannot be compiled."""
