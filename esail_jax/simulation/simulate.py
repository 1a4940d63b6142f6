"""From a scene to a solution: `simulate`."""

import functools
import os
import time
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Float
from esail_jax.observables import chain, is_chain
from esail_jax.observables.run_warning import run_warning
from esail_jax.rod_chain import RodState
from esail_jax.scenes.build import build
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.scene import Scene, load_scene
from esail_jax.scenes.structure import Numbers, Structure, split
from esail_jax.simulation import entry, explicit, traced_blocks
from esail_jax.simulation.entry import entry_data, problem_of, run_entry
from esail_jax.simulation.march import march_of
from esail_jax.simulation.prepare import plan_of, prepare, require_64_bit
from esail_jax.simulation.results import RESULTS, Checkpoint, SimulationError, join
from esail_jax.simulation.schedule import Plan, save_times, stops
from esail_jax.steppers.collocation_stages import Point
from esail_jax.steppers.fixed_step import KEEP, State


class Solution(eqx.Module):
    """A finished run.

    time [s]; `solution["coning_angle"]`: an observable, time first; result: an entry of `RESULTS`;
    final_state: State, of an explicit method RodState, of collocation Point; stats: steps, times, terms,
    and a message if the run failed, its energy balance is off or its step too long; numerics: per saved
    interval; checkpoint: where a longer run could go on. `scene` and the last two are None under a trace.
    """

    time: Float[Array, " time"] | Float[np.ndarray, " time"]
    rows: dict[str, Array | np.ndarray]
    result: Any
    final_state: State | RodState | Point | None
    stats: dict[str, Any]
    numerics: dict[str, np.ndarray] | None = None
    checkpoint: Checkpoint | None = None
    scene: Scene | None = eqx.field(static=True, default=None)

    def __getitem__(self, name: str) -> Array | np.ndarray:
        return self.rows[name]

    @property
    def steps(self) -> int:
        """Steps taken."""
        return int(self.stats["steps"])

    @property
    def observables(self) -> list[str]:
        """Names that can be looked up."""
        return list(self.rows)


def simulate(
    scene: Scene | str | os.PathLike, overrides: Mapping[str, Any] | None = None, *, throw: bool = True
) -> Solution:
    """Run a scene.

    scene: a `Scene`, a built-in name or a path; overrides: values by scene key, JAX arrays and
    tracers among them. With concrete numbers a failed run raises SimulationError (unless `throw` is
    false); under a trace `.result` is not 0 and everything after the failure is NaN.

    Raises SceneError for bad input, RuntimeError in 32-bit mode.
    """
    scene = load_scene(scene, overrides)
    leaves = [x for t in vars(scene).values() if t is not None for x in vars(t).values()]
    if any(isinstance(leaf, jax.core.Tracer) for leaf in leaves):
        return simulate_traced(scene)
    return simulate_concrete(scene, throw)


def simulate_traced(scene: Scene) -> Solution:
    """The whole run as one program, for `jit`, `grad`, `jvp` and `vmap`."""
    require_64_bit()
    scene = with_method(scene)
    structure, numbers = split(scene)
    layout = plan_of(scene)
    if layout is None:
        step = scene.integrator.step
        step = None if step is None else jnp.asarray(step)
        times = tuple(save_times(scene.integrator.t_end, scene.output.interval).tolist())
        if scene.integrator.method == "collocation":
            ends = stops(scene.integrator.t_end, scene.event, scene.voltage)
            rows, state, result, steps = traced_blocks.traced_run(structure, times, ends, numbers, step)
        else:
            rows, state, result, steps = explicit.traced_run(structure, times, numbers, step)
        return Solution(jnp.asarray(times), rows, result, state, {"steps": steps})
    rows, state, result, iterations, errors = traced_run(structure, layout, numbers)
    times = jnp.asarray([time for entry in layout.entries for time, *_ in entry.rows])
    return Solution(times, rows, result, state, {"newton_iterations": iterations, "step_errors": errors})


@functools.partial(jax.jit, static_argnums=(0, 1))
def traced_run(
    structure: Structure, layout: Plan, numbers: Numbers
) -> tuple[dict[str, Array], State, RESULTS, Array, Array]:
    """Build, then one checkpointed scan over the plan's entries: rows, last state, how it ended, iterations
    and what the steps may be off by (`StepErrors.parts`)."""
    problem, carry = problem_of(numbers, build(structure, numbers))
    data = [entry_data(entry, layout.rows_per_entry) for entry in layout.entries]
    stacked = jax.tree.map(lambda *x: jnp.stack(x), *data)

    @jax.checkpoint
    def body(carry, entry):
        carry, (seen, info) = run_entry(problem, carry, entry, layout.steps_per_entry, KEEP, layout.between)
        return carry, (seen, info.iterations.sum())

    carry, (seen, iterations) = lax.scan(body, carry, stacked)
    where = [(e, r) for e, entry in enumerate(layout.entries) for r in range(len(entry.rows))]
    entries, rows = (np.array(x) for x in zip(*where, strict=True))
    seen = {name: value[entries, rows] for name, value in seen.items()}
    if is_chain(problem.system):
        seen, _ = chain.with_energy_error(seen, (jnp.nan, 0.0), jnp)
    finite = jnp.isfinite(carry.state.q.tether).all()
    cause = RESULTS.where(finite, RESULTS.newton_diverged, RESULTS.nonfinite)
    result = RESULTS.where(carry.failed > 0, cause, RESULTS.successful)
    return seen, carry.state, result, iterations.sum(), carry.errors.parts


def simulate_concrete(scene: Scene, throw: bool) -> Solution:
    """The host's loop, everything kept in memory."""
    began = time.perf_counter()
    prepared = prepare(scene)
    ready = time.perf_counter()
    march, pieces, message, result = march_of(prepared), [], "", RESULTS.successful
    try:
        for piece in march.pieces():
            pieces.append(piece)
    except SimulationError as error:
        if throw:
            raise
        message, result = str(error), error.result
    times = save_times(scene.integrator.t_end, scene.output.interval)
    rows = filled(join([piece.rows for piece in pieces]), len(times))
    numerics = filled(join([piece.numerics for piece in pieces]), len(times))
    stats = {
        "steps": march.steps,
        "repairs": march.repairs,
        "compile_time": ready - began,
        "wall_time": time.perf_counter() - ready,
        "terms": prepared.problem.terms,
        "message": message or run_warning(rows, numerics),
    }
    state = final_state(march.carry)
    return Solution(times, rows, result, state, stats, numerics, march.checkpoint, scene)


def final_state(carry: Any) -> Any:
    """The state a carry holds: that of a stepper, or of what makes its own steps at the last saved
    instant."""
    return carry.state if isinstance(carry, entry.Carry) else carry.seen


def filled(rows: dict[str, np.ndarray], count: int) -> dict[str, np.ndarray]:
    """Rows up to `count`, NaN where a failed run did not get to."""
    missing = {name: np.full((count - len(x), *x.shape[1:]), np.nan) for name, x in rows.items()}
    return {name: np.concatenate([x, missing[name]]) for name, x in rows.items()}
