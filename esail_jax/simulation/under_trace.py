"""A run as part of a traced program, for `jit`, `grad`, `jvp` and `vmap`."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Bool, Scalar
from esail_jax.observables.run_warning import STEP_ERRORS
from esail_jax.scenes.method_choice import stepper_class, with_method
from esail_jax.scenes.rules import known
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import split
from esail_jax.simulation.arguments import known_time
from esail_jax.simulation.problem import require_64_bit
from esail_jax.simulation.rectification import AnyPoint
from esail_jax.simulation.schedule import (
    Schedule,
    divided_at,
    sampling_instants,
    save_times,
    switch_times,
)
from esail_jax.simulation.solution import Solution, Stats
from esail_jax.simulation.traced import Traced, nan_unless, traced_run, zero_of
from esail_jax.steppers.results import RESULTS
from esail_jax.steppers.stepper import AbstractStepper

LEAST_WINDOWS, WINDOWS_PER_TURN = 16, 4
"""Least number of windows, and so of checkpoints, in a traced run, and in a turn of the sail. The baseline
needs up to 45 blocks of steps in a turn, three windows."""


def under_trace(scene: Scene, start: Any, stepper: Any) -> bool:
    """Tells whether any number is a tracer, or whether `jax.jit` or the like traces this call."""
    leaves = [x for table in scene.tables.values() for x in vars(table).values()]
    leaves += jax.tree.leaves((start, stepper, scene.voltage_law, scene.terms))
    return any(isinstance(leaf, jax.core.Tracer) for leaf in (*leaves, jax.device_put(0.0)))


def simulate_traced(
    scene: Scene,
    *,
    save: Sequence[str] | None = None,
    times: Sequence[float] | None = None,
    start: AnyPoint | None = None,
    max_steps: int | None = None,
    stepper: AbstractStepper | None = None,
    limit: Scalar | None = None,
) -> Solution:
    """The solution of a run that is part of a traced program, for `jit`, `grad`, `jvp` and `vmap`.
    The arguments are those of `simulate`; limit: largest number of steps in place of `max_steps`, which may
    be a tracer and gives derivatives no more room. Raises RuntimeError in 32-bit mode."""
    require_64_bit()
    resolved = scene if stepper is not None else with_method(scene)
    structure, numbers = split(resolved)
    method = type(stepper) if stepper is not None else stepper_class(structure["integrator.method"])
    if times is None:
        saved = save_times(scene.integrator.t_end, scene.output.interval)
        if start is not None and known_time(start) is not None:
            saved = saved[saved >= known_time(start)]
    else:
        saved = np.asarray(times, float)
    start_time = 0.0 if start is None else known_time(start)
    start_time = float(saved[0]) if start_time is None else start_time
    end, step = float(saved[-1]), resolved.integrator.step
    steps_expected = max_steps
    if step is not None and stepper is None:
        steps_expected = np.ceil((end - start_time) / step) + 1
    windows_at_least = 1
    if step is None or stepper is not None:
        by_turns = int(np.ceil(WINDOWS_PER_TURN * turns(scene, end - start_time)))
        by_kinks = int(np.ceil(kinks(scene, start_time, end) / KINKS_PER_WINDOW))
        windows_at_least = max(LEAST_WINDOWS, by_turns, by_kinks)
    if steps_expected is not None:
        steps_per_window = method.blocks_per_window * method.blocks_per_batch * method.steps_per_block
        by_steps = steps_expected / steps_per_window * (UNEVEN if step is None else MARGIN)
        windows_at_least = max(windows_at_least, int(np.ceil(by_steps)))
    schedule = Schedule(
        times=tuple(saved.tolist()),
        switches=switch_times(scene, end),
        start=start_time,
        size=method.instants_per_window,
        least=windows_at_least,
        divided=divided_at(scene),
        samples=sampling_instants(scene, end),
    )
    names = None if save is None or scene.chain is not None else tuple(save)
    if limit is None:
        limit = jnp.asarray(jnp.inf if max_steps is None else float(max_steps))
    traced = traced_run(structure, schedule, names, numbers, limit, stepper, start)
    if start is not None and known_time(start) is None:
        traced = failed_unless(start.time == start_time, traced, zero_of((numbers, start)))
    stats = Stats(steps=traced.counts[0], rejected_steps=traced.counts[1])
    if traced.jumped is not None:
        stats["jumped"] = traced.jumped
    if traced.errors:
        stats["step_errors"] = jnp.stack([traced.errors[name] for name in STEP_ERRORS])
    rows = traced.rows if save is None else {name: traced.rows[name] for name in save}
    return Solution(jnp.asarray(saved), rows, traced.result, traced.point, stats, source="trace")


KINKS_PER_WINDOW = 2
"""Largest number of kinks in a window. A step that ends at a kink of the wind or of a table of voltages is
shorter than the one before, and begins another block of steps. Windows with three kinks needed too many
blocks in a run of twelve turns."""

MARGIN, UNEVEN = 1.25, 4.0
"""Safety factors for the number of windows, because some blocks end early: with steps of a given size, and
with error control, where blocks of 7 steps alternate with blocks of 24 in a long run of the baseline."""


def failed_unless(here: Bool[Array, ""], traced: Traced, zero: Scalar) -> Traced:
    """A run, or a failed one unless its traced start is where the run begins: its steps would begin
    elsewhere than its windows. zero: `zero_of` its arguments."""
    rows, point = jax.tree.map(lambda x: nan_unless(here, x, zero), (traced.rows, traced.point))
    return traced._replace(
        rows=rows, point=point, result=RESULTS.where(here, traced.result, RESULTS.other_start)
    )


def turns(scene: Scene, duration: float) -> float:
    """The number of turns of a sail in a duration [s]; 0 if the spin rate is a tracer, and for a
    chain."""
    spin = None if scene.chain is not None else known(scene.initial.spin_rate)
    return 0.0 if spin is None else float(np.max(np.abs(spin))) * duration / (2.0 * np.pi)


EDGES = 10
"""Instants in a turn at which steps end for one tether with the law phase-window (`loads/phase_window`)."""


def kinks(scene: Scene, start: float, end: float) -> int:
    """The number of instants in a run [s] at which the wind, a table of voltages or a window of the
    phase has a kink. If the instants are tracers, all are counted."""
    tables = () if scene.chain is not None else (scene.solar_wind, scene.voltage)
    series = [table.time for table in tables if table is not None and table.time is not None]
    times = [known(x) for x in series]
    count = sum(
        np.size(x) if time is None else int(((time > start) & (time < end)).sum())
        for x, time in zip(series, times, strict=True)
    )
    if scene.chain is None and scene.voltage is not None and scene.voltage.law == "phase-window":
        count += int(np.ceil(EDGES * scene.tethers.count * turns(scene, end - start)))
    return count
