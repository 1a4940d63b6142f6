"""One entry of a run: a few blocks of steps, and a look at the saved instants among them.

These are the programs that get compiled. The host calls them entry by entry (`march.py`); under a
trace one scan does (`simulate.py`).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax import observables
from esail_jax.array_types import Array, Float, Scalar, Vector
from esail_jax.compiler import COMPILER_OPTIONS, LOOK_OPTIONS
from esail_jax.constants import ASTRONOMICAL_UNIT
from esail_jax.coordinates import Coordinates
from esail_jax.scenes.build import Model
from esail_jax.scenes.structure import Numbers
from esail_jax.simulation.schedule import Entry
from esail_jax.steppers.consistent import project
from esail_jax.steppers.energy_momentum import EnergyMomentum
from esail_jax.steppers.fixed_step import FixedStep, State, StepInfo
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.steppers.step_error import StepErrors, after_steps, no_errors
from esail_jax.system import Power, System


class Carry(NamedTuple):
    """What one entry hands to the next; `failed` counts failed steps (of the part that counts), `errors`
    is what the steps so far may have come to be off by."""

    state: State
    start_energy: Scalar
    failed: Scalar
    errors: StepErrors


class Problem(NamedTuple):
    """A built scene, as the compiled program takes it. spectral_radius: None with energy-momentum."""

    system: System
    spectral_radius: Scalar | None
    origin: Vector

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of everything that was built."""
        return self.system.terms

    def stepper(self, step: Scalar) -> FixedStep:
        """The scene's method."""
        if self.spectral_radius is None:
            return EnergyMomentum(step)
        return GeneralizedAlpha(step, self.spectral_radius)


def starting_carry(q: Coordinates, v: Coordinates, system: System) -> Carry:
    """The carry an entry of kind "begin" takes."""
    zero = jnp.zeros(())
    nothing = Power(zero, zero)
    rest = jax.tree.map(jnp.zeros_like, q)
    state = fresh_state(q, v, rest, system.no_multipliers(), nothing, nothing)
    return Carry(state, zero, jnp.zeros((), int), no_errors(system.tethers.count))


def origin_of(numbers: Numbers) -> Vector:
    """Heliocentric position [m] of the origin of the coordinates."""
    return numbers.get("initial.heliocentric_position_au", jnp.zeros(3)) * ASTRONOMICAL_UNIT


def problem_of(numbers: Numbers, model: Model) -> tuple[Problem, Carry]:
    """What the compiled programs take, from a built scene."""
    problem = Problem(model.system, numbers.get("integrator.spectral_radius"), origin_of(numbers))
    return problem, starting_carry(model.q, model.v, model.system)


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
    before: "Record", after: "Record", theta: Scalar, h: Scalar
) -> tuple[Coordinates, Coordinates, Power]:
    """q, v and work within a step, each by the cubic through its own values and rates at the ends.

    v is not the derivative of q's cubic: the stepper's v and dq/dt differ by a constant times
    h^2 d^2v/dt^2 (0.17 at spectral radius 0.25), which would jump in and out at saved instants.
    """
    t2, t3 = theta**2, theta**3
    h00, h10, h01, h11 = 2 * t3 - 3 * t2 + 1, t3 - 2 * t2 + theta, 3 * t2 - 2 * t3, t3 - t2

    def cubic(x0, r0, x1, r1):
        return h00 * x0 + h01 * x1 + h * (h10 * r0 + h11 * r1)

    q = jax.tree.map(cubic, before.q, before.v, after.q, after.v)
    v = jax.tree.map(cubic, before.v, before.vdot, after.v, after.vdot)
    return q, v, jax.tree.map(cubic, before.work, before.power, after.work, after.power)


class Record(NamedTuple):
    """State at the start of an entry and after each of its steps (time first). vdot only if
    instants between steps are saved."""

    q: Coordinates
    v: Coordinates
    work: Power
    power: Power
    vdot: Coordinates | None

    @classmethod
    def of(cls, state: State, between: bool) -> "Record":
        """What a record keeps of a state."""
        vdot = state.vdot if between else None
        return cls(state.q, state.v, state.work, state.power, vdot)


def step_entry(
    problem: Problem, state: State, data: EntryData, steps: int, keep: int, between: bool
) -> tuple[State, Record, StepInfo]:
    """The steps of an entry, in blocks of `keep`: the state after the last, all of them, and how
    each went."""
    stepper, system = problem.stepper(data.step), problem.system.since(data.start)

    def block(state, index):
        time = data.start + index * keep * data.step
        state, (states, info) = stepper.block(system, time, state, keep)
        return state, (Record.of(states, between), info)

    start = Record.of(state, between)
    after, (record, info) = lax.scan(block, state, jnp.arange(steps // keep))
    record, info = jax.tree.map(lambda x: x.reshape(steps, *x.shape[2:]), (record, info))
    record = jax.tree.map(lambda x0, x: jnp.concatenate([x0[None], x]), start, record)
    return after, record, info


def look_at_entry(
    problem: Problem,
    carry: Carry,
    data: EntryData,
    after: State,
    record: Record,
    info: StepInfo,
    between: bool,
) -> tuple[Carry, dict[str, Array]]:
    """Observables at the saved instants of an entry, and what it hands to the next.

    Saved instants `between` steps come from the cubic through positions and velocities, projected
    on the constraints; if there are none, no such code is compiled.
    """
    system, stepper = problem.system.since(data.start), problem.stepper(data.step)
    start = carry.state
    energy = observables.kinetic_energy(system, start.v) + observables.elastic_energy(system, start.q)
    fresh = (data.kind == 0) & (data.start == 0.0)
    start_energy = jnp.where(fresh, energy, carry.start_energy)

    def look(time, k, theta):
        before, later = (jax.tree.map(lambda x, i=i: x[i], record) for i in (k, k + 1))
        nearest = jax.tree.map(lambda x0, x1: jnp.where(theta == 0.0, x0, x1), before, later)
        q, v, work = nearest.q, nearest.v, nearest.work
        if between:
            on_step = (theta == 0.0) | (theta == 1.0)
            inside = interpolate(before, later, theta, data.step)
            inside = (*project(system, time, *inside[:2]), inside[2])
            q, v, work = jax.tree.map(lambda x, y: jnp.where(on_step, x, y), (q, v, work), inside)
        instant = observables.make_instant(system, problem.origin, time, q, v, work, start_energy)
        handed = fresh_state(q, v, instant.vdot, instant.lam, work, instant.power)
        return observables.observe(instant), handed

    seen, states = jax.vmap(look)(data.row_time, data.row_step, data.row_theta)
    handed = jax.tree.map(lambda x: x[-1], states)
    tried = with_jerk(stepper, start, jax.tree.map(lambda x: x[1], record.v))
    state = jax.tree.map(
        lambda a, b, c: jnp.where(data.kind == 1, a, jnp.where(data.hand_over, b, c)),
        tried, handed, after,
    )  # fmt: skip
    steps = info.iterations.shape[0]
    bad = (jnp.arange(steps) < data.take) & ~jax.vmap(StepInfo.converged)(info)
    first_bad = jnp.where(bad.any(), jnp.argmax(bad), steps)
    lost = (carry.failed > 0) | (data.row_step >= first_bad)
    seen = jax.tree.map(lambda x: jnp.where(along_rows(lost, x), jnp.nan, x), seen)
    times = data.start + data.step * jnp.arange(steps + 1)
    counted = jnp.where(data.kind == 2, data.take, 0)
    errors = after_steps(carry.errors, system, times, record.q, counted, stepper.phase_error)
    return Carry(state, start_energy, carry.failed + bad.sum(), errors), seen


def run_entry(
    problem: Problem, carry: Carry, data: EntryData, steps: int, keep: int, between: bool
) -> tuple[Carry, tuple[dict[str, Array], StepInfo]]:
    """An entry: its steps, then a look at them."""
    after, record, info = step_entry(problem, carry.state, data, steps, keep, between)
    carry, seen = look_at_entry(problem, carry, data, after, record, info, between)
    return carry, (seen, info)


def along_rows(mask: Array, like: Array) -> Array:
    """A mask over saved instants in the rank of `like`."""
    return mask.reshape(-1, *(1,) * (like.ndim - 1))


def fresh_state(q, v, vdot, lam, work, power) -> State:
    """A state to begin with: a = vdot, no history."""
    nothing = jax.tree.map(jnp.zeros_like, vdot)
    return State(q, v, vdot, vdot, lam, nothing, nothing, work, power)


def with_jerk(stepper: FixedStep, state: State, v_next: Coordinates) -> State:
    """The state with a_0 = vdot_0 + (alpha_m - alpha_f) h jerk, the jerk from a trial step.

    vdot at the trial step's end follows from its velocity. Being implicit, the trial step damps
    what is stiff, where a time derivative of the accelerations would magnify it. Only generalized-alpha
    has an a_0.
    """
    if not isinstance(stepper, GeneralizedAlpha):
        return state
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


step_entry_jitted = jax.jit(step_entry, static_argnums=(3, 4, 5), compiler_options=COMPILER_OPTIONS)
look_at_entry_jitted = jax.jit(look_at_entry, static_argnums=6, compiler_options=LOOK_OPTIONS)
