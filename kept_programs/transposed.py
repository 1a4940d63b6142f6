"""Transposes of programs, for derivatives in reverse mode.

Reverse mode needs the cotangents of the arguments of a program from those of its results. There are two
ways. A program that is linear in some arguments, such as the program of tangents, is transposed (`backward`
in `derived.py`). `tangent_again` stands for the tangents of a program whose residuals were not saved: its
transpose computes the results again, of which only those with a cotangent are differentiated.
"""

from typing import NamedTuple

import jax

from kept_programs.derived import Pruned, backward, derivation, derived, of_moving, pruned, types_of
from kept_programs.masks import Mask, both, chosen, not_, placed, with_tangent
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
        primals, tangents_in = leaves[: len(moving)], leaves[len(moving) :]
        of_primals = of_moving(program, moving, primals)
        results, tangents_out = jax.jvp(of_primals, chosen(primals, moving), tangents_in)
        return chosen(tangents_out, with_tangent(results))

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
    does not need. A pruned program and the whole one share their transposes.

    Example: a program of (a, b, x, y) has the results a x and b y. It is linear in x and y, `linear` =
    (F, F, T, T), and the second result alone has a cotangent, `given` = (F, T). That result needs b and y,
    `kept` = (F, T, F, T). The transpose therefore takes b and the cotangent of b y, and gives the cotangent
    of y: `arguments` = (F, T, F, F), `reached` = (F, F, F, T)."""
    if isinstance(program, Pruned):
        whole, remain = transposed(*of_whole(program, linear, given)), program.facts.about
        return Transposed(whole.program, chosen(whole.arguments, remain), chosen(whole.reached, remain))
    if isinstance(program, TangentAgain) and not any(linear[: len(program.moving)]):
        return pulled_back_along(program, linear[len(program.moving) :], given)
    shorter = pruned(program, given)
    kept = shorter.facts.about
    back = backward(shorter, chosen(linear, kept))
    return Transposed(back, arguments=both(kept, not_(linear)), reached=both(kept, linear))


def pulled_back_along(program: TangentAgain, linear: Mask, given: Mask) -> Transposed:
    """The transpose of recomputed tangents, whose arguments are those of the primal program, followed by
    the tangents of the moving ones. linear: which tangents are linear arguments."""
    shorter = pruned(program.primal, placed(with_tangent(program.primal.facts.results), given))
    kept, moving = shorter.facts.about, placed(program.moving, linear)
    back = pulled_back(shorter, chosen(moving, kept))
    reached = both(chosen(kept, program.moving), linear)
    no_primal, no_tangent = (False,) * len(kept), (False,) * len(reached)
    return Transposed(back, arguments=(*kept, *no_tangent), reached=(*no_primal, *reached))


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
