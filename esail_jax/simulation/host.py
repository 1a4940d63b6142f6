"""A run on the host: calls of the compiled programs, one after the other, with checkpoints between them."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import split
from esail_jax.simulation.advance import Window
from esail_jax.simulation.look import with_running_observables
from esail_jax.simulation.problem import Problem, check_steady, require_64_bit
from esail_jax.simulation.programs import Programs, compile_programs
from esail_jax.simulation.results import Checkpoint, Chunk, SimulationError, join
from esail_jax.simulation.schedule import is_multiple, save_times, segments, switch_times
from esail_jax.simulation.statistics import COUNTS, Pending
from esail_jax.steppers.results import RESULTS, name_of
from esail_jax.steppers.stepper import AbstractStepper, Log, Motion, Point

NO_LIMIT = np.inf
"""Default of `max_steps` on the host."""


class CompiledScene(NamedTuple):
    """A scene with its compiled programs and its start. scene: as given; resolved: with its method."""

    scene: Scene
    resolved: Scene
    programs: Programs
    problem: Problem
    motion: Motion

    @property
    def numerics(self) -> dict[str, str]:
        """Names and units of the statistics that the run reports."""
        found = {name: how.unit for name, how in self.problem.stepper.statistics.items()}
        constrained = {} if not self.problem.system.has_constraints else {"constraint_violation": "m"}
        return COUNTS | found | constrained


def compile_scene(
    scene: Scene,
    stepper: AbstractStepper | None = None,
    point: Point | None = None,
    names: tuple[str, ...] | None = None,
) -> CompiledScene:
    """Compiles a scene and builds its start.

    stepper: a method in place of the scene's; point: an instant to start from; names: the observables to
    save. Raises SceneError if it has no steady elongation, RuntimeError in 32-bit mode."""
    require_64_bit()
    resolved = scene if stepper is not None else with_method(scene)
    structure, numbers = split(resolved)
    programs = compile_programs(structure, numbers, stepper, point, names)
    begun = programs.start(numbers, stepper, point)
    if scene.chain is None:
        check_steady(scene, begun)
    return CompiledScene(scene, resolved, programs, begun.problem, begun.motion)


class HostRun:
    """A run of a compiled scene, from its start or from a checkpoint.

    steps, rejected: numbers of steps so far; point: the last saved instant; checkpoint: where a longer run
    could go on."""

    def __init__(
        self,
        compiled: CompiledScene,
        checkpoint: Checkpoint | None = None,
        times: np.ndarray | None = None,
        max_steps: float = NO_LIMIT,
    ):
        self.compiled, self.max_steps = compiled, max_steps
        self.statistics = compiled.problem.stepper.statistics
        if checkpoint is None:
            checkpoint = Checkpoint(compiled.motion, 0, 0, Pending.empty(self.statistics), (np.nan, 0.0))
        elif isinstance(checkpoint.motion, Mapping):
            checkpoint = checkpoint._replace(motion=restored(compiled.motion, checkpoint.motion))
        self.checkpoint, self.point = checkpoint, None
        scene = compiled.resolved
        self.interval = scene.output.interval if times is None else None
        self.times = save_times(scene.integrator.t_end, scene.output.interval) if times is None else times
        self.begin = float(compiled.motion.state.time)
        restarts = compiled.programs.restart is not None
        switches = switch_times(scene.event, scene.voltage) if restarts else ()
        self.segments = segments(self.begin, float(self.times[-1]), switches)

    @property
    def steps(self) -> int:
        """Number of steps taken so far."""
        return int(self.checkpoint.motion.counts[0])

    def chunks(self) -> Iterator[Chunk]:
        """The run, a chunk for each call that passed a saved instant. Raises SimulationError when the
        stepper gives up, after the last good chunk."""
        motion, row, at, pending, energy = self.checkpoint
        programs = self.compiled.programs
        for number in range(at, len(self.segments)):
            segment = self.segments[number]
            problem = self.compiled.problem
            if programs.restart is not None:
                problem = problem.with_events_until(np.asarray(segment.start if number else 0.0))
            while True:
                times = self._window(row, segment.stop)
                # The stop of a segment may be no saved instant.
                shown = len(times)
                if (
                    not segment.last
                    and not (shown and times[-1] == segment.stop)
                    and shown < programs.instants
                ):
                    times = np.append(times, segment.stop)
                padded = np.append(times, np.full(programs.instants - len(times), times[-1]))
                done = programs.advance(
                    problem,
                    motion,
                    Window(padded, np.asarray(len(times))),
                    self.max_steps,
                    np.asarray(programs.batches),
                )
                passed, motion = int(done.passed), done.motion
                seen = min(passed, shown)
                log = Log.from_table(np.asarray(done.kept), programs.statistics)
                pending = pending.with_steps(log, self.statistics)
                left, memory, rows, numerics, good = pending, energy, {}, {}, seen
                if passed:
                    found, last, gaps = programs.look(problem, done.points, np.asarray(passed))
                    self.point = last if seen else self.point
                    rows = {name: np.asarray(x)[:seen] for name, x in found.items()}
                    if seen:
                        rows, memory, kept = with_running_observables(problem, rows, energy, np)
                        good = seen if kept is None or kept.all() else int(np.argmin(kept))
                    numerics, left = pending.values(times[:seen], self.statistics)
                    if (
                        "constraint_violation" in self.compiled.numerics
                        and "constraint_violation" not in numerics
                    ):
                        numerics["constraint_violation"] = np.asarray(gaps)[:seen]
                    rows, numerics = ({k: x[:good] for k, x in part.items()} for part in (rows, numerics))
                common = not seen or self._common(times[seen - 1])
                if good == seen and common:
                    row, pending, energy = row + seen, left, memory
                    pending = (
                        pending.merged(float(motion.state.time), self.statistics)
                        if passed < len(times)
                        else pending
                    )
                ended = passed and times[passed - 1] == segment.stop and passed == len(times)
                if ended and not segment.last:
                    after = self.compiled.problem.with_events_until(np.asarray(segment.stop))
                    motion = programs.restart(after, motion, last, np.asarray(self._until(number + 1)))
                    at = number + 1
                self.checkpoint = Checkpoint(motion, row, at, pending, energy)
                if good:
                    yield Chunk(times[:good], rows, numerics, float(motion.state.time))
                result = name_of(motion.state.result) if good == seen else "energy_drift"
                if result != "successful":
                    raise self._failure(
                        result, problem, motion, log, times[good] if good < len(times) else np.nan
                    )
                if ended:
                    break

    def _window(self, row: int, stop: float) -> np.ndarray:
        """The next saved instants, at most as many as one call has room for. The instant at the end of the
        run stands alone where a longer run does not save it."""
        times = self.times[row:]
        times = times[times <= stop][: self.compiled.programs.instants]
        if len(times) > 1 and not self._common(times[-1]):
            times = times[:-1]
        return times

    def _common(self, time: float) -> bool:
        """True if every longer run saves this instant, too."""
        return self.interval is None or is_multiple(float(time), self.interval)

    def _until(self, number: int) -> float:
        """The next switch time after the start of a segment [s]."""
        return self.segments[number].until

    def _failure(
        self, name: str, problem: Problem, motion: Motion, log: Log, row_time: float
    ) -> SimulationError:
        """The error that describes a failed run."""
        result = getattr(RESULTS, name)
        if name == "energy_drift":
            step = getattr(problem.stepper, "step_size", None)
            hint = "Ask for a smaller tolerance." if step is None else "Ask for a shorter step."
            return SimulationError(f"{RESULTS[result]} At t = {row_time:.6g} s. {hint}", result)
        if name == "too_many_steps":
            text = f"At t = {float(motion.state.time):.6g} s after {self.steps} steps."
        else:
            text = problem.stepper.failure(problem.model, motion.state, log)
        return SimulationError(f"{RESULTS[result]} {text}".strip(), result)


def paths(tree: Any) -> dict[str, Any]:
    """The leaves of a tree by their path."""
    leaves = jax.tree_util.tree_leaves_with_path(tree)
    return {
        "/".join(str(getattr(key, "name", getattr(key, "idx", key))) for key in path): x
        for path, x in leaves
    }


def restored(like: Motion, arrays: Mapping[str, np.ndarray]) -> Motion:
    """A motion from arrays by path. Raises ValueError unless these are the arrays of such a motion."""
    expected = paths(like)
    for name in expected.keys() | arrays.keys():
        if name not in expected or name not in arrays:
            raise ValueError(f"{name} is {'missing' if name in expected else 'unknown'}")
        kind = (np.shape(expected[name]), jnp.result_type(expected[name]))
        found = (np.shape(arrays[name]), jnp.result_type(arrays[name]))
        if kind != found:
            raise ValueError(f"{name} is {found[1]}{list(found[0])}, not {kind[1]}{list(kind[0])}")
    return jax.tree.unflatten(jax.tree.structure(like), [arrays[name] for name in expected])


def all_rows(
    chunks: list[Chunk], part: str, count: int, shapes: Mapping[str, tuple[int, ...]]
) -> dict[str, np.ndarray]:
    """Rows of all chunks, filled up with NaN to `count` instants: a failed run does not reach all. shapes:
    those of the rows at one instant, for a run that reached none."""
    if chunks:
        rows = join([getattr(chunk, part) for chunk in chunks])
    else:
        rows = {name: np.zeros((0, *shape)) for name, shape in shapes.items()}
    missing = {name: np.full((count - len(x), *x.shape[1:]), np.nan) for name, x in rows.items()}
    return {name: np.concatenate([x, missing[name]]) for name, x in rows.items()}
