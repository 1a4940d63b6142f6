"""A run as one program, for `jit`, `grad`, `jvp` and `vmap`: a scan over windows of instants."""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.sharding import get_abstract_mesh

from esail_jax.array_types import Array, Bool, Float, Scalar
from esail_jax.compilation.kept import program_of
from esail_jax.compilation.options import LOOK_OPTIONS
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.environment.kepler_orbit import KeplerOrbit
from esail_jax.numerics.lockstep import select
from esail_jax.numerics.symbolic_zeros import with_tangents
from esail_jax.rod_chain import RodState
from esail_jax.scenes.structure import Numbers, Structure
from esail_jax.simulation.advance import Window, keep_tapes, move, point_of, room_for
from esail_jax.simulation.divided_windows import DividedPlan, divided_plan, divided_windows
from esail_jax.simulation.law_jumps import without_derivative
from esail_jax.simulation.look import look, on_constraints, with_running_observables
from esail_jax.simulation.problem import Carried, Problem, restart, start
from esail_jax.simulation.rectification import AnyPoint, PointOnOrbit
from esail_jax.simulation.schedule import Plan, Schedule
from esail_jax.steppers.kinks import between_segments
from esail_jax.steppers.results import RESULTS
from esail_jax.steppers.stepper import INSTANTS_TOGETHER, AbstractStepper, Motion, Point
from esail_jax.system import Power
from kept_programs.calls import call

ROWS = "thermal.time"
"""Key of the instants at which segments meet in a kink. At the others the forces are smooth, or their kinks
are knots."""


class Traced(NamedTuple):
    """The result of a traced run.

    rows: observables by name, NaN from a failure on; point: the last point; result: a member of `RESULTS`;
    counts: numbers of steps taken and rejected; errors: the stepper's estimates of its errors; jumped:
    whether a law has jumped, None if it is not looked for (`law_jumps.py`)."""

    rows: dict[str, Array]
    point: AnyPoint
    result: RESULTS
    counts: Float[Array, "2"]
    errors: dict[str, Scalar]
    jumped: Bool[Array, ""] | None = None


def traced_run(
    structure: Structure,
    schedule: Schedule,
    names: tuple[str, ...] | None,
    numbers: Numbers,
    max_steps: Scalar,
    stepper: AbstractStepper | None = None,
    point: AnyPoint | None = None,
) -> Traced:
    """Integrates the whole run. Reverse mode saves the motion between windows, and the tapes of the steps.

    schedule: the windows of the run; names: observables to save, all if None; point: an instant to start
    from, instead of the scene's start.

    The run and the observables at its saved instants are called as two programs, whose derivatives and
    batches are kept in the program cache. A run with a part that cannot be kept, or on several devices, is
    traced as an ordinary function."""
    how = structure, schedule.divided, schedule.is_switched
    plan = divided_plan(schedule) if schedule.divided else schedule.plan()
    arguments = plan, numbers, max_steps, stepper, point
    program = program_of(run, how, arguments)
    unjitted = jax.config.jax_disable_jit  # type: ignore[attr-defined]  # JAX's types lack its options
    if program.program.key is None or unjitted or not get_abstract_mesh().empty:
        traced = ordinary_run(*how, names, *arguments)
    else:
        moved = call(program, *arguments, expected=usual_cotangents)
        looking = (numbers, stepper, point), moved
        traced = call(program_of(observe, (names,), looking, LOOK_OPTIONS), *looking, recompute=True)
    return traced._replace(rows=first_rows(len(schedule.times), traced.rows))


@functools.partial(jax.jit, static_argnums=0)
def first_rows(count: int, rows: dict[str, Array]) -> dict[str, Array]:
    """The rows without those by which their number was rounded up. Outside of a trace this is one
    small program, not one for every observable."""
    return {name: x[:count] for name, x in rows.items()}


class Moved(NamedTuple):
    """The motion of a traced run.

    problem: the model and the stepper of the run; points: dense output at the saved instants; carried: what
    the run carried along there; segments: the switch times before and after the instants, None without any;
    good: whether the run reached them; orbit: the sail's orbit about the Sun at the end; result, counts,
    errors, jumped: those of `Traced`, before the observables are known."""

    problem: Problem
    points: Point
    carried: Carried
    segments: tuple[Array, Array] | None
    good: Bool[Array, " instant"]
    orbit: KeplerOrbit | None
    result: RESULTS
    counts: Float[Array, "2"]
    errors: dict[str, Scalar]
    jumped: Bool[Array, ""] | None


class BetweenWindows(NamedTuple):
    """What goes from one window of a traced run to the next: the motion, the last instant passed, and what
    the run carries along."""

    motion: Motion
    point: Point
    carried: Carried


def usual_cotangents(moved: Moved) -> Moved:
    """Which parts of the motion most objectives depend on: not energies, work and times."""
    usual = jax.tree.map(lambda _: True, moved)
    unusual = jax.tree.map(lambda _: False, moved)
    return unusual._replace(
        problem=usual.problem._replace(start_energy=False),
        points=unusual.points._replace(q=usual.points.q, v=usual.points.v),
        orbit=usual.orbit,
    )


def run(
    structure: Structure,
    divided: tuple[str, ...],
    is_switched: bool,
    plan: Plan | DividedPlan,
    numbers: Numbers,
    max_steps: Scalar,
    stepper: AbstractStepper | None,
    point: AnyPoint | None,
) -> Moved:
    """Integrates the whole run. divided: keys of traced numbers at whose instants it is divided;
    is_switched: whether the stepper may be initialised again within the run."""
    first = start(structure, numbers, stepper, point)
    problem = first.problem
    if isinstance(plan, DividedPlan):
        instants = jnp.concatenate([jnp.ravel(numbers[key]) for key in divided])
        plan = divided_windows(plan, instants)
    windows, number, place = jax.tree.map(jnp.asarray, plan)

    def restart_if_switched(now, at, window):
        """The motion, and what the run carries along, at the start of a window: those at the end of the one
        before, unless a switch time lies between the two."""
        due = None if at.carried.control is None else window.samples

        def restarted():
            point = on_constraints(now, at.point)[0]
            if ROWS in divided:
                rows = jnp.ravel(numbers[ROWS])
                point = in_next_segment(now.under(at.carried).settled(), point, rows, window.start)
            good = restart(now, at.motion, point, window.until, at.carried, due)
            return select(is_good(at.motion), good, (at.motion, at.carried))

        return lax.cond(window.after_switch, restarted, lambda: (at.motion, at.carried))

    @keep_tapes
    def one_window(at, window):
        now, motion, carried = problem, at.motion, at.carried
        if is_switched:
            now = problem.in_segment(window.start, window.until)
            motion, carried = restart_if_switched(now, at, window)
        now = now.under(carried).settled()
        motion, points, passed = move(now, motion, Window(window.times, window.count), max_steps)
        last = jax.tree.map(lambda x: x[window.count - 1], points)
        return BetweenWindows(motion, last, carried), (points, passed, carried.without_memory)

    nothing = jax.tree.map(
        lambda x: x[0], room_for(1, lambda: point_of(problem, first.motion, windows.times[0, 0]))
    )
    at_start = BetweenWindows(first.motion, nothing, first.carried)
    at_start = differentiable(at_start, (numbers, stepper, point))
    (motion, _, last), (points, passed, carried) = lax.scan(one_window, at_start, windows)

    points = jax.tree.map(lambda x: x[number, place], points)
    carried = jax.tree.map(lambda x: x[number], carried)
    segments = (windows.start[number], windows.until[number]) if is_switched else None
    result, errors = motion.state.result, problem.stepper.error_estimates(motion.state)
    good = place < passed[number]
    jumped = None if motion.jump is None else motion.jump > 0.0
    of_run = result, motion.counts, errors, jumped
    return Moved(problem, points, carried, segments, good, last.orbit, *of_run)


def in_next_segment(
    problem: Problem, point: Point, instants: Float[Array, " knot"], start: Scalar
) -> Point:
    """The point at which a run goes on in a segment, with the derivatives that a kink of the
    temperatures there gives it. problem: that of the segment; instants: rows of the temperatures [s];
    start [s]: the start of the segment, which is one of these or has no kink."""
    system = problem.system
    same = instants == start
    instant = jnp.where(same, instants, 0.0).sum() / jnp.maximum(same.sum(), 1)
    before = system.in_segment(jnp.asarray(-jnp.inf), start)
    v, work = jax.tree.map(jnp.add, (point.v, point.work), between_segments(before, system, point, instant))
    return point._replace(v=v, work=work)


def observe(
    names: tuple[str, ...] | None,
    arguments: tuple[Numbers, AbstractStepper | None, AnyPoint | None],
    moved: Moved,
) -> Traced:
    """The observables at the saved instants of a run. arguments: those of the run that may be
    differentiated."""
    problem, points, carried, segments, good, orbit, result, counts, errors, jumped = moved
    # In batches of equal length. The last instant is repeated to fill the last batch.
    instants = len(points.time)
    together = -(-instants // -(-instants // INSTANTS_TOGETHER))
    number = np.minimum(np.arange(instants + -instants % together), instants - 1)

    def observed(row):
        segment, point, carried = row
        now = problem if segment is None else problem.in_segment(*segment)
        return look(now.under(carried).settled(), point, names)[:2]

    each = jax.tree.map(lambda x: x[number], (segments, points, carried))
    seen = lax.map(observed, each, batch_size=together)
    rows, points = jax.tree.map(lambda x: x[:instants], seen)
    rows, _, kept = with_running_observables(problem, rows, (jnp.nan, 0.0), jnp)
    if kept is not None:
        drifted = ~(kept | ~good).all()
        result = RESULTS.where(drifted & (result == RESULTS.successful), RESULTS.energy_drift, result)
        good = jnp.cumprod(good & kept).astype(bool)
    zero = zero_of(arguments)
    rows = {name: nan_unless(along(good, x), x, zero) for name, x in rows.items()}
    final = PointOnOrbit.of(jax.tree.map(lambda x: x[-1], points), orbit)
    final = jax.tree.map(lambda x: nan_unless(good[-1], x, zero), final)
    if jumped is not None:
        rows, final = (
            jax.tree.map(lambda x: without_derivative(x, jumped), part) for part in (rows, final)
        )
    return Traced(rows, final, result, counts, errors, jumped)


def whole_run(
    structure: Structure,
    divided: tuple[str, ...],
    is_switched: bool,
    names: tuple[str, ...] | None,
    plan: Plan | DividedPlan,
    numbers: Numbers,
    max_steps: Scalar,
    stepper: AbstractStepper | None,
    point: AnyPoint | None,
) -> Traced:
    """The result of `traced_run`, without programs."""
    moved = run(structure, divided, is_switched, plan, numbers, max_steps, stepper, point)
    return observe(names, (numbers, stepper, point), moved)


ordinary_run = jax.jit(whole_run, static_argnums=(0, 1, 2, 3))


def differentiable(carry: Any, of: Any) -> Any:
    """The carry of a scan, in which every array of the motion has a tangent if anything in `of` is
    differentiated. Times and step sizes have none."""
    arrays, structure = jax.tree.flatten(carry, is_leaf=is_motion)
    moving = [i for i, x in enumerate(arrays) if is_motion(x)]
    moved = with_tangents([arrays[i] for i in moving], of)
    for i, x in zip(moving, moved, strict=True):
        arrays[i] = x
    return jax.tree.unflatten(structure, arrays)


def is_motion(x: Any) -> bool:
    """Tells whether a node of a tree holds coordinates, multipliers, powers and works, or an orbit."""
    return isinstance(x, Coordinates | Multipliers | Power | RodState | KeplerOrbit)


def is_good(motion) -> Array:
    """Tells whether the stepper can go on."""
    return motion.state.result == RESULTS.successful


def zero_of(arguments: Any) -> Scalar:
    """zero, as a function of all numbers of a run."""
    numbers = [x for x in jax.tree.leaves(arguments) if jnp.issubdtype(jnp.result_type(x), jnp.floating)]
    return sum((jnp.where(jnp.isfinite(x), 0.0 * x, 0.0).sum() for x in numbers), jnp.zeros(()))


def nan_unless(good: Array, x: Array, zero: Scalar) -> Array:
    """x, and NaN where a run has failed.

    zero: `zero_of` the run's arguments. Its product with NaN makes derivatives of failed rows NaN as well.
    A selection alone would give the derivative of the rows before the failure, without a warning."""
    if not jnp.issubdtype(x.dtype, jnp.inexact):
        return x
    return jnp.where(good, x, 0.0) + jnp.where(good, 0.0, jnp.nan) * zero


def along(mask: Array, like: Array) -> Array:
    """A mask over instants with as many axes as `like`."""
    return mask.reshape(-1, *(1,) * (like.ndim - 1))
