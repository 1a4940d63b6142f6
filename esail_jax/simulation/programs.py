"""Compilation of the programs of a run, which are cached for scenes of the same structure.

Tracing holds Python's global lock, compiling does not. The programs are therefore traced one after the
other and compiled in parallel, which takes three quarters of the time on two cores."""

import functools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.compiler import CHAIN_OPTIONS, COMPILER_OPTIONS, LOOK_OPTIONS, START_OPTIONS, compile_lowered
from esail_jax.scenes.structure import Numbers, Structure
from esail_jax.simulation.advance import Window, advance
from esail_jax.simulation.look import look_at_window
from esail_jax.simulation.problem import restart, start
from esail_jax.steppers.stepper import AbstractStepper, Log, Motion, Point
from esail_jax.system import System

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


Shapes = tuple[tuple[str, tuple[int, ...]], ...]


def compile_programs(
    structure: Structure,
    numbers: Numbers,
    stepper: AbstractStepper | None = None,
    point: Point | None = None,
    names: tuple[str, ...] | None = None,
) -> Programs:
    """Returns the programs for any numbers of these shapes, any end time and any saved instants. names: the
    observables to save, all of them if None."""
    shapes = tuple((key, value.shape) for key, value in sorted(numbers.items()))
    extra, tree = jax.tree.flatten((stepper, point))
    kinds = tuple((np.shape(x), jnp.result_type(x)) for x in extra)
    return _compiled(structure, shapes, tree, kinds, names)


@functools.lru_cache(maxsize=64)
def _compiled(
    structure: Structure, shapes: Shapes, tree: Any, kinds: tuple, names: tuple[str, ...] | None
) -> Programs:
    numbers = {key: jax.ShapeDtypeStruct(shape, float) for key, shape in shapes}
    extra = jax.tree.unflatten(tree, [jax.ShapeDtypeStruct(*kind) for kind in kinds])
    number, integer = jax.ShapeDtypeStruct((), float), jax.ShapeDtypeStruct((), int)
    with ThreadPoolExecutor() as pool:
        starting = jax.jit(start, static_argnums=0).lower(structure, numbers, *extra)
        begun = starting.out_info
        problem, motion = begun.problem, begun.motion
        chain = problem.stepper.relative_coordinates
        starts = pool.submit(starting.compile, compiler_options=CHAIN_OPTIONS if chain else START_OPTIONS)
        step = motion.last.taken.shape[0]
        size = degrees_of_freedom(problem.system)
        instants = int(np.clip(NUMBERS_PER_CALL // (4 * size), 1, MAX_INSTANTS))
        batch = problem.stepper.blocks_per_batch * step
        batches = int(np.clip(WORK_PER_CALL // (batch * size), 1, MAX_ATTEMPTS // batch))
        window = Window(jax.ShapeDtypeStruct((instants,), float), integer)

        def advance_window(problem, motion, window, max_steps, max_batches):
            keep = lambda steps: steps.log.table()  # noqa: E731
            return advance(problem, motion, window, max_steps, max_batches, keep, batches)

        # The slowest one first: the others are traced while it compiles.
        stepping = jax.jit(advance_window).lower(problem, motion, window, number, integer)
        if chain:
            advances = pool.submit(stepping.compile, compiler_options=CHAIN_OPTIONS)
        else:
            advances = pool.submit(compile_lowered, stepping, COMPILER_OPTIONS)
        points = stepping.out_info.points
        looking = jax.jit(look_at_window, static_argnums=3).lower(problem, points, integer, names)
        looks = (
            pool.submit(looking.compile, compiler_options=CHAIN_OPTIONS)
            if chain
            else pool.submit(compile_lowered, looking, LOOK_OPTIONS)
        )
        restarts = None
        if structure.has("event") or structure.has("voltage.on"):
            one = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape[1:], x.dtype), points)
            restarting = jax.jit(restart).lower(problem, motion, one, number)
            restarts = pool.submit(restarting.compile, compiler_options=START_OPTIONS).result()
        statistics = tuple(jax.eval_shape(motion_log, motion).statistics)
        compiled = (starts.result(), advances.result(), looks.result(), restarts)
        shapes = {name: x.shape[1:] for name, x in looking.out_info[0].items()}
        return Programs(*compiled, instants, batches, statistics, shapes)


def motion_log(motion: Motion) -> Log:
    """Returns the log of the last block."""
    return motion.last.log


def degrees_of_freedom(system: System) -> int:
    """Returns the number of coordinates; it depends on shapes only."""
    tethers = system.tethers
    return 3 * tethers.coefs * (tethers.elements + 1) * tethers.count + 12 * (system.hub is not None)
