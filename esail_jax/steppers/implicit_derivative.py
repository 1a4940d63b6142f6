"""The derivative of the solution of the equations of a step, by the implicit function theorem.

The equations R(s, x) = 0 give the unknowns x of a step from its start s. With their linearisation about the
solution, A_1 = dR/ds and A_2 = dR/dx, a change of the start and of the numbers of the system gives

    A_1 ds + A_2 dx + dR = 0,

where dR is the change of the left-hand sides by the numbers. Steppers differ in their unknowns, their
left-hand sides and their way to solve with A_2; what they share stands here."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Generic, TypeVar

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.numerics.symbolic_zeros import bundled, tied
from esail_jax.system import System

Start = TypeVar("Start")
Unknowns = TypeVar("Unknowns")


class Linearised(ABC, Generic[Start, Unknowns]):
    """The equations of a step, linearised about their solution for changes of the start and the unknowns.

    system: of the step; start, unknowns: those of the solution."""

    system: System
    start: Start
    unknowns: Unknowns

    @abstractmethod
    def rows(self, system: System, moved: Start, change: Unknowns) -> Unknowns:
        """The left-hand sides after changes of the start and of the unknowns."""

    @abstractmethod
    def transposable(self) -> System:
        """The system with derivatives that have transposes written by hand."""

    @property
    def nothing(self) -> tuple[Start, Unknowns]:
        """Zero changes of the start and of the unknowns."""
        return jax.tree.map(jnp.zeros_like, (self.start, self.unknowns))

    def forwards(self) -> Callable[[Start, Unknowns], Unknowns]:
        """The derivative of `rows` as a linear function, (ds, dx) -> A_1 ds + A_2 dx."""
        return jax.linearize(lambda *x: self.rows(self.system, *x), *self.nothing)[1]

    def backwards(self) -> Callable[[Unknowns], tuple[Start, Unknowns]]:
        """The transpose of that derivative, y -> (A_1^T y, A_2^T y)."""
        system = self.transposable()
        return jax.vjp(lambda *x: self.rows(system, *x), *self.nothing)[1]


def implicit_change(
    forwards: Callable[[], Callable[[Any, Any], Any]],
    moved: Any,
    given: Any,
    zero: Any,
    solve: Callable[[Callable[[Any, Any], Any], Any], Any],
    solve_transposed: Callable[[Any], tuple[Any, Any]],
) -> Any:
    """dx with A_1 ds + A_2 dx + dR = 0, which knows its transpose for reverse mode.

    forwards: makes the linear function (ds, dx) -> A_1 ds + A_2 dx; moved: ds; given: dR; zero: dx = 0;
    solve: solves A_2 dx = y, given that function and y; solve_transposed: solves A_2^T y = z, and also
    gives A_1^T y, as (A_1^T y, y).

    The start's change is made part of the linear system, (1, 0; A_1, A_2) (ds, dx) = (ds, -dR), so that JAX
    transposes both blocks by the hand-written rule of `transposable` instead of transposing the forward
    product."""

    def product(both):
        return bundled((both[0], forwards()(*both)))

    def solve_both(_, both):
        moved, rows = both
        along = forwards()
        rows = jax.tree.map(jnp.subtract, rows, along(moved, zero))
        return moved, solve(along, rows)

    def solve_both_transposed(_, both):
        moved, rows = both
        by_start, y = solve_transposed(rows)
        return jax.tree.map(jnp.subtract, moved, by_start), y

    both = bundled((moved, jax.tree.map(jnp.negative, given)))
    moved, change = lax.custom_linear_solve(product, both, solve_both, solve_both_transposed)
    return tied(change, moved)
