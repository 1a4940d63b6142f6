"""Observables at saved instants: the points of dense output are projected on the constraints and
observed."""

from types import ModuleType
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax import observables
from esail_jax.array_types import Array, Float, Int, Scalar
from esail_jax.iteration_matrix import FactoredMass, factor_mass
from esail_jax.simulation.problem import Problem
from esail_jax.steppers.consistent import project
from esail_jax.steppers.stepper import Point
from esail_jax.system import System


def look(
    problem: Problem, point: Point, names: tuple[str, ...] | None = None
) -> tuple[dict[str, Array], Point, Scalar]:
    """The observables of an instant, those of `names` if given, the point on the constraints, and the
    largest violation of the constraints there [m]."""
    system = problem.system
    if observables.is_chain(system):
        instant = observables.chain.Instant(
            system, problem.hinges, point.time, point.q, point.v, point.work, problem.start_energy
        )
        return chosen(observables.chain.observe(instant), names), point, jnp.zeros(())
    point, mass = on_constraints(problem, point)
    state = (point.time, point.q, point.v, point.work, problem.start_energy)
    instant = observables.make_instant(system, problem.origin, *state, mass)
    return chosen(observables.observe(instant), names), point, violation(system, point)


def on_constraints(problem: Problem, point: Point) -> tuple[Point, FactoredMass]:
    """The point on the constraints of a sail, and its factored mass matrix. The end of a step stays as it
    is."""
    system = problem.system
    mass = factor_mass(system, point.time, point.q, problem.inertia)
    q, v = project(system, point.time, point.q, point.v, mass)
    q, v = jax.tree.map(lambda x, y: jnp.where(point.exact, x, y), (point.q, point.v), (q, v))
    return point._replace(q=q, v=v), mass


def chosen(rows: dict[str, Array], names: tuple[str, ...] | None) -> dict[str, Array]:
    """The named observables, all of them without names."""
    return rows if names is None else {name: rows[name] for name in names}


def violation(system: System, point: Point) -> Scalar:
    """The largest constraint violation [m]."""
    if not system.has_constraints:
        return jnp.zeros(())
    found = jax.tree.leaves(system.constraints(point.time, point.q))
    return jnp.stack([jnp.abs(x).max() for x in found]).max()


def look_at_window(
    problem: Problem, points: Point, count: Int[Array, ""], names: tuple[str, ...] | None = None
) -> tuple[dict[str, Array], Point, Float[Array, " instant"]]:
    """The observables at the first `count` of several points, the last of these points on the constraints,
    and the constraint violations [m].

    The instants are looked at one after the other: the numbers of one fit into the first cache, which
    takes a third less time than all at once."""

    def one(row):
        return look(problem, jax.tree.map(lambda x: x[row], points), names)

    def put(row, kept):
        rows, gaps, _ = kept
        observed, point, gap = one(row)
        rows, gaps = jax.tree.map(
            lambda all, x: lax.dynamic_update_index_in_dim(all, x, row, 0), (rows, gaps), (observed, gap)
        )
        return rows, gaps, point

    observed, point, _ = jax.eval_shape(lambda: one(0))
    size = len(points.time)
    room = jax.tree.map(lambda x: jnp.zeros((size, *x.shape), x.dtype), observed)
    first = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), point)
    rows, gaps, point = lax.fori_loop(0, count, put, (room, jnp.zeros(size), first))
    return rows, point, gaps


def with_running_observables(
    problem: Problem, rows: dict[str, Any], memory: tuple[Any, Any], xp: ModuleType
) -> tuple[dict[str, Any], tuple[Any, Any], Any]:
    """Rows with the observables that depend on the rows before; the memory for the next rows; and whether
    the energy balance of each row is kept (None where this is not asked). xp: numpy or jax.numpy."""
    if not observables.is_chain(problem.system) or "energy_error" not in rows:
        return rows, memory, None
    rows, memory = observables.chain.with_energy_error(rows, memory, xp)
    if problem.energy_floor is None:
        return rows, memory, None
    return rows, memory, observables.chain.balanced(rows, problem.energy_floor, xp)
