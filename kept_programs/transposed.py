"""Transposes of programs, for derivatives in reverse mode.

Reverse mode needs the cotangents of the arguments of a program from those of its results. There are two
ways. A program that is linear in some arguments, such as the program of tangents, is transposed (`backward`
in `derived.py`). `tangent_again` stands for the tangents of a program whose residuals were not saved: its
transpose computes the results again, of which only those with a cotangent are differentiated.
"""

from typing import NamedTuple

import jax

from kept_programs.derived import Pruned, backward, derivation, derived, of_moving, pruned, types_of
from kept_programs.masks import Mask, chosen, not_, placed, with_tangent
from kept_programs.program import Facts, Program


class TangentAgain(Program):
    """The program of the tangents, which computes everything else again (`tangent_again`). primal: the
    program of the results; moving: its arguments that have a tangent."""

    primal: Program
    moving: Mask

    @property
    def facts(self) -> Facts:
        """Types of the results, without tracing."""
        results = self.primal.facts.results
        return Facts(chosen(results, with_tangent(results)), None)


@derivation
def tangent_again(program: Program, moving: Mask) -> TangentAgain:
    """The program of the tangents of all results that are floating-point numbers. Its arguments are
    those of `program`, followed by the tangents of the moving ones."""

    def function(*leaves):
        primals, tangents = leaves[: len(moving)], leaves[len(moving) :]
        results, moved = jax.jvp(of_moving(program, moving, primals), chosen(primals, moving), tangents)
        return chosen(moved, with_tangent(results))

    def make():
        primals = types_of(program)
        return jax.jit(function).trace(*primals, *chosen(primals, moving)), None

    made = derived(TangentAgain, program, make, "tangent again", moving)
    made.primal, made.moving = program, moving
    made.fixed = lambda: len(moving)
    return made


@derivation
def pulled_back(program: Program, moving: Mask) -> Program:
    """The program of the cotangents of the moving arguments. Its arguments are those of `program`,
    followed by the cotangents of its results, which must be floating-point numbers."""

    def function(*leaves):
        primals, cotangents = leaves[: len(moving)], leaves[len(moving) :]
        return jax.vjp(of_moving(program, moving, primals), *chosen(primals, moving))[1](list(cotangents))

    def make():
        return jax.jit(function).trace(*types_of(program), *program.facts.results), None

    made = derived(Program, program, make, "pulled back", moving)
    made.fixed = lambda: len(moving)
    return made


class Transposed(NamedTuple):
    """The transpose of a program that is linear in some of its arguments.

    program: the transpose; arguments: which of the program's arguments it takes, before the given
    cotangents; reached: which arguments are linear and have a cotangent, because a result with a cotangent
    depends on them. The transpose returns these cotangents."""

    program: Program
    arguments: Mask
    reached: Mask


def transposed(program: Program, linear: Mask, given: Mask) -> Transposed:
    """The transpose of a program for cotangents of the given results, without everything that it
    does not need. A pruned program and the whole one share their transposes."""
    if isinstance(program, Pruned):
        found, left = transposed(*of_whole(program, linear, given)), program.facts.about
        return found._replace(arguments=chosen(found.arguments, left), reached=chosen(found.reached, left))
    if isinstance(program, TangentAgain) and not any(linear[: len(program.moving)]):
        return pulled_back_along(program, linear[len(program.moving) :], given)
    shorter = pruned(program, given)
    kept = shorter.facts.about
    reached = placed(linear, chosen(kept, linear))
    constants = placed(not_(linear), chosen(kept, not_(linear)))
    return Transposed(backward(shorter, chosen(linear, kept)), constants, reached)


def pulled_back_along(program: TangentAgain, linear: Mask, given: Mask) -> Transposed:
    """The transpose of recomputed tangents. linear: which tangents are linear arguments."""
    shorter = pruned(program.primal, placed(with_tangent(program.primal.facts.results), given))
    kept, moving = shorter.facts.about, placed(program.moving, linear)
    reached = tuple(x and y for x, y in zip(chosen(kept, program.moving), linear, strict=True))
    back = pulled_back(shorter, chosen(moving, kept))
    none = (False,) * len(reached)
    return Transposed(back, (*kept, *none), (*(False,) * len(kept), *reached))


def with_fewer_results(program: TangentAgain, used: Mask) -> tuple[TangentAgain, Mask]:
    """The program of the used tangents, and the mask of the arguments that it has. These are all
    that the results need, not only their tangents: `pulled_back` takes them."""
    shorter = pruned(program.primal, placed(with_tangent(program.primal.facts.results), used))
    kept = shorter.facts.about
    moving = program.moving
    return tangent_again(shorter, chosen(moving, kept)), (*kept, *chosen(kept, moving))


def of_whole(program: Pruned, linear: Mask, given: Mask) -> tuple[Program, Mask, Mask]:
    """The program from which a pruned one was made, and the masks of its linear arguments and given
    cotangents."""
    return program.whole, placed(program.facts.about, linear), placed(program.used, given)
