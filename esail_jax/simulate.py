"""From a scene to a solution.

One compiled program, `run_entry`, takes a few blocks of steps and looks at the saved instants among
them. On concrete numbers the host calls it entry by entry: progress, files, interruption and repair
live between the calls. Under a trace (`jit`, `grad`, `jvp`, `vmap`) one scan does the same calls.
"""

import time
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax import observables
from esail_jax.array_types import Array, Float, Scalar, Vector
from esail_jax.constants import ASTRONOMICAL_UNIT
from esail_jax.coordinates import Coordinates
from esail_jax.dynamics.consistent import project
from esail_jax.dynamics.generalized_alpha import KEEP, GeneralizedAlpha, State, StepInfo
from esail_jax.scenes.build import build, build_jitted, split
from esail_jax.scenes.keys import SceneError
from esail_jax.scenes.scene import Scene, load_scene
from esail_jax.schedule import Entry, Plan, plan, rows_per_entry, save_times, stretch
from esail_jax.system import Power, System

MAX_HALVINGS = 6
"""Times a stretch that does not converge is repeated with half the step before the run gives up."""

UNBALANCED = 1e-6
"""Part of the tip's centrifugal force by which a steady elongation may miss its equilibrium."""


class RESULTS(eqx.Enumeration):
    """How a run ended."""

    successful = "The run reached its end time."
    newton_diverged = "The equations of a step could not be solved."
    nonfinite = "The state became infinite or undefined."


class Carry(NamedTuple):
    """What one entry hands to the next; `failed` counts failed steps (of the part that counts)."""

    state: State
    start_energy: Scalar
    failed: Scalar


class Problem(NamedTuple):
    """A built scene, as the compiled program takes it."""

    system: System
    spectral_radius: Scalar
    origin: Vector


class EntryData(NamedTuple):
    """The numbers of an `Entry`, rows padded to equal length (the last is the state handed over)."""

    kind: Array  # 0 begin, 1 trial, 2 march
    hand_over: Array
    start: Array
    step: Array
    take: Array
    row_time: Float[Array, " row"]
    row_step: Float[Array, " row"]
    row_theta: Float[Array, " row"]


KINDS = ("begin", "trial", "march")


def entry_data(entry: Entry, rows: int) -> EntryData:
    """Arrays of an entry, `rows` of them saved instants at most."""
    table = np.zeros((rows, 3))
    if entry.rows:
        table[: len(entry.rows)] = entry.rows
    theta = 1.0 if entry.take else 0.0
    table[len(entry.rows) :] = (entry.end, max(entry.take - 1, 0), theta)
    return EntryData(
        np.asarray(KINDS.index(entry.kind)),
        np.asarray(entry.hand_over),
        np.asarray(entry.start),
        np.asarray(entry.step),
        np.asarray(entry.take),
        table[:, 0],
        table[:, 1].astype(int),
        table[:, 2],
    )


def interpolate(
    before: tuple, after: tuple, theta: Scalar, h: Scalar
) -> tuple[Coordinates, Coordinates, Power]:
    """q, v and work within a step: the cubic through positions and velocities at its ends, and for
    the work the cubic through energies and powers. Exact at theta = 0 and 1."""
    t2, t3 = theta**2, theta**3
    h00, h10, h01, h11 = 2 * t3 - 3 * t2 + 1, t3 - 2 * t2 + theta, 3 * t2 - 2 * t3, t3 - t2
    d00, d10, d11 = 6 * t2 - 6 * theta, 3 * t2 - 4 * theta + 1, 3 * t2 - 2 * theta

    def value(x0, r0, x1, r1):
        return h00 * x0 + h01 * x1 + h * (h10 * r0 + h11 * r1)

    def rate(x0, r0, x1, r1):
        return d00 * (x0 - x1) / h + d10 * r0 + d11 * r1

    (q0, v0, w0, p0), (q1, v1, w1, p1) = before, after
    q = jax.tree.map(value, q0, v0, q1, v1)
    v = jax.tree.map(rate, q0, v0, q1, v1)
    return q, v, jax.tree.map(value, w0, p0, w1, p1)


def run_entry(
    problem: Problem, carry: Carry, data: EntryData, steps: int, keep: int, between: bool
) -> tuple[Carry, tuple[dict[str, Array], StepInfo]]:
    """Steps of one entry in blocks of `keep`, its saved instants, and how each step went.

    Saved instants `between` steps come from the cubic through positions and velocities, projected
    on the constraints; if there are none, no such code is compiled.
    """
    system, stepper = problem.system, GeneralizedAlpha(data.step, problem.spectral_radius)
    begin, trial = data.kind == 0, data.kind == 1
    start = carry.state
    energy = observables.kinetic_energy(system, start.v) + observables.elastic_energy(system, start.q)
    fresh = begin & (data.start == 0.0)
    carry = carry._replace(start_energy=jnp.where(fresh, energy, carry.start_energy))

    def block(state, index):
        time = data.start + index * keep * data.step
        state, (states, info) = stepper.block(system, time, state, keep)
        return state, ((states.q, states.v, states.work, states.power), info)

    state, (record, info) = lax.scan(block, start, jnp.arange(steps // keep))
    flat = jax.tree.map(lambda x: x.reshape(steps, *x.shape[2:]), (record, info))
    record, info = flat
    first = (start.q, start.v, start.work, start.power)
    record = jax.tree.map(lambda x0, x: jnp.concatenate([x0[None], x]), first, record)

    def look(time, k, theta):
        before, after = (jax.tree.map(lambda x, i=i: x[i], record) for i in (k, k + 1))
        q, v, work, _ = jax.tree.map(lambda x0, x1: jnp.where(theta == 0.0, x0, x1), before, after)
        if between:
            on_step = (theta == 0.0) | (theta == 1.0)
            inside = interpolate(before, after, theta, data.step)
            inside = (*project(system, time, *inside[:2]), inside[2])
            q, v, work = jax.tree.map(
                lambda x, y: jnp.where(on_step, x, y), (q, v, work), inside
            )
        instant = observables.make_instant(
            system, problem.origin, time, q, v, work, carry.start_energy
        )
        return observables.observe(instant), instant

    seen, instants = jax.vmap(look, out_axes=0)(data.row_time, data.row_step, data.row_theta)
    last = jax.tree.map(lambda x: x[-1], instants)
    handed = fresh_state(last.q, last.v, last.vdot, last.lam, last.work, last.power)
    tried = with_jerk(stepper, start, jax.tree.map(lambda x: x[1], record[1]))
    state = jax.tree.map(
        lambda a, b, c: jnp.where(trial, a, jnp.where(data.hand_over, b, c)), tried, handed, state
    )
    steps_done = jnp.arange(steps)
    bad = (steps_done < data.take) & ~jax.vmap(StepInfo.converged)(info)
    first_bad = jnp.where(bad.any(), jnp.argmax(bad), steps)
    lost = (carry.failed > 0) | (data.row_step >= first_bad)
    seen = jax.tree.map(lambda x: jnp.where(along_rows(lost, x), jnp.nan, x), seen)
    return Carry(state, carry.start_energy, carry.failed + bad.sum()), (seen, info)


def along_rows(mask: Array, like: Array) -> Array:
    """A mask over saved instants in the rank of `like`."""
    return mask.reshape(-1, *(1,) * (like.ndim - 1))


def fresh_state(q, v, vdot, lam, work, power) -> State:
    """A state to begin with: a = vdot, no history."""
    nothing = jax.tree.map(jnp.zeros_like, vdot)
    return State(q, v, vdot, vdot, lam, nothing, nothing, work, power)


def with_jerk(stepper: GeneralizedAlpha, state: State, v_next: Coordinates) -> State:
    """The state with a_0 = vdot_0 + (alpha_m - alpha_f) h jerk, the jerk from a trial step.

    vdot at the trial step's end follows from its velocity. Being implicit, the trial step damps
    what is stiff, where a time derivative of the accelerations would magnify it.
    """
    c, h = stepper.parameters, stepper.step_size
    a_next = jax.tree.map(
        lambda v1, v0, a: ((v1 - v0) / h - (1.0 - c.gamma) * a) / c.gamma, v_next, state.v, state.a
    )
    vdot_next = jax.tree.map(
        lambda a1, a0, vdot: ((1.0 - c.alpha_m) * a1 + c.alpha_m * a0 - c.alpha_f * vdot)
        / (1.0 - c.alpha_f),
        a_next, state.a, state.vdot,
    )  # fmt: skip
    rise = jax.tree.map(jnp.subtract, vdot_next, state.vdot)
    return state._replace(a=state.vdot.axpy(c.alpha_m - c.alpha_f, rise), rise=rise)


run_entry_jitted = jax.jit(run_entry, static_argnums=(3, 4, 5))


# ---- set-up -----------------------------------------------------------------------------------


def starting_carry(q: Coordinates, v: Coordinates, system: System) -> Carry:
    """The carry an entry of kind "begin" takes."""
    zero = jnp.zeros(())
    nothing = Power(zero, zero)
    rest = jax.tree.map(jnp.zeros_like, q)
    state = fresh_state(q, v, rest, system.no_multipliers(), nothing, nothing)
    return Carry(state, zero, jnp.zeros((), int))


class Prepared(NamedTuple):
    """A scene ready to run."""

    scene: Scene
    problem: Problem
    carry: Carry
    plan: Plan


def prepare(scene: Scene, jit: bool = True) -> Prepared:
    """Build a scene and lay out its run. Raises SceneError if it has no steady elongation."""
    if not jax.config.jax_enable_x64:
        raise RuntimeError(
            "esail_jax needs 64-bit numbers (positions of 1e4 m and elongations of 1e-6 m meet in "
            "one vector), but JAX is set to 32 bit: remove `jax_enable_x64 = False`."
        )
    structure, numbers = split(scene)
    model = (build_jitted if jit else build)(structure, numbers)
    origin = numbers["initial.heliocentric_position_au"] * ASTRONOMICAL_UNIT
    problem = Problem(model.system, jnp.asarray(model.spectral_radius), origin)
    if jit:
        check_steady(scene, model)
    unknowns = int(np.prod(model.q.tether.shape))
    schedule = scene.integrator
    layout = plan(schedule.t_end, schedule.step, scene.output.interval, unknowns, KEEP)
    return Prepared(scene, problem, starting_carry(model.q, model.v, model.system), layout)


def check_steady(scene: Scene, model: Any) -> None:
    """Refuse a spin at which the elements have no steady stretch."""
    q, spin = model.q.tether, float(np.abs(scene.initial.spin_rate))
    lengths = model.system.tethers.element_length * model.system.tethers.elements
    mass = model.system.tethers.line_density * lengths + model.system.tethers.tip_mass
    allowed = UNBALANCED * np.asarray(mass * lengths) * spin**2 + 1e-9
    unbalanced = np.asarray(model.unbalanced)
    radial = np.asarray(jnp.linalg.norm(q[0, :, -1] - q[0, :, 0], axis=0))
    bad = ~(unbalanced <= allowed) | ~np.isfinite(radial)
    if bad.any():
        raise SceneError(
            "initial.spin_rate",
            f"leave tether {int(np.argmax(bad))} a steady elongation",
            f"is {spin}: its elements cannot hold the centrifugal force",
        )


# ---- the host's loop ---------------------------------------------------------------------------


class SimulationError(RuntimeError):
    """The solver gave up; the message says when, where and how far it was."""


class Piece(NamedTuple):
    """What the host gets from an entry. numerics: per saved instant, since the one before."""

    rows: dict[str, np.ndarray]
    time: np.ndarray
    numerics: dict[str, np.ndarray]
    carry: Carry
    position: int  # entries done
    reached: float
    steps: int


class March:
    """Runs a prepared scene entry by entry, repairing what does not converge."""

    def __init__(self, prepared: Prepared, carry: Carry | None = None, position: int = 0):
        self.prepared, self.plan = prepared, prepared.plan
        self.carry = prepared.carry if carry is None else carry
        self.position = position
        self.repairs = 0
        self._since = Tally()

    def pieces(self) -> Iterator[Piece]:
        """One piece per entry. Raises SimulationError when even small steps fail."""
        while self.position < len(self.plan.entries):
            entry = self.plan.entries[self.position]
            rows, time, numerics, steps = self._entry(entry)
            self.position += 1
            yield Piece(rows, time, numerics, self.carry, self.position, entry.end, steps)

    def _call(self, entry: Entry, carry: Carry, rows: int, keep: int):
        data = entry_data(entry, rows)
        steps = self.plan.steps_per_entry
        between = self.plan.between or keep == 1
        return run_entry_jitted(self.prepared.problem, carry, data, steps, keep, between)

    def _entry(self, entry: Entry) -> tuple[dict, np.ndarray, dict, int]:
        rows = self.plan.rows_per_entry
        carry, (seen, info) = self._call(entry, self.carry, rows, KEEP)
        if int(carry.failed) and entry.kind == "march":
            return self._repair(entry)
        if int(carry.failed):  # a trial step only improves the start: go on without it
            carry = carry._replace(failed=jnp.zeros((), int), state=self.carry.state)
        self.carry = carry
        return self._collect(entry, seen, info)

    def _collect(self, entry: Entry, seen: dict, info: StepInfo):
        count = len(entry.rows)
        rows = {name: np.asarray(value)[:count] for name, value in seen.items()}
        time = np.array([row[0] for row in entry.rows])
        numerics = self._since.add(entry, jax.tree.map(np.asarray, info))
        return rows, time, numerics, entry.take if entry.kind == "march" else 0

    def _repair(self, entry: Entry) -> tuple[dict, np.ndarray, dict, int]:
        """The stretch of an entry again: factors of every step, then half the step, and so on."""
        self.repairs += 1
        steps, times = self.plan.steps_per_entry, np.array([row[0] for row in entry.rows])
        whole = Entry("march", entry.start, entry.step, entry.take, entry.rows, entry.hand_over)
        attempts = [[whole]]
        for halving in range(1, MAX_HALVINGS + 1):
            fine = stretch(entry.start, entry.end, entry.step / 2**halving, steps, times, False)
            fine[-1:] = [_handing_over(fine[-1])]
            attempts.append(fine + stretch_start(entry.end, entry.step))
        for attempt in attempts:
            carry, parts, failure = self.carry, [], None
            for part in attempt:
                rows = rows_per_entry(steps, part.step, self.prepared.scene.output.interval)
                carry, (seen, info) = self._call(part, carry, rows, 1)
                if int(carry.failed):
                    failure = (part, jax.tree.map(np.asarray, info))
                    break
                parts.append((part, seen, info))
            if failure is None:
                self.carry = carry
                collected = [self._collect(*part) for part in parts]
                rows, times, numerics, taken = zip(*collected, strict=True)
                return _join(rows), np.concatenate(times), _join(numerics), sum(taken)
        raise SimulationError(_failure_text(*failure, times))


def stretch_start(start: float, step: float) -> list[Entry]:
    """Entries that begin afresh at `start`, saving nothing."""
    return stretch(start, start, step, 1, np.empty(0), False)


def _handing_over(entry: Entry) -> Entry:
    return Entry(entry.kind, entry.start, entry.step, entry.take, entry.rows, True)


def _join(parts: tuple[dict, ...]) -> dict:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _failure_text(entry: Entry, info: StepInfo, times: np.ndarray) -> str:
    good = (info.increment[:, 0] <= np.inf) & np.asarray(jax.vmap(StepInfo.converged)(info))
    step = int(np.argmin(good[: max(entry.take, 1)]))
    time = entry.start + (step + 1) * entry.step
    increment = info.increment[step].max()
    what = RESULTS.newton_diverged if np.isfinite(increment) else RESULTS.nonfinite
    return (
        f"{RESULTS[what]} At t = {time:.6g} s, step {step} of {entry.step:.3g} s, tether "
        f"{int(info.tether[step])}: last increment {increment:.3g} m after "
        f"{int(info.iterations[step])} iterations, constraint violation "
        f"{info.constraint[step]:.3g} m. Smaller steps (`integrator.step`) did not help."
    )


class Tally:
    """Iterations, increments and constraint violation since the last saved instant."""

    def __init__(self):
        self.iterations, self.steps, self.increment, self.constraint = 0, 0, 0.0, 0.0

    def add(self, entry: Entry, info: StepInfo) -> dict[str, np.ndarray]:
        """Values of an entry's saved instants, and the remainder kept for the next one."""
        out = {"iterations": [], "increment": [], "constraint_violation": []}
        taken = entry.take if entry.kind == "march" else 0
        cuts = [row[1] + 1 if entry.kind == "march" else 0 for row in entry.rows]
        done = 0
        for cut in [*cuts, taken]:
            part = slice(done, cut)
            self.iterations += int(info.iterations[part].sum())
            self.steps += max(cut - done, 0)
            self.increment = max(self.increment, *info.increment[part].ravel(), 0.0)
            self.constraint = max(self.constraint, *info.constraint[part], 0.0)
            done = max(done, cut)
            if len(out["iterations"]) < len(entry.rows):
                out["iterations"].append(self.iterations / max(self.steps, 1))
                out["increment"].append(self.increment)
                out["constraint_violation"].append(self.constraint)
                self.__init__()
        return {name: np.array(values, float) for name, values in out.items()}


# ---- solutions ---------------------------------------------------------------------------------


class Solution(eqx.Module):
    """A finished run: `solution.time` [s], `solution["coning_angle"]` (time first), `.result` (a
    code of `RESULTS`), `.stats`, `.final_state`."""

    time: Float[Array, " time"]
    rows: dict[str, Array]
    result: Array
    final_state: Carry
    stats: dict[str, Any]
    scene: Scene = eqx.field(static=True)

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
    return Solution(jnp.asarray(times), seen, result, carry, stats, None)


def simulate_concrete(scene: Scene, throw: bool) -> Solution:
    """The host's loop, everything kept in memory."""
    clock = CompileClock()
    prepared = prepare(scene)
    march = March(prepared)
    rows, times, message, result, steps = [], [], "", RESULTS.successful, 0
    try:
        for piece in march.pieces():
            rows.append(piece.rows)
            times.append(piece.time)
            steps += piece.steps
    except SimulationError as error:
        if throw:
            raise
        message = str(error)
        result = RESULTS.nonfinite if RESULTS[RESULTS.nonfinite] in message else RESULTS.newton_diverged
    compile_time, wall_time = clock.read()
    stats = {
        "steps": steps,
        "repairs": march.repairs,
        "compile_time": compile_time,
        "wall_time": wall_time,
        "terms": prepared.problem.system.terms,
        "message": message,
    }
    found, reached = _join(tuple(rows)), np.concatenate(times)
    if message:  # the saved instants that were not reached
        missing = save_times(scene.integrator.t_end, scene.output.interval)[len(reached) :]
        reached = np.append(reached, missing)
        found = {
            name: np.concatenate([x, np.full((len(missing), *x.shape[1:]), np.nan)])
            for name, x in found.items()
        }
    return Solution(reached, found, result, march.carry, stats, scene)


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
