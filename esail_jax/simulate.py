"""From a scene to a solution: `simulate`."""

import time
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Float
from esail_jax.dynamics.generalized_alpha import KEEP, State
from esail_jax.entry import entry_data, run_entry
from esail_jax.march import RESULTS, Checkpoint, March, SimulationError, join
from esail_jax.prepare import prepare
from esail_jax.scenes.scene import Scene, load_scene
from esail_jax.schedule import save_times


class Solution(eqx.Module):
    """A finished run.

    time [s]; `solution["coning_angle"]`: an observable, time first; result: an entry of `RESULTS`;
    final_state: State; stats: steps, times, terms; numerics: per saved interval; checkpoint: where
    a longer run could go on. `scene` and the last two are None under a trace.
    """

    time: Float[Array, " time"]
    rows: dict[str, Array]
    result: Any
    final_state: State | None
    stats: dict[str, Any]
    numerics: dict[str, Array] | None = None
    checkpoint: Checkpoint | None = None
    scene: Scene | None = eqx.field(static=True, default=None)

    def __getitem__(self, name: str) -> Array:
        return self.rows[name]

    @property
    def observables(self) -> list[str]:
        """Names that can be looked up."""
        return list(self.rows)


def simulate(
    scene: "Scene | str", overrides: Mapping[str, Any] | None = None, *, throw: bool = True
) -> Solution:
    """Run a scene.

    scene: a `Scene`, a built-in name or a path; overrides: values by scene key, JAX arrays and
    tracers among them. With concrete numbers a failed run raises SimulationError (unless `throw` is
    false); under a trace `.result` is not 0 and everything after the failure is NaN.

    Raises SceneError for bad input, RuntimeError in 32-bit mode.
    """
    scene = load_scene(scene).replace(overrides or {})
    leaves = [x for t in vars(scene).values() if t is not None for x in vars(t).values()]
    if any(isinstance(leaf, jax.core.Tracer) for leaf in leaves):
        return simulate_traced(scene)
    return simulate_concrete(scene, throw)


def simulate_traced(scene: Scene) -> Solution:
    """The whole run as one checkpointed scan over the plan's entries."""
    prepared = prepare(scene, jit=False)
    layout = prepared.plan
    data = [entry_data(entry, layout.rows_per_entry) for entry in layout.entries]
    stacked = jax.tree.map(lambda *x: jnp.stack(x), *data)

    @jax.checkpoint
    def body(carry, entry):
        return run_entry(
            prepared.problem, carry, entry, layout.steps_per_entry, KEEP, layout.between
        )

    carry, (seen, info) = lax.scan(body, prepared.carry, stacked)
    where = [(e, r) for e, entry in enumerate(layout.entries) for r in range(len(entry.rows))]
    entries, rows = (np.array(x) for x in zip(*where, strict=True))
    times = np.array([layout.entries[e].rows[r][0] for e, r in where])
    seen = {name: value[entries, rows] for name, value in seen.items()}
    finite = jnp.isfinite(carry.state.q.tether).all()
    cause = RESULTS.where(finite, RESULTS.newton_diverged, RESULTS.nonfinite)
    result = RESULTS.where(carry.failed > 0, cause, RESULTS.successful)
    stats = {"newton_iterations": info.iterations.sum()}
    return Solution(jnp.asarray(times), seen, result, carry.state, stats)


def simulate_concrete(scene: Scene, throw: bool) -> Solution:
    """The host's loop, everything kept in memory."""
    clock = CompileClock()
    prepared = prepare(scene)
    march, pieces, message, result = March(prepared), [], "", RESULTS.successful
    try:
        pieces.extend(march.pieces())
    except SimulationError as error:
        if throw:
            raise
        message, result = str(error), error.result
    compile_time, wall_time = clock.read()
    stats = {
        "steps": march.steps,
        "repairs": march.repairs,
        "compile_time": compile_time,
        "wall_time": wall_time,
        "terms": prepared.problem.system.terms,
        "message": message,
    }
    times = save_times(scene.integrator.t_end, scene.output.interval)
    rows = filled(join([piece.rows for piece in pieces]), len(times))
    numerics = filled(join([piece.numerics for piece in pieces]), len(times))
    state = march.carry.state
    return Solution(times, rows, result, state, stats, numerics, march.checkpoint, scene)


def filled(rows: dict[str, np.ndarray], count: int) -> dict[str, np.ndarray]:
    """Rows up to `count`, NaN where a failed run did not get to."""
    missing = {name: np.full((count - len(x), *x.shape[1:]), np.nan) for name, x in rows.items()}
    return {name: np.concatenate([x, missing[name]]) for name, x in rows.items()}


class CompileClock:
    """Seconds since its making, split into compiling (tracing and lowering included) and the rest."""

    EVENTS = ("jaxpr_trace_duration", "jaxpr_to_mlir_module_duration", "backend_compile_duration")
    spent = 0.0
    listening = False

    def __init__(self):
        if not CompileClock.listening:
            jax.monitoring.register_event_duration_secs_listener(CompileClock._heard)
            CompileClock.listening = True
        self._start, self._before = time.perf_counter(), CompileClock.spent

    @staticmethod
    def _heard(event: str, duration: float, **_) -> None:
        if event.endswith(CompileClock.EVENTS):
            CompileClock.spent += duration

    def read(self) -> tuple[float, float]:
        """(compiling, everything else) [s]."""
        compiling = CompileClock.spent - self._before
        return compiling, max(time.perf_counter() - self._start - compiling, 0.0)
