"""Solutions of equations whose derivatives, of any order, follow from the equations."""

import functools
from collections.abc import Callable
from typing import Any

import jax
from jax import lax

from esail_jax.numerics.own_derivative import custom_jvp
from esail_jax.numerics.symbolic_zeros import jvp_of_perturbed


def known_solution(
    residual: Callable[[Any, Any], Any], solve: Callable[[Any, Any, Any], Any], numbers: Any, solution: Any
) -> Any:
    """`solution` as it is, with the derivatives, of any order, of the x that solves
    residual(numbers, x) = 0 (implicit function theorem): dx = -J^-1 d(residual), J = d(residual)/dx.

    solve: returns J^-1 rhs from (numbers, x, rhs), as a differentiable function. The two functions depend
    on traced arrays through their arguments only."""

    @custom_jvp
    def known(numbers: Any, solution: Any) -> Any:
        return solution

    @functools.partial(known.defjvp, symbolic_zeros=True)
    def _known_jvp(primals, tangents):
        x, numbers = known(*primals), primals[0]
        _, moved = jvp_of_perturbed(lambda numbers: residual(numbers, x), primals[:1], tangents[:1])
        return x, solve(numbers, x, jax.tree.map(lambda y: -y, moved))

    return known(numbers, lax.stop_gradient(solution))
