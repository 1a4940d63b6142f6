"""The Python interface of a run: `simulate` returns a solution, `run` yields it in chunks."""

import os
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.errors import SimulationError
from esail_jax.observables.run_warning import run_warning
from esail_jax.scenes.control_period import control_period
from esail_jax.scenes.key_reference import refuse_keywords
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.overrides import check_overrides
from esail_jax.scenes.own_terms import OWN_TERMS
from esail_jax.scenes.rules import SceneError, numbers_of
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.voltage import OWN_LAW
from esail_jax.simulation.arguments import check_arguments
from esail_jax.simulation.host import HostRun, compile_scene
from esail_jax.simulation.law_jumps import DERIVATIVE, jump_warning
from esail_jax.simulation.rectification import AnyPoint
from esail_jax.simulation.results import Checkpoint, Chunk, all_rows
from esail_jax.simulation.schedule import save_times
from esail_jax.simulation.solution import Solution, Stats
from esail_jax.simulation.stability import INSTANTS, Stability, stability_of
from esail_jax.simulation.under_trace import simulate_traced, under_trace
from esail_jax.steppers.results import RESULTS, name_of
from esail_jax.steppers.stepper import AbstractStepper


def simulate(
    scene: Scene | str | os.PathLike,
    overrides: Mapping[str, Any] | None = None,
    *,
    save: Sequence[str] | None = None,
    times: Sequence[float] | None = None,
    start: AnyPoint | None = None,
    progress: Callable[[float], None] | None = None,
    max_steps: int | None = None,
    throw: bool = True,
    stepper: AbstractStepper | None = None,
    stability: bool = False,
    voltage_law: Any = None,
    terms: Any = None,
    **unknown: Any,
) -> Solution:
    """Integrates the equations of motion of a scene and returns the observables at the saved instants.

        solution = esail.simulate("baseline", {"integrator.t_end": 100.0})
        more = esail.simulate("baseline", start=solution.final_state)
        slope = jax.grad(lambda v: esail.simulate("baseline", {"voltage.value": v})["thrust_O"][-1, 0])

    scene: a `Scene`, the name of a built-in scene, or the path of a TOML file; overrides: values by scene
    key, which may be JAX arrays and tracers. If all numbers are concrete, the run is a sequence of calls of
    compiled programs on the host. If a number is a tracer, or inside `jax.jit`, `jax.vmap` and the like,
    the run becomes part of the traced program.

    save: names of the observables to save, if None all but `node_position_I` and those of reduced
    models (`observables/reduced_models.py`); times: the saved instants [s] in increasing order, instead
    of every `output.interval` until `integrator.t_end`; start: the point to start from, instead of the
    scene's start, for example the `final_state` of another solution (its time is the start time);
    progress: a function that is called on the host with the time reached [s]; max_steps: the largest
    number of steps; throw: whether a failed run raises SimulationError; stepper: a method of time
    integration, instead of the scene's; stability: whether to carry a small perturbation along, which
    takes some three times as long as the run: `stats["stability"]` is then a `Stability`
    (`simulation/stability.py`), and the message warns of a motion on which accurate runs would not
    agree; voltage_law: a voltage law of your own (`loads/own_law.py`) in place of the scene's. Its numbers
    may be tracers, too. With a control period it is sampled at the start and at every multiple of the
    period; a row at a sampling instant has the voltages before the sample. A run from `start` begins with
    a new memory. terms: physics of your own, a list of terms (`physics.py`), which act beside those of the
    scene; their numbers may be tracers, too.

    Under a trace nothing can raise: `result` is not `RESULTS.successful`, the observables are NaN from
    the failure on, and derivatives of them in reverse mode are NaN. A derivative records the steps in
    buffers of fixed size: WINDOWS_PER_TURN windows for every turn of the sail, but at least LEAST_WINDOWS,
    with `blocks_per_window` blocks of the stepper each; or more, if `max_steps` asks for more. A run that
    needs more ends with `RESULTS.too_many_steps`. A run in which a law of your own jumps
    within steps has no derivative (`stats["jumped"]`): it is NaN, and an error where JAX knows the
    numbers.

    Raises SceneError for bad input, SimulationError for a failed run, RuntimeError in 32-bit mode."""
    refuse_keywords("simulate", unknown)
    scene = load_scene(scene, with_own(overrides, voltage_law, terms))
    check_arguments(scene, save, times, start, max_steps)
    if stability and control_period(scene) is not None:
        raise SceneError("stability", "be False with a sampled law", "is True")
    if under_trace(scene, start, stepper):
        if stability:
            raise SceneError("stability", "be False under a trace", "is True")
        traced = simulate_traced(
            scene, save=save, times=times, start=start, max_steps=max_steps, stepper=stepper
        )
        return raised(traced, throw)
    run = compiled_run(scene, save, times, start, max_steps, stepper)
    solution = collected(run, save, throw, progress)
    if stability and solution.result == RESULTS.successful:
        stability_of_run = stability_along(scene, float(solution.time[-1]), solution.steps, start, stepper)
        solution.stats["stability"] = stability_of_run
        said = solution.stats["message"], stability_of_run.warning
        solution.stats["message"] = " ".join(filter(None, said))
    return solution


def stability_along(
    scene: Scene,
    end: float,
    steps: int,
    start: AnyPoint | None = None,
    stepper: AbstractStepper | None = None,
) -> Stability:
    """The growth of a small perturbation of the start of a run until the time `end` [s], measured
    at the tips of a sail or the joints of a chain. steps: number of steps of the run; start, stepper: as
    for `simulate`."""
    name = "joint_position" if scene.chain is not None else "tip_position_I"
    if start is None:
        start = simulate(scene, save=(name,), times=[0.0], stepper=stepper).final_state
    assert start is not None  # a run has its first instant
    times = np.linspace(float(start.time), end, INSTANTS)
    room = 2 * 2 ** int(np.ceil(np.log2(steps + 100)))  # runs of similar length share a program

    def positions(point):
        along = simulate_traced(
            scene, save=(name,), times=times.tolist(), start=point, max_steps=room, stepper=stepper
        )
        return along[name]

    return stability_of(positions, start, times)


def run(
    scene: Scene | str | os.PathLike,
    overrides: Mapping[str, Any] | None = None,
    *,
    save: Sequence[str] | None = None,
    times: Sequence[float] | None = None,
    start: AnyPoint | None = None,
    max_steps: int | None = None,
    stepper: AbstractStepper | None = None,
    voltage_law: Any = None,
    terms: Any = None,
    **unknown: Any,
) -> Iterator[Chunk]:
    """Integrates a scene and yields the results of consecutive saved instants as soon as they are known.

        for chunk in esail.run("baseline", save=["coning_angle"]):
            print(chunk.time[-1], chunk.observables["coning_angle"][-1])

    Each chunk has `time`, `observables`, `numerics` and `reached` (`results.Chunk`). Memory does not grow
    with the length of the run. The arguments are those of `simulate`, but all numbers must be concrete.

    Raises SceneError when it is called, and SimulationError after the last good chunk of a failed run."""
    refuse_keywords("run", unknown)
    scene = load_scene(scene, with_own(overrides, voltage_law, terms))
    check_arguments(scene, save, times, start, max_steps)
    if under_trace(scene, start, stepper):
        raise SceneError(
            "scene", "have plain numbers in `run`", "has a number under a trace (use `simulate`)"
        )
    return compiled_run(scene, save, times, start, max_steps, stepper).host.chunks()


def with_own(overrides: Mapping[str, Any] | None, law: Any, terms: Any) -> Mapping[str, Any] | None:
    """The overrides of a scene with a user's voltage law and terms, if they are given."""
    given = {name: x for name, x in ((OWN_LAW, law), (OWN_TERMS, terms)) if x is not None}
    if not given:
        return overrides
    if overrides is not None:
        check_overrides("overrides", overrides, "`voltage_law=law`")
    return {**(overrides or {}), **given}


def raised(solution: Solution, throw: bool) -> Solution:
    """A traced solution. Raises SimulationError if it is known already that the run has failed, as
    it is in `jax.jvp` and `jax.grad` outside `jax.jit`, and `throw` asks for errors."""
    known = not any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves(solution.result))
    if throw and known and solution.stats.get("jumped", False):
        raise SimulationError(DERIVATIVE, solution.result)
    if throw and known and name_of(solution.result) != "successful":
        hint = " Its derivative needs room for more: ask for it by `max_steps`."
        room = name_of(solution.result) == "too_many_steps"
        raise SimulationError(RESULTS[solution.result] + hint * room, solution.result)
    return solution


# ---- on the host --------------------------------------------------------------------------------


class CompiledRun(NamedTuple):
    """A run that is compiled and ready. compile_time: seconds that this took; save, times, start, stepper:
    arguments of `simulate`."""

    scene: Scene
    host: HostRun
    compile_time: float
    save: tuple[str, ...] | None
    times: np.ndarray | None
    start: AnyPoint | None
    stepper: AbstractStepper | None

    @property
    def longer(self) -> Checkpoint | None:
        """Where a longer run of the scene could go on. None for a run that is not the scene's own."""
        given = (self.save, self.times, self.start, self.stepper)
        return self.host.checkpoint if all(x is None for x in given) else None


def compiled_run(scene, save, times, start, max_steps, stepper) -> CompiledRun:
    """Compiles a scene and returns its run at the start. Arguments are those of `simulate`."""
    began = clock.perf_counter()
    names = None if save is None or scene.chain is not None else tuple(save)
    start = None if start is None else jax.tree.map(jnp.asarray, start)
    compiled = compile_scene(scene, stepper, start, names)
    given = tuple(save) if save is not None else None, times, start, stepper
    times = None if times is None else np.asarray(times, float)
    if times is None and start is not None:
        times = save_times(scene.integrator.t_end, scene.output.interval)
        times = times[times >= float(start.time)]
    limit = np.inf if max_steps is None else float(max_steps)
    return CompiledRun(scene, HostRun(compiled, None, times, limit), clock.perf_counter() - began, *given)


def collected(run: CompiledRun, save, throw: bool, progress=None) -> Solution:
    """Runs to the end, or to a failure, and returns the solution. Raises SimulationError if `throw`."""
    host, chunks, message, result = run.host, [], "", RESULTS.successful
    began = clock.perf_counter()
    try:
        for chunk in host.chunks():
            chunks.append(chunk)
            if progress is not None:
                progress(chunk.reached)
    except SimulationError as error:
        if throw:
            raise
        message, result = str(error), error.result
    shapes = host.compiled.programs.shapes
    rows = all_rows(chunks, "observables", len(host.times), shapes)
    numerics = all_rows(chunks, "numerics", len(host.times), dict.fromkeys(host.compiled.numerics, ()))
    stats = Stats(
        steps=int(host.counts[0]),
        rejected_steps=int(host.counts[1]),
        compile_time=run.compile_time,
        wall_time=clock.perf_counter() - began,
        terms=host.compiled.problem.terms,
        numerics_units=host.compiled.numerics,
        method=host.compiled.problem.stepper.name,
    )
    if host.jump is not None:
        stats["jump"] = host.jump
    said = jump_warning(host.jump), run_warning(rows, numerics, run.scene)
    stats["message"] = message or " ".join(filter(None, said))
    if save is not None:
        rows = {name: rows[name] for name in save}
    return Solution(
        time=host.times,
        observables=rows,
        result=result,
        final_state=host.point,
        stats=stats,
        numerics=numerics,
        checkpoint=run.longer,
        scene=run.scene,
        save=run.save,
        start=run.start,
        stepper=run.stepper,
        again=observables_at,
    )


def observables_at(solution: Solution, time: float | Sequence[float]) -> dict[str, np.ndarray]:
    """The observables of a solution at any time or times [s], by a second run. It is `Solution.at`, with
    its errors."""
    times = numbers_of("time", time)
    if times is None or times.ndim > 1 or not times.size:
        raise ValueError(f"`time` must be a number or a list of numbers, but is {time!r}")
    first, last = float(solution.time[0]), float(solution.time[-1])
    inside = (first <= times) & (times <= last)
    if not inside.all():
        outside = np.atleast_1d(times)[~np.atleast_1d(inside)][0]
        raise ValueError(f"`time` must lie within the run, {first:g} to {last:g} s, but is {outside:g}")
    if solution.checkpoint is None and solution.source == "file":
        raise ValueError("`solution` must hold its `start` and its stepper, but was read from a file")
    wanted, place = np.unique(times, return_inverse=True)
    # The energy error of a chain refers to the instants before.
    before = solution.time if solution.scene.chain is not None else solution.time[:0]
    instants = np.union1d(before[before < wanted[-1]], wanted)
    repeated = simulate(
        solution.scene,
        save=solution.save,
        times=instants.tolist(),
        start=solution.start,
        stepper=solution.stepper,
    )
    rows = np.searchsorted(instants, wanted)[place.reshape(times.shape)]
    return {name: np.asarray(repeated[name][rows]) for name in solution}
