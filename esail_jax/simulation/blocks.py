"""A sail's run by collocation: its programs, and how they are compiled.

The method's own steps run in blocks (`steppers/collocation.py`) from the start past the end time; saved
instants are read off the polynomials of the steps they lie in. A block depends on nothing but the
state it starts from, so that a run may stop after any of them and go on later: the host's loop is in
`simulation/block_march.py`, that of a traced run in `simulation/traced_blocks.py`.
"""

import functools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax import observables
from esail_jax.array_types import Array, Float, Int, Scalar, Vector
from esail_jax.compiler import LOOK_OPTIONS, START_OPTIONS, compile_lowered
from esail_jax.iteration_matrix import FactoredMass, Inertia, factor_mass, inertia_of
from esail_jax.numerics.lockstep import written
from esail_jax.scenes.build import Model, build
from esail_jax.scenes.method_choice import COLLOCATION_TOLERANCE
from esail_jax.scenes.structure import Numbers, Structure
from esail_jax.simulation.entry import origin_of
from esail_jax.steppers.collocation import KEEP, Collocation
from esail_jax.steppers.collocation_stages import Point
from esail_jax.steppers.collocation_steps import Progress, Record, no_record
from esail_jax.steppers.consistent import project
from esail_jax.system import System

ROWS_PER_LOOK = 256
"""Saved instants looked at together, at most."""

BLOCKS_PER_CALL = 8
"""Between two of which the host may stop: some tenths of a second. A call costs the host a millisecond."""


class Problem(NamedTuple):
    """A built sail, the method that runs it, and its inertia, factored (`newton_matrix.inertia_of`)."""

    system: System
    method: Collocation
    origin: Vector
    inertia: Inertia

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of everything that was built."""
        return self.system.terms

    def since(self, time: Scalar | np.ndarray) -> "Problem":
        """With the system as it is after `time`."""
        return self._replace(system=self.system.since(time))


class Carry(NamedTuple):
    """What one call hands to the next. seen: the state at the last saved instant; counted: steps that had
    ended by then."""

    progress: Progress
    start_energy: Scalar
    seen: Point
    counted: Scalar


def problem_of(structure: Structure, numbers: Numbers, step: Array | None) -> tuple[Model, Problem, Carry]:
    """A sail, its method and its start."""
    model = build(structure, numbers)
    system = model.system
    tolerance = numbers.get("integrator.tolerance", jnp.asarray(COLLOCATION_TOLERANCE))
    method = Collocation(step, tolerance)
    progress = method.start(system, jnp.zeros(()), model.q, model.v)
    energy = observables.kinetic_energy(system, model.v) + observables.elastic_energy(system, model.q)
    problem = Problem(system, method, origin_of(numbers), inertia_of(system))
    return model, problem, Carry(progress, energy, progress.now, progress.taken)


def run_blocks(problem: Problem, carry: Carry, target: Scalar) -> tuple[Carry, Record]:
    """Blocks until `target` is reached, BLOCKS_PER_CALL at most; the records of all their steps."""
    method, system = problem.method, problem.system

    def going(state):
        count, progress, _ = state
        return (count < BLOCKS_PER_CALL) & (progress.now.time < target) & ~method.stuck(progress)

    def block(state):
        count, progress, kept = state
        progress, records = method.block(system, progress)
        return count + 1, progress, written(kept, count, records, True)

    empty = jax.tree.map(
        lambda x: jnp.zeros((BLOCKS_PER_CALL, KEEP, *x.shape), x.dtype), no_record(carry.progress)
    )
    _, progress, records = lax.while_loop(going, block, (jnp.zeros((), int), carry.progress, empty))
    flat = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), records)
    return carry._replace(progress=progress), flat


def standing(point: Point, like: Record) -> Record:
    """Records of steps that go nowhere, for a look at a run that could take none."""
    start = jax.tree.map(lambda x, y: jnp.broadcast_to(x, y.shape), point, like.start)
    return like._replace(start=start, h=jnp.ones_like(like.h), taken=jnp.ones_like(like.taken))


def step_of(records: Record, time: Scalar) -> Int[Array, ""]:
    """Index of the step that an instant lies in."""
    return jnp.argmax(records.taken & (time <= records.end))


def point_at(problem: Problem, records: Record, time: Scalar) -> tuple[Point, FactoredMass]:
    """State at an instant within the recorded steps, on the constraints, and its mass matrix: that of
    the polynomial's state, which is off the constraints by less than the error of a step."""
    index = step_of(records, time)
    step = jax.tree.map(lambda x: x[index], records)
    return point_within(problem, step, time)


def point_within(problem: Problem, step: Record, time: Scalar) -> tuple[Point, FactoredMass]:
    """`point_at` for an instant within one step."""
    point = step.at(time)
    mass = factor_mass(problem.system, time, point.q, problem.inertia)
    q, v = project(problem.system, time, point.q, point.v, mass)
    return point._replace(q=q, v=v), mass


def observed(
    problem: Problem, start_energy: Scalar, point: Point, mass: FactoredMass | None = None
) -> dict[str, Array]:
    """Observables of an instant. mass: its mass matrix, where that is known."""
    if mass is None:
        mass = factor_mass(problem.system, point.time, point.q, problem.inertia)
    state = (point.time, point.q, point.v, point.work, start_energy)
    instant = observables.make_instant(problem.system, problem.origin, *state, mass)
    return observables.observe(instant)


def violation(system: System, point: Point) -> Scalar:
    """Largest constraint violation [m]."""
    if not system.has_constraints:
        return jnp.zeros(())
    found = jax.tree.leaves(system.constraints(point.time, point.q))
    return jnp.stack([jnp.abs(x).max() for x in found]).max()


def look(
    problem: Problem, carry: Carry, records: Record, times: Float[Array, " row"], count: Int[Array, ""]
) -> tuple[dict[str, Array], Point, Float[Array, " row"]]:
    """Observables at the first `count` of several instants, the state at the last of them, and the
    constraint violations [m]."""

    def one(time):
        point, mass = point_at(problem, records, time)
        return observed(problem, carry.start_energy, point, mass), violation(problem.system, point), point

    def keep(row, kept):
        rows, gaps, _ = kept
        seen, gap, point = one(times[row])
        return *written((rows, gaps), row, (seen, gap), True), point

    # Row by row: one instant fits into the first cache, which makes them a third faster.
    seen = jax.eval_shape(lambda: one(times[0])[0])
    room = jax.tree.map(lambda x: jnp.zeros((ROWS_PER_LOOK, *x.shape), x.dtype), seen)
    rows, gaps, point = lax.fori_loop(0, count, keep, (room, jnp.zeros(ROWS_PER_LOOK), carry.seen))
    return rows, point, gaps


def go_on(
    problem: Problem, after: Problem, carry: Carry, records: Record, time: Scalar, until: Scalar
) -> Carry:
    """From an instant within the recorded steps, at which the problem becomes another one; until: when it
    does so again."""
    point, _ = point_at(problem, records, time)
    before = carry.progress
    fresh = problem.method.start_again(after.system, point, before.taken, before.rejected, until)
    return carry._replace(progress=fresh)


class Programs(NamedTuple):
    """Compiled `start(numbers, step)`, `blocks(problem, carry, target)`,
    `look(problem, carry, records, times, count)` and, of a scene with events or switched voltages,
    `go_on(problem, after, carry, records, time, until)`."""

    start: Callable
    blocks: Callable
    look: Callable
    go_on: Callable | None


@functools.lru_cache(maxsize=64)
def programs(
    structure: Structure, shapes: tuple[tuple[str, tuple[int, ...]], ...], fixed: bool
) -> Programs:
    """The programs of a sail's structure, for any numbers, step and end time."""
    numbers = {key: jax.ShapeDtypeStruct(shape, float) for key, shape in shapes}
    number = jax.ShapeDtypeStruct((), float)
    step = number if fixed else None
    with ThreadPoolExecutor() as pool:
        starting = jax.jit(problem_of, static_argnums=0).lower(structure, numbers, step)
        start = pool.submit(starting.compile, compiler_options=START_OPTIONS)
        _, problem, carry = starting.out_info
        # Then the longest, so that the others are traced while it compiles.
        stepping = jax.jit(run_blocks).lower(problem, carry, number)
        blocks = pool.submit(compile_lowered, stepping)
        times = jax.ShapeDtypeStruct((ROWS_PER_LOOK,), float)
        count = jax.ShapeDtypeStruct((), int)
        looking = jax.jit(look).lower(problem, carry, stepping.out_info[1], times, count)
        seeing = pool.submit(compile_lowered, looking, LOOK_OPTIONS)
        switching = None
        if structure.has("event") or structure.has("voltage.on"):
            going_on = jax.jit(go_on).lower(problem, problem, carry, stepping.out_info[1], number, number)
            switching = pool.submit(going_on.compile, compiler_options=START_OPTIONS).result()
        return Programs(start.result(), blocks.result(), seeing.result(), switching)
