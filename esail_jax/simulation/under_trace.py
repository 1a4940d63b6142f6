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
from esail_jax.simulation.solution import Solution
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
    kind = type(stepper) if stepper is not None else stepper_class(resolved.integrator.method)
    if times is None:
        saved = save_times(scene.integrator.t_end, scene.output.interval)
        if start is not None and known_time(start) is not None:
            saved = saved[saved >= known_time(start)]
    else:
        saved = np.asarray(times, float)
    begin = 0.0 if start is None else known_time(start)
    begin = float(saved[0]) if begin is None else begin
    step = resolved.integrator.step
    wanted = max_steps
    if step is not None and stepper is None:
        wanted = np.ceil((saved[-1] - begin) / step) + 1
    room = kind.blocks_per_window * kind.blocks_per_batch * kind.steps_per_block
    least = 1
    if step is None or stepper is not None:
        least = max(LEAST_WINDOWS, int(np.ceil(WINDOWS_PER_TURN * turns(scene, saved[-1] - begin))))
        least = max(least, int(np.ceil(kinks(scene, begin, saved[-1]) / KINKS_PER_WINDOW)))
    if wanted is not None:
        least = max(least, int(np.ceil(wanted / room * (UNEVEN if step is None else MARGIN))))
    end = float(saved[-1])
    switches = switch_times(scene, end)
    instants = tuple(saved.tolist()), switches, begin
    samples = sampling_instants(scene, end)
    schedule = Schedule(*instants, kind.instants_per_window, least, divided_at(scene), samples)
    names = None if save is None or scene.chain is not None else tuple(save)
    if limit is None:
        limit = jnp.asarray(jnp.inf if max_steps is None else float(max_steps))
    found = traced_run(structure, schedule, names, numbers, limit, stepper, start)
    if start is not None and known_time(start) is None:
        found = failed_unless(start.time == begin, found, zero_of((numbers, start)))
    stats = {"steps": found.counts[0], "rejected_steps": found.counts[1]}
    if found.jumped is not None:
        stats["voltage_jumped"] = found.jumped
    if found.errors:
        stats["step_errors"] = jnp.stack([found.errors[name] for name in STEP_ERRORS])
    rows = found.rows if save is None else {name: found.rows[name] for name in save}
    return Solution(jnp.asarray(saved), rows, found.result, found.point, stats)


KINKS_PER_WINDOW = 2
"""Largest number of kinks in a window. A step that ends at a kink of the wind or of a table of voltages is
shorter than the one before, and begins another block of steps. Windows with three kinks needed too many
blocks in a run of twelve turns."""

MARGIN, UNEVEN = 1.25, 4.0
"""Safety factors for the number of windows, because some blocks end early: with steps of a given size, and
with error control, where blocks of 7 steps alternate with blocks of 24 in a long run of the baseline."""


def failed_unless(here: Bool[Array, ""], found: Traced, zero: Scalar) -> Traced:
    """A run, or a failed one unless its traced start is where the run begins: its steps would begin
    elsewhere than its windows. zero: `zero_of` its arguments."""
    rows, point = jax.tree.map(lambda x: nan_unless(here, x, zero), (found.rows, found.point))
    return found._replace(
        rows=rows, point=point, result=RESULTS.where(here, found.result, RESULTS.other_start)
    )


def turns(scene: Scene, duration: float) -> float:
    """The number of turns of a sail in a duration [s]; 0 if the spin rate is a tracer, and for a
    chain."""
    spin = None if scene.chain is not None else known(scene.initial.spin_rate)
    return 0.0 if spin is None else float(np.max(np.abs(spin))) * duration / (2.0 * np.pi)


EDGES = 10
"""Instants in a turn at which steps end for one tether with the law phase-window (`loads/phase_window`)."""


def kinks(scene: Scene, begin: float, end: float) -> int:
    """The number of instants in a run [s] at which the wind, a table of voltages or a window of the
    phase has a kink. If the instants are tracers, all are counted."""
    tables = () if scene.chain is not None else (scene.solar_wind, scene.voltage)
    series = [table.time for table in tables if table is not None and table.time is not None]
    times = [known(x) for x in series]
    found = sum(
        np.size(x) if time is None else int(((time > begin) & (time < end)).sum())
        for x, time in zip(series, times, strict=True)
    )
    if scene.chain is None and scene.voltage is not None and scene.voltage.law == "phase-window":
        found += int(np.ceil(EDGES * scene.tethers.count * turns(scene, end - begin)))
    return found
