"""A sail's run by collocation: the compiled programs, and the host's loop around them.

The method's own steps run in blocks (`dynamics/collocation.py`) from the start past the end time; saved
instants are read off the polynomials of the steps they lie in. A block depends on nothing but the
state it starts from, so that a run may stop after any of them and go on later.
"""

import functools
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax import observables
from esail_jax.array_types import Array, Float, Int, Scalar, Vector
from esail_jax.dynamics.collocation import KEEP, Collocation, Progress, Record, no_record
from esail_jax.dynamics.consistent import project
from esail_jax.dynamics.stages import Point
from esail_jax.entry import QUICK_COMPILE, along_rows, origin_of
from esail_jax.newton_matrix import inertia
from esail_jax.numerics.block_tridiagonal import ChainFactors
from esail_jax.pieces import RESULTS, Checkpoint, Piece, SimulationError, join
from esail_jax.scenes.build import Model, Numbers, Structure, build
from esail_jax.scenes.integration import COLLOCATION_TOLERANCE
from esail_jax.schedule import save_times
from esail_jax.system import System

ROWS_PER_LOOK = 128
"""Saved instants looked at together, at most."""

ROWS_TOGETHER = 32
"""Saved instants of a traced run in one batch."""

BLOCKS_PER_CALL = 4
"""Between two of which the host may stop: some tenths of a second."""

MOST_BLOCKS = 200
"""Of a run that is differentiated: some five thousand steps."""

NUMERICS = {
    "steps": "-",
    "rejected_steps": "-",
    "last_step": "s",
    "iterations_per_step": "-",
    "constraint_violation": "m",
}
"""Names and units of what is kept per saved instant: steps that ended since the instant before, those
repeated (in the call the instant was seen in, with its first instant), the size of the step it lies in,
mean iterations (of the steps of that call), and its constraint violation."""


class Problem(NamedTuple):
    """A built sail, the method that runs it, and its inertia, factored (`newton_matrix.inertia`)."""

    system: System
    method: Collocation
    origin: Vector
    inertia: tuple[ChainFactors, Array]

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of everything that was built."""
        return self.system.terms


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
    problem = Problem(system, method, origin_of(numbers), inertia(system))
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
        return count + 1, progress, jax.tree.map(lambda all, new: all.at[count].set(new), kept, records)

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


def point_at(problem: Problem, records: Record, time: Scalar) -> Point:
    """State at an instant within the recorded steps, on the constraints."""
    step = jax.tree.map(lambda x: x[step_of(records, time)], records)
    q, v, work = step.at(time)
    return Point(time, *project(problem.system, time, q, v, problem.inertia), work)


def observed(problem: Problem, start_energy: Scalar, point: Point) -> dict[str, Array]:
    """Observables of an instant."""
    state = (point.time, point.q, point.v, point.work, start_energy)
    instant = observables.make_instant(problem.system, problem.origin, *state, problem.inertia)
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
        point = point_at(problem, records, time)
        return observed(problem, carry.start_energy, point), violation(problem.system, point), point

    def keep(row, kept):
        rows, gaps, _ = kept
        seen, gap, point = one(times[row])
        rows = jax.tree.map(lambda all, x: all.at[row].set(x), rows, seen)
        return rows, gaps.at[row].set(gap), point

    # Row by row: one instant fits into the first cache, which makes them a third faster.
    seen = jax.eval_shape(lambda: one(times[0])[0])
    room = jax.tree.map(lambda x: jnp.zeros((ROWS_PER_LOOK, *x.shape), x.dtype), seen)
    rows, gaps, point = lax.fori_loop(0, count, keep, (room, jnp.zeros(ROWS_PER_LOOK), carry.seen))
    return rows, point, gaps


# ---- the host's loop ----------------------------------------------------------------------------


class Programs(NamedTuple):
    """Compiled `start(numbers, step)`, `blocks(problem, carry, target)` and
    `look(problem, carry, records, times, count)`."""

    start: Callable
    blocks: Callable
    look: Callable


@functools.lru_cache(maxsize=64)
def programs(
    structure: Structure, shapes: tuple[tuple[str, tuple[int, ...]], ...], fixed: bool
) -> Programs:
    """The programs of a sail's structure, for any numbers, step and end time."""
    numbers = {key: jax.ShapeDtypeStruct(shape, float) for key, shape in shapes}
    number = jax.ShapeDtypeStruct((), float)
    step = number if fixed else None
    _, problem, carry = jax.eval_shape(lambda n, s: problem_of(structure, n, s), numbers, step)
    with ThreadPoolExecutor() as pool:
        # The longest first, so that the others are traced while it compiles. It is worth a slower
        # compilation (entry.QUICK_COMPILE): its steps take a third less time.
        stepping = jax.jit(run_blocks).lower(problem, carry, number)
        blocks = pool.submit(stepping.compile)
        times = jax.ShapeDtypeStruct((ROWS_PER_LOOK,), float)
        count = jax.ShapeDtypeStruct((), int)
        looking = jax.jit(look).lower(problem, carry, stepping.out_info[1], times, count)
        seeing = pool.submit(looking.compile, compiler_options=QUICK_COMPILE)
        starting = jax.jit(problem_of, static_argnums=0).lower(structure, numbers, step)
        start = pool.submit(starting.compile, compiler_options=QUICK_COMPILE)
        return Programs(start.result(), blocks.result(), seeing.result())


class BlockMarch:
    """Runs a prepared sail block by block."""

    def __init__(self, prepared, checkpoint: Checkpoint | None = None):
        self.prepared = prepared
        start = checkpoint or Checkpoint(prepared.carry, 0, 0, 0, (0.0, 0.0))
        self.carry, self.rows, self.steps = start.carry, start.rows, start.steps
        self.rejected = float(start.tally[0])
        self.checkpoint = start
        self.repairs = 0
        scene = prepared.resolved
        self.times = save_times(scene.integrator.t_end, scene.output.interval)

    def pieces(self) -> Iterator[Piece]:
        """One piece per call. Raises SimulationError when the run is stuck, after a last piece with
        what was seen before."""
        problem, compiled = self.prepared.problem, self.prepared.programs
        while self.rows < len(self.times):
            carry, records = compiled.blocks(problem, self.carry, self.times[-1])
            reached = float(carry.progress.now.time)
            tried = np.asarray(records.h)
            shown = records
            if not self.rows and not np.asarray(records.taken).any():
                shown = standing(carry.progress.now, records)  # stuck at the start, which is seen still
            count = int(np.searchsorted(self.times, reached, side="right"))
            times = self.times[self.rows : max(count, self.rows)]
            rows, violation = [], []
            for first in range(0, len(times), ROWS_PER_LOOK):
                part = times[first : first + ROWS_PER_LOOK]
                padded = np.append(part, np.zeros(ROWS_PER_LOOK - len(part)))
                seen, last, gap = compiled.look(problem, carry, shown, padded, len(part))
                rows.append({name: np.asarray(value)[: len(part)] for name, value in seen.items()})
                violation.append(np.asarray(gap)[: len(part)])
                carry = carry._replace(seen=last)
            numerics = self._numerics(records, carry, times, violation)
            if len(times):
                counted = carry.counted + numerics["steps"].sum()
                carry = carry._replace(counted=counted)
            self.carry, self.rows = carry, self.rows + len(times)
            self.steps = int(carry.progress.taken)
            if self.rows < len(self.times):
                # Not the last one: a longer run saves other instants after this one's end time.
                self.checkpoint = Checkpoint(carry, self.rows, self.rows, self.steps, (self.rejected, 0.0))
            if rows:
                yield Piece(join(rows), times, numerics, reached)
            if self.rows < len(self.times) and bool(problem.method.stuck(carry.progress)):
                raise self._failure(carry.progress, tried)

    def _numerics(
        self, records: Record, carry: Carry, times: np.ndarray, violation: list[np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Of the steps that ended since the saved instant before; rejections with the first instant of
        their call."""
        progress, taken = carry.progress, np.asarray(records.taken)
        ends, sizes = np.asarray(records.end)[taken], np.asarray(records.h)[taken]
        cuts = np.searchsorted(ends, times, side="right")
        iterations = np.append(0, np.cumsum(np.asarray(records.info.iterations)[taken]))
        before = float(progress.taken) - len(ends)
        steps = np.diff(before + cuts, prepend=float(carry.counted))
        of_call, work = np.diff(cuts, prepend=0), np.diff(iterations[cuts], prepend=0)
        rejected = np.zeros(len(times))
        if len(times):
            rejected[0] = float(progress.rejected) - self.rejected
            self.rejected = float(progress.rejected)
        inside = np.minimum(cuts, max(len(sizes) - 1, 0))
        values = (
            steps,
            rejected,
            np.append(sizes, float(progress.h))[inside],
            work / np.maximum(of_call, 1),
            np.concatenate([*violation, []]),
        )
        return dict(zip(NUMERICS, values, strict=True))

    def _failure(self, progress: Progress, tried: np.ndarray) -> SimulationError:
        """tried: sizes [s] of the last call's steps."""
        finite = all(np.isfinite(np.asarray(x)).all() for x in jax.tree.leaves(progress.now))
        result = RESULTS.newton_diverged if finite else RESULTS.nonfinite
        size = tried[tried > 0.0][-1] if (tried > 0.0).any() else float("nan")
        hint = "Ask for a shorter one." if self.prepared.problem.method.step_size is not None else ""
        time = float(progress.now.time)
        message = f"{RESULTS[result]} At t = {time:.6g} s with a step of {size:.3g} s. {hint}".strip()
        return SimulationError(message, result, Piece({}, np.empty(0), {}, time))


# ---- under a trace ------------------------------------------------------------------------------


@functools.partial(jax.jit, static_argnums=(0, 1))
def traced_run(
    structure: Structure, times: tuple[float, ...], numbers: Numbers, step: Array | None
) -> tuple[dict[str, Array], Point, RESULTS, Array]:
    """The whole run as one program."""
    _, problem, carry = problem_of(structure, numbers, step)
    instants = jnp.asarray(times)
    points, reached, taken = states_at(problem, carry.progress, instants)
    rows = lax.map(
        lambda point: observed(problem, carry.start_energy, point), points, batch_size=ROWS_TOGETHER
    )
    good = instants <= reached
    rows = {name: jnp.where(along_rows(good, x), x, jnp.nan) for name, x in rows.items()}
    result = RESULTS.where(good.all(), RESULTS.successful, RESULTS.newton_diverged)
    final = jax.tree.map(lambda x: jnp.where(good[-1], x[-1], jnp.nan), points)
    return rows, final, result, taken


@jax.custom_jvp
def states_at(
    problem: Problem, progress: Progress, times: Float[Array, " row"]
) -> tuple[Point, Scalar, Scalar]:
    """States at the saved instants, the time reached, and the steps taken.

    The derivative is that of the steps as they were taken: their sizes carry none. It is written as the
    same blocks in a loop of fixed length, so that forward and reverse mode exist."""
    rows = len(times)

    def going(state):
        progress, row, _ = state
        return (row < rows) & ~problem.method.stuck(progress)

    def block(state):
        progress, row, points = state
        progress, records = problem.method.block(problem.system, progress)

        def passed(inner):
            return (inner[0] < rows) & (times[jnp.minimum(inner[0], rows - 1)] <= progress.now.time)

        def keep(inner):
            row, points = inner
            point = point_at(problem, records, times[row])
            return row + 1, jax.tree.map(lambda all, x: all.at[row].set(x), points, point)

        row, points = lax.while_loop(passed, keep, (row, points))
        return progress, row, points

    empty = jax.tree.map(lambda x: jnp.zeros((rows, *x.shape), x.dtype), progress.now)
    progress, _, points = lax.while_loop(going, block, (progress, jnp.zeros((), int), empty))
    return points, progress.now.time, progress.taken


@states_at.defjvp
def _states_at_jvp(primals, tangents):
    result = states_at(*primals)
    _, moved = jax.jvp(replay, primals, tangents)
    return result, (moved, jnp.zeros(()), jnp.zeros(()))


def replay(problem: Problem, progress: Progress, times: Float[Array, " row"]) -> Point:
    """States at the saved instants from blocks in a loop of fixed length; NaN beyond it."""
    nothing = jax.tree.map(lambda x: jnp.broadcast_to(x, (KEEP, *x.shape)), no_record(progress))

    @jax.checkpoint
    def block(progress):
        return problem.method.block(problem.system, progress, reversible=True)

    def one(progress, _):
        going = (progress.now.time < times[-1]) & ~problem.method.stuck(progress)
        return lax.cond(going, block, lambda progress: (progress, nothing), progress)

    progress, records = lax.scan(one, progress, length=MOST_BLOCKS)
    flat = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), records)
    points = lax.map(lambda time: point_at(problem, flat, time), times, batch_size=ROWS_TOGETHER)
    good = times <= progress.now.time
    return jax.tree.map(lambda x: jnp.where(along_rows(good, x), x, jnp.nan), points)
