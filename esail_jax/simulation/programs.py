"""Compilation of the programs of a run, which are cached for scenes of the same structure.

Tracing holds Python's global lock, compiling does not. The programs are therefore traced one after the
other and compiled in parallel, which takes three quarters of the time on two cores."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import jax
import numpy as np

from esail_jax.array_types import Array, Scalar
from esail_jax.compilation.announcements import announce
from esail_jax.compilation.kept import program_of
from esail_jax.compilation.options import CHAIN_OPTIONS, LOOK_OPTIONS, START_OPTIONS, STEP_OPTIONS
from esail_jax.scenes.method_choice import stepper_class
from esail_jax.scenes.structure import Numbers, Structure
from esail_jax.simulation.advance import Advanced, Window, advance
from esail_jax.simulation.look import look_at_window
from esail_jax.simulation.problem import Problem, restart, start
from esail_jax.simulation.rectification import AnyPoint
from esail_jax.steppers.log import Log
from esail_jax.steppers.stepper import AbstractStepper, Motion, Point
from esail_jax.system import System
from kept_programs.program import type_of
from kept_programs.remembered import remembered

MAX_ATTEMPTS = 16384
"""Largest number of attempted steps in one call."""

MAX_INSTANTS, NUMBERS_PER_CALL = 256, 2**22
"""Largest number of saved instants in one call, and of numbers in their points (32 MB)."""

WORK_PER_CALL = 400_000
"""Steps times coordinates in one call: some tenths of a second, between which the host may stop."""


class Programs(NamedTuple):
    """The compiled functions `start`, `advance`, `look_at_window` and, for a scene with switch times,
    `restart`.

    instants, batches: largest numbers in one call; statistics: names of the statistics in a block's log;
    shapes: those of the observables at one instant, by name."""

    start: Callable
    advance: Callable
    look: Callable
    restart: Callable | None
    instants: int
    batches: int
    statistics: tuple[str, ...]
    shapes: dict[str, tuple[int, ...]]


def compile_programs(
    structure: Structure,
    numbers: Numbers,
    stepper: AbstractStepper | None = None,
    point: AnyPoint | None = None,
    names: tuple[str, ...] | None = None,
) -> Programs:
    """The programs for any numbers of these shapes, any end time and any saved instants. names: the
    observables to save, all of them if None."""
    leaves, tree = jax.tree.flatten((numbers, stepper, point))
    return _compiled(structure, tree, tuple(map(type_of, leaves)), names)


@remembered(maxsize=64)
def _compiled(structure: Structure, tree: Any, types: tuple, names: tuple[str, ...] | None) -> Programs:
    given = jax.tree.unflatten(tree, types)
    number: Any = jax.ShapeDtypeStruct((), float)  # in place of an array, like those below
    integer: Any = jax.ShapeDtypeStruct((), int)
    kind = stepper_class(structure["integrator.method"]) if given[1] is None else type(given[1])
    rods = kind.relative_coordinates
    of_sail = STEP_OPTIONS, LOOK_OPTIONS, START_OPTIONS
    step_options, look_options, switch_options = (CHAIN_OPTIONS,) * 3 if rods else of_sail

    with ThreadPoolExecutor() as pool:

        def ready(name, function, static, arguments, options):
            """Traces a program here and compiles it in another thread."""
            program = program_of(function, static, arguments, options)
            announce(f"{'loading' if program.is_kept else 'compiling'} the program of {name} ...")
            program.lower()
            return program, pool.submit(program.compile)

        starting, starts = ready("the start", start, (structure,), given, START_OPTIONS)
        problem, motion, carried = (getattr(starting.result, x) for x in ("problem", "motion", "carried"))
        problem = problem.under(carried)
        step = motion.last.taken.shape[0]
        size = degrees_of_freedom(problem.system)
        instants = int(np.clip(NUMBERS_PER_CALL // (4 * size), 1, MAX_INSTANTS))
        batch = kind.blocks_per_batch * step
        batches = int(np.clip(WORK_PER_CALL // (batch * size), 1, MAX_ATTEMPTS // batch))
        times: Any = jax.ShapeDtypeStruct((instants,), float)
        window = Window(times, integer)
        # The slowest one first: the others are traced while it compiles.
        stepping, advances = ready(
            "the time steps",
            advance_window,
            (batches,),
            (problem, motion, window, number, integer),
            step_options,
        )
        points = stepping.result.points
        of_look = problem, points, integer
        looking, looks = ready("the observables", look_at_points, (names,), of_look, look_options)
        restarting = None
        if structure.is_switched:
            one = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape[1:], x.dtype), points)
            due = None if carried.control is None else jax.ShapeDtypeStruct((), bool)
            of_restart = problem, motion, one, number, carried, due
            restarting, restarts = ready("switch times", restart, (), of_restart, switch_options)
            restarts.result()
        for done in (starts, advances, looks):
            done.result()
    statistics = tuple(jax.eval_shape(motion_log, motion).statistics)
    shapes = {name: x.shape[1:] for name, x in looking.result[0].items()}
    return Programs(starting, stepping, looking, restarting, instants, batches, statistics, shapes)


def advance_window(
    batches: int, problem: Problem, motion: Motion, window: Window, max_steps: Scalar, max_batches: Array
) -> Advanced:
    """Advances to the instants of a window and keeps the logs of at most `batches` batches as tables."""
    return advance(
        problem.settled(), motion, window, max_steps, max_batches, lambda steps: steps.log.table(), batches
    )


def look_at_points(names: tuple[str, ...] | None, problem: Problem, points: Point, count: Array) -> Any:
    """Evaluates the observables with these names at the first `count` points."""
    return look_at_window(problem.settled(), points, count, names)


def motion_log(motion: Motion) -> Log:
    """The log of the last block."""
    return motion.last.log


def degrees_of_freedom(system: System) -> int:
    """The number of coordinates; it depends on shapes only."""
    tethers = system.tethers
    vectors = tethers.coefs * (tethers.elements + 1)
    vectors += 0 if system.ring is None else system.ring.own_vectors
    return 3 * vectors * tethers.count + 12 * (system.hub is not None)
