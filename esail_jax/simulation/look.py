"""Observables at saved instants: points of dense output are projected on the constraints and evaluated."""

from types import ModuleType
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax import observables
from esail_jax.array_types import Array, Float, Int, Scalar
from esail_jax.compilation.jit import traced_once
from esail_jax.iteration_matrix import FactoredMass, factor_mass
from esail_jax.simulation.problem import Problem
from esail_jax.steppers.consistent import project
from esail_jax.steppers.stepper import Point
from esail_jax.system import System


@traced_once(static_argnums=(2,))
def look(
    problem: Problem, point: Point, names: tuple[str, ...] | None = None
) -> tuple[dict[str, Array], Point, Scalar]:
    """The observables of an instant (those of `names`, all if None), the point projected on the
    constraints, and the largest constraint violation there [m]."""
    system = problem.system
    if observables.is_chain(system):
        of_chain = observables.chain.Instant(
            system.at(point.time),
            problem.hinges,
            point.time,
            point.q,
            point.v,
            point.work,
            problem.start_energy,
        )
        return chosen(observables.chain.observe(of_chain), names), point, jnp.zeros(())
    point, mass = on_constraints(problem, point)
    state = (point.time, point.q, point.v, point.work, problem.start_energy)
    instant = observables.make_instant(system, problem.origin, *state, mass, problem.scene_orbit)
    return chosen(observables.observe(instant, names or ()), names), point, violation(system, point)


def on_constraints(problem: Problem, point: Point) -> tuple[Point, FactoredMass]:
    """The point of a sail projected on the constraints, and its factored mass matrix. A point at
    the end of a step is not changed."""
    system = problem.system
    mass = factor_mass(system, point.time, point.q, problem.inertia)
    q, v = project(system, point.time, point.q, point.v, mass)
    q, v = jax.tree.map(lambda x, y: jnp.where(point.exact, x, y), (point.q, point.v), (q, v))
    return point._replace(q=q, v=v), mass


def chosen(rows: dict[str, Array], names: tuple[str, ...] | None) -> dict[str, Array]:
    """The named observables, or all of them if `names` is None."""
    return rows if names is None else {name: rows[name] for name in names}


def violation(system: System, point: Point) -> Scalar:
    """The largest constraint violation [m]."""
    if not system.has_constraints:
        return jnp.zeros(())
    violations = jax.tree.leaves(system.constraints(point.time, point.q))
    return jnp.stack([jnp.abs(x).max() for x in violations]).max()


def look_at_window(
    problem: Problem, points: Point, count: Int[Array, ""], names: tuple[str, ...] | None = None
) -> tuple[dict[str, Array], Point, Float[Array, " instant"]]:
    """The observables at the first `count` of several points, the last of these points projected on
    the constraints, and the constraint violations [m].

    The instants are evaluated one after the other: the numbers of one fit into the processor's first cache,
    which takes a third less time than a batch."""

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
    """Adds the observables of a chain that depend on earlier rows.

    memory: the energy at the start and the largest kinetic energy so far [J]; xp: numpy or jax.numpy.
    Returns the rows, the memory for the next rows, and for each row whether its energy balance holds (None
    if the method needs no such guard)."""
    if not observables.is_chain(problem.system) or "energy_error" not in rows:
        return rows, memory, None
    rows, memory = observables.chain.with_energy_error(rows, memory, xp)
    if problem.energy_floor is None:
        return rows, memory, None
    # On the host an array of JAX would make every comparison a program to compile.
    return rows, memory, observables.chain.balanced(rows, xp.asarray(problem.energy_floor), xp)
