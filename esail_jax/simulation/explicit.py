"""A chain's run by an explicit method: the compiled program, and the host's loop around it.

The method's own steps run from one saved instant past the next (`steppers/runge_kutta.py`); nothing
depends on where a call of the program ends, so a run may stop and go on anywhere.
"""

import functools
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax import observables
from esail_jax.array_types import Array, Float, Scalar
from esail_jax.compiler import CHAIN_OPTIONS
from esail_jax.rod_chain import RodChain, RodState, energy_floor, error_scale
from esail_jax.scenes.build import build_chain
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import Numbers, Structure
from esail_jax.simulation.results import RESULTS, Checkpoint, Piece, SimulationError
from esail_jax.simulation.schedule import save_times
from esail_jax.steppers.runge_kutta import STEP_SIZES, Progress, RungeKutta, advance
from esail_jax.system import System

ROWS_PER_CALL = 32
"""Saved instants per call of the program, at most."""

ROD_STEPS_PER_CALL = 400_000
"""Steps times rods per call, about: some tenths of a second, between which the host may stop."""

NUMERICS = {"steps": "-", "rejected_steps": "-", "last_step": "s"}
"""Names and units of what is kept per saved interval."""


class Problem(NamedTuple):
    """A built chain, the method that runs it, and the energy [J] that is nothing (`energy_floor`)."""

    chain: RodChain
    method: RungeKutta
    floor: Scalar

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of everything that was built."""
        return self.chain.terms

    @property
    def system(self) -> System:
        """The sum of terms."""
        return self.chain.system


class Carry(NamedTuple):
    """What one call hands to the next. seen: the state at the last saved instant."""

    progress: Progress
    start_energy: Scalar
    seen: RodState


def problem_of(structure: Structure, numbers: Numbers, step: Array | None) -> tuple[Problem, Carry]:
    """A chain, its method and its start."""
    chain, state = build_chain(structure, numbers)
    tolerance = numbers.get("integrator.tolerance")
    scale = error_scale(chain, state) if step is None else None
    method = RungeKutta(step, tolerance, scale, structure["integrator.method"])
    q, v = chain.coordinates(state)
    energy = observables.chain.internal_energy(chain.system, chain.hinges, q, v)
    problem = Problem(chain, method, energy_floor(chain))
    return problem, Carry(method.start(chain, jnp.zeros(()), state), energy, state)


def pass_rows(
    problem: Problem, carry: Carry, times: Float[Array, " row"], steps: Scalar
) -> tuple[Carry, tuple[dict[str, Array], Float[Array, "row 3"], Array]]:
    """Past as many of the saved instants as `steps` steps allow: observables there, steps taken and
    rejected so far and the last step's size, and which instants were passed."""
    limit = carry.progress.taken + steps

    def next_row(carry, row):
        (progress, seen), (time, fresh) = carry, row
        progress = problem.method.pass_by(problem.chain, progress, time, limit)
        passed = progress.now.time >= time
        seen = lax.cond(
            passed & fresh,
            lambda: problem.method.look(problem.chain, progress, time),
            lambda: seen,
        )
        last = progress.now.time - progress.before.time
        how = jnp.stack([progress.taken, progress.rejected, last])
        return (progress, seen), (seen, how, passed)

    fresh = jnp.append(True, times[1:] > times[:-1])  # the last calls are padded with t_end
    start = (carry.progress, carry.seen)
    (progress, seen), (states, how, passed) = lax.scan(next_row, start, (times, fresh))
    carry = carry._replace(progress=progress, seen=seen)
    return carry, (see(problem, carry, times, states), how, passed)


def see(problem: Problem, carry: Carry, times: Float[Array, " row"], states: RodState) -> dict[str, Array]:
    """Observables of several instants."""

    def look(time, state):
        chain = problem.chain
        q, v = chain.coordinates(state)
        instant = (chain.system, chain.hinges, time, q, v, state.work, carry.start_energy)
        return observables.chain.observe(observables.chain.Instant(*instant))

    return jax.vmap(look)(times, states)


# ---- the host's loop --------------------------------------------------------------------------------


class Programs(NamedTuple):
    """Compiled `start(numbers, step)` and `rows(problem, carry, times, steps)`."""

    start: Callable
    rows: Callable


@functools.lru_cache(maxsize=64)
def programs(
    structure: Structure, shapes: tuple[tuple[str, tuple[int, ...]], ...], fixed: bool
) -> Programs:
    """The programs of a chain's structure, for any numbers, step and end time."""
    numbers = {key: jax.ShapeDtypeStruct(shape, float) for key, shape in shapes}
    number = jax.ShapeDtypeStruct((), float)
    start = jax.jit(problem_of, static_argnums=0).lower(structure, numbers, number if fixed else None)
    times = jax.ShapeDtypeStruct((ROWS_PER_CALL,), float)
    rows = jax.jit(pass_rows).lower(*start.out_info, times, number)
    with ThreadPoolExecutor() as pool:
        both = [pool.submit(program.compile, compiler_options=CHAIN_OPTIONS) for program in (start, rows)]
        return Programs(*(program.result() for program in both))


class ExplicitMarch:
    """Runs a prepared chain from saved instant to saved instant."""

    def __init__(self, prepared, checkpoint: Checkpoint | None = None):
        self.prepared = prepared
        start = checkpoint or Checkpoint(prepared.carry, 0, 0, 0, (0.0, 0.0), (np.nan, 0.0))
        self.carry, self.rows, self.steps = start.carry, start.rows, start.steps
        self.tally, self.energy = start.tally, start.energy
        self.checkpoint = start
        self.repairs = 0
        scene: Scene = prepared.resolved
        self.times = save_times(scene.integrator.t_end, scene.output.interval)
        self.interval = scene.output.interval
        self.floor = float(prepared.problem.floor)
        self.steps_per_call = float(np.clip(ROD_STEPS_PER_CALL // scene.chain.rods, 50, 10_000))

    def pieces(self) -> Iterator[Piece]:
        """One piece per call. Raises SimulationError when the run is stuck, after a last piece with
        what was seen before."""
        while self.rows < len(self.times):
            times = self.times[self.rows : self.rows + ROWS_PER_CALL]
            # The row at t_end stands in no longer run, unless it is one of the others too: alone.
            if not self._whole(times[-1]) and len(times) > 1:
                times = times[:-1]
            padded = np.append(times, np.full(ROWS_PER_CALL - len(times), times[-1]))
            problem, program = self.prepared.problem, self.prepared.programs.rows
            carry, (seen, how, passed) = program(problem, self.carry, padded, self.steps_per_call)
            count = int(np.asarray(passed)[: len(times)].sum())
            progress = carry.progress
            stuck = count < len(times) and bool(problem.method.stuck(progress))
            rows = {name: np.asarray(value)[:count] for name, value in seen.items()}
            energy = self.energy
            if count:
                rows, energy = observables.chain.with_energy_error(rows, self.energy, np)
                kept = observables.chain.balanced(rows, self.floor, np)
                stuck |= not kept.all()
                count = count if kept.all() else int(np.argmin(kept))
                rows = {name: value[:count] for name, value in rows.items()}
            numerics = self._numerics(np.asarray(how)[:count])
            piece = Piece(rows, times[:count], numerics, float(progress.now.time))
            if stuck:
                self.rows, self.steps = self.rows + count, int(progress.taken)
                yield piece
                raise self._failure(progress, piece, float(times[count]))
            self.energy = energy
            self.carry, self.rows, self.steps = carry, self.rows + count, int(progress.taken)
            if self._whole(self.times[self.rows - 1]) or not self.rows:
                self.checkpoint = Checkpoint(
                    carry, self.rows, self.rows, self.steps, self.tally, self.energy
                )
            yield piece

    def _whole(self, time: float) -> bool:
        ratio = time / self.interval
        return bool(abs(ratio - round(ratio)) < 1e-9 * max(1.0, ratio))

    def _numerics(self, how: np.ndarray) -> dict[str, np.ndarray]:
        before = np.vstack([self.tally, how[:, :2]])
        self.tally = tuple(float(x) for x in before[-1])
        steps, rejected = np.diff(before, axis=0).T
        return dict(zip(NUMERICS, (steps, rejected, how[:, 2]), strict=True))

    def _failure(self, progress: Progress, seen: Piece, lost: float) -> SimulationError:
        """lost: the first saved instant [s] that is not good."""
        time, method = float(progress.now.time), self.prepared.problem.method
        finite = all(np.isfinite(np.asarray(x)).all() for x in jax.tree.leaves(progress.now.y))
        result, hint = RESULTS.nonfinite, ""
        if finite and self.prepared.problem.method.stuck(progress):
            result, shortest = RESULTS.step_vanished, self._shortest(progress)
            hint = f"The shortest rod has {shortest:.2g} of its length left."
        elif finite:
            time, result, hint = lost, RESULTS.energy_lost, "Ask for a smaller tolerance."
        if method.step_size is not None:
            hint = (
                f"Steps of {float(method.step_size):.3g} s may be too long for the fastest vibration of "
                "the rods: try shorter ones, a tolerance, or generalized-alpha."
            )
        return SimulationError(f"{RESULTS[result]} At t = {time:.6g} s. {hint}".strip(), result, seen)

    def _shortest(self, progress: Progress) -> float:
        """Least length of a rod, of its undeformed one."""
        chain = self.prepared.problem.chain
        lengths = np.linalg.norm(np.asarray(chain.rods(progress.now.y.x)), axis=0)
        return float((lengths / np.asarray(chain.system.tethers.lengths)).min())


# ---- under a trace ----------------------------------------------------------------------------------


@functools.partial(jax.jit, static_argnums=(0, 1))
def traced_run(
    structure: Structure, times: tuple[float, ...], numbers: Numbers, step: Array | None
) -> tuple[dict[str, Array], RodState, RESULTS, Array]:
    """The whole run as one scan over its saved instants."""
    problem, carry = problem_of(structure, numbers, step)

    @functools.partial(jax.checkpoint, policy=jax.checkpoint_policies.save_only_these_names(STEP_SIZES))
    def body(progress, time):
        progress, y = advance(problem.method, problem.chain, progress, time)
        return progress, (y, progress.now.time >= time)

    instants = jnp.asarray(times)
    progress, (states, passed) = lax.scan(body, carry.progress, instants)
    rows = see(problem, carry, instants, states)
    rows, _ = observables.chain.with_energy_error(rows, (jnp.nan, 0.0), jnp)
    kept = observables.chain.balanced(rows, problem.floor, jnp)
    good = jnp.cumprod(passed & kept).astype(bool)
    rows = {name: jnp.where(good.reshape(-1, *(1,) * (x.ndim - 1)), x, jnp.nan) for name, x in rows.items()}
    finite = jnp.isfinite(progress.now.y.x).all()
    stuck = problem.method.stuck(progress)
    cause = RESULTS.where(stuck, RESULTS.step_vanished, RESULTS.too_many_steps)
    cause = RESULTS.where(passed.all(), RESULTS.energy_lost, cause)
    cause = RESULTS.where(finite, cause, RESULTS.nonfinite)
    result = RESULTS.where(good.all(), RESULTS.successful, cause)
    final = jax.tree.map(lambda x: jnp.where(good[-1], x[-1], jnp.nan), states)
    return rows, final, result, progress.taken
