"""The operation of JAX that stands for a program inside functions that JAX traces.

Outside a trace the operation runs the program's executable. `jax.vmap` and the derivatives of JAX turn it
into operations with derived programs (`derived.py`). All of them are found in the store without being
traced, so that a second process computes a gradient without tracing what is differentiated.
"""

import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.core import Tracer

from kept_programs import jax_internals
from kept_programs.derived import (
    ForwardMode,
    Pruned,
    as_function,
    batched,
    forward,
    pruned,
    pushed_forward,
    tangent,
)
from kept_programs.executables import load, save
from kept_programs.jax_internals import Division, Pruning, Rules
from kept_programs.masks import Mask, chosen, merged, with_tangent
from kept_programs.nan_checks import unchecked
from kept_programs.program import Leaves, Program
from kept_programs.remembered import remembered
from kept_programs.transposed import (
    TangentAgain,
    of_whole,
    tangent_again,
    transposed,
    with_fewer_results,
)


class Reverse(NamedTuple):
    """What is known of a call for its derivative in reverse mode.

    recompute: the program is computed again instead of saving residuals. This suits a program that is cheap
    beside others: only the results with a cotangent are differentiated, and these are not known yet when
    residuals are computed. expected: a mask of the results that usually have a cotangent, None if these are
    unknown. The transpose for them is compiled while the program itself is compiled."""

    recompute: bool = False
    expected: Mask | None = None


UNKNOWN = Reverse()


def bind(program: Program, *leaves: Any, reverse: Reverse = UNKNOWN) -> Leaves:
    """The results of a program of leaves."""
    return program_p.bind(*leaves, program=program, reverse=reverse)


def run(*leaves, program, reverse) -> Leaves:
    """Runs the executable. It is that of one device: `jax.jit` follows the devices of the arguments."""
    if uses_executables():
        return program(*leaves)
    return unchecked(program.on_devices(lambda: jax.jit(as_function(program))), *leaves)


def uses_executables() -> bool:
    """Tells whether programs are run by their executables, which is so on a single CPU device."""
    return jax.device_count() == 1 and jax.default_backend() == "cpu"


@remembered(maxsize=256)
def ordinary(program: Program) -> Callable[..., Leaves]:
    """The program as a function of `jax.jit`."""
    return jax.jit(as_function(program))


def types(program, reverse) -> Sequence[jax.ShapeDtypeStruct]:
    """Types of the results."""
    return program.facts.results


def batch(size, leaves, axes, program, reverse):
    """`jax.vmap`."""
    whole = batched(program, size, tuple(axes))
    results = bind(whole, *leaves, reverse=Reverse(reverse.recompute))
    return results, [0 if depends else None for depends in whole.facts.about]


def push_forward(primals, tangents, unknown, program, reverse):
    """Forward mode. `jax.linearize` and reverse mode come here, too, with tangents that are unknown: the
    results are then computed without them, and their tangents from residuals, or from the arguments."""
    moving = tuple(x is not None for x in tangents)
    tangents_in = chosen(tangents, moving)
    if not unknown:
        with_tangents = bind(pushed_forward(program, moving), *primals, *tangents_in)
        results, tangents_out = parted(program, with_tangents)
    elif reverse.recompute:
        results = bind(program, *primals, reverse=reverse)
        tangents_out = bind(tangent_again(program, moving), *primals, *tangents_in)
    else:
        to_residuals, to_tangents = forward(program, moving), tangent(program, moving)
        expected = reverse.expected and chosen(reverse.expected, with_tangent(program.facts.results))
        if uses_executables() and not any(map(is_traced, primals)):
            prepare(program, moving, expected)
        results, residuals = parted(program, bind(to_residuals, *primals))
        tangents_out = bind(to_tangents, *residuals, *tangents_in, reverse=Reverse(expected=expected))
    mask = with_tangent(results)
    return results, merged(mask, tangents_out, [None] * mask.count(False))


def parted(program: Program, leaves: Leaves) -> tuple[Leaves, Leaves]:
    """The results of a program, and what a program derived from it gives after these."""
    count = len(program.facts.results)
    return leaves[:count], leaves[count:]


def transpose(cotangents, leaves, linear, program, reverse):
    """Reverse mode, for a program that is linear in some arguments. Residuals of results without a
    cotangent are left out."""
    given = tuple(x is not None for x in cotangents)
    expected = reverse.expected
    if expected and not any(map(operator.gt, given, expected)) and not any(map(is_traced, leaves)):
        # Zeros are made by NumPy: for JAX they would be a program to compile.
        zeros = (np.zeros(x.shape, x.dtype) for x in program.facts.results)
        cotangents = [
            zero if x is None and y else x for x, y, zero in zip(cotangents, expected, zeros, strict=True)
        ]
        given = expected
    back = transposed(program, linear, given)
    remember_transpose(program, linear, given)
    arguments = *chosen(leaves, back.arguments), *chosen(cotangents, given)
    results = iter(bind(back.program, *arguments) if any(back.reached) else ())
    return [next(results) if is_reached else None for is_reached in back.reached]


TRANSPOSE = "transpose"
"""Kind of the file that tells which transpose of a program was needed last."""


@remembered(maxsize=256)
def remember_transpose(program: Program, linear: Mask, given: Mask) -> None:
    """Writes down, once in a process, that this transpose was needed: for `prepare` in a later process."""
    while isinstance(program, Pruned):
        program, linear, given = of_whole(program, linear, given)
    store = program.keeper.store
    if load(store, program.key, TRANSPOSE) != (linear, given):
        save(store, program.key, TRANSPOSE, (linear, given))


@remembered(maxsize=256)
def prepare(program: Program, moving: Mask, expected: Mask | None) -> None:
    """Starts, once in a process, to load or compile the two programs of reverse mode side by side. The
    transpose is the one that was needed last, or else the one for the expected cotangents."""
    to_residuals, to_tangents = forward(program, moving), tangent(program, moving)
    to_residuals.prepare()
    linear_and_given = load(program.keeper.store, to_tangents.key, TRANSPOSE)
    if linear_and_given is None and expected is not None:
        _, residuals = parted(program, to_residuals.facts.results)
        linear_and_given = (False,) * len(residuals) + (True,) * sum(moving), expected
    if linear_and_given is not None:
        transposed(to_tangents, *linear_and_given).program.prepare()


def is_traced(x: Any) -> bool:
    """Tells whether the value of an array is unknown."""
    return isinstance(x, Tracer)


def prune(used, program, reverse) -> Pruning:
    """Leaves out unused results, and the arguments that only these need. Results with an expected cotangent
    stay, because their transpose is prepared."""
    if reverse.expected is not None:
        used = list(map(operator.or_, used, reverse.expected))
        reverse = reverse._replace(expected=chosen(reverse.expected, used))
    if isinstance(program, TangentAgain):
        shorter, needed = with_fewer_results(program, tuple(used))
    else:
        shorter = pruned(program, tuple(used))
        needed = shorter.facts.about
    return Pruning(needed, used, {"program": shorter, "reverse": reverse})


def split(unknown, program, reverse) -> Division | None:
    """Reverse mode of `jax.checkpoint`, which first differentiates its function in forward mode. It then
    asks for one operation with the results, which are known, and one with the tangents, which are not."""
    if not isinstance(program, ForwardMode) or any(unknown[: program.arguments]):
        return None
    results, tangents = parted(program.primal, program.facts.results)
    later = [False] * len(results) + [True] * len(tangents)
    return Division({"program": program.primal, "reverse": UNKNOWN}, program.arguments, later)


def function(program, reverse) -> Callable[..., Leaves]:
    """The operations of the program, for the program that is being compiled."""
    program.keeper.before_lowering()
    return ordinary(program)


def name(program, reverse) -> str | None:
    """The key of the program, in its place."""
    return program.key


RULES = Rules(run, types, batch, push_forward, function, transpose, prune, split, name)
program_p = jax_internals.operation("program", RULES)


def text_with_keys(traced: jax.stages.Traced) -> jax.stages.Lowered:
    """Lowers a function, with the programs inside represented by their keys."""
    return jax_internals.named(traced, program_p, RULES)
