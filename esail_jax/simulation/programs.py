"""Compiling: the three programs of a run at once, each kept for scenes of the same structure.

Tracing holds Python's lock, compiling does not, so the programs are traced in turn and compiled side
by side: three quarters of the time on two cores.
"""

import functools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import jax
import numpy as np

from esail_jax.array_types import Array
from esail_jax.compiler import LOOK_OPTIONS, compile_lowered
from esail_jax.scenes.build import build_jitted
from esail_jax.scenes.structure import Numbers, Structure
from esail_jax.simulation.entry import entry_data, look_at_entry_jitted, problem_of, step_entry_jitted
from esail_jax.simulation.schedule import Entry, Plan
from esail_jax.steppers.fixed_step import KEEP


class Programs(NamedTuple):
    """Compiled `build(numbers)`, `step_entry(problem, state, data)` and
    `look_at_entry(problem, carry, data, after, record, info)`."""

    build: Callable
    step: Callable
    look: Callable


def programs(structure: Structure, numbers: Numbers, layout: Plan) -> Programs:
    """The programs of a scene's structure, for any numbers and any end time."""
    shapes = shapes_of(numbers)
    return _compiled(structure, shapes, layout.steps_per_entry, layout.rows_per_entry, layout.between)


def shapes_of(numbers: Numbers) -> tuple[tuple[str, tuple[int, ...]], ...]:
    """Keys and shapes of a scene's numbers."""
    return tuple((key, value.shape) for key, value in sorted(numbers.items()))


@functools.lru_cache(maxsize=64)
def _compiled(
    structure: Structure,
    shapes: tuple[tuple[str, tuple[int, ...]], ...],
    steps: int,
    rows: int,
    between: bool,
) -> Programs:
    numbers = {key: jax.ShapeDtypeStruct(shape, float) for key, shape in shapes}
    data = jax.tree.map(abstract, entry_data(Entry("march", 0.0, 1.0, 1), rows))
    built = build_jitted.lower(structure, numbers)
    problem, carry = jax.eval_shape(problem_of, numbers, built.out_info)
    with ThreadPoolExecutor() as pool:
        # The longest first, so that the others are traced while it compiles.
        stepping = step_entry_jitted.lower(problem, carry.state, data, steps, KEEP, between)
        step = pool.submit(compile_lowered, stepping)
        building = pool.submit(built.compile)
        looking = look_at_entry_jitted.lower(problem, carry, data, *stepping.out_info, between)
        look = pool.submit(compile_lowered, looking, LOOK_OPTIONS)
        return Programs(building.result(), step.result(), look.result())


def abstract(value: "Array | np.ndarray") -> jax.ShapeDtypeStruct:
    """Shape and type of an array."""
    array = np.asarray(value)
    return jax.ShapeDtypeStruct(array.shape, array.dtype)
