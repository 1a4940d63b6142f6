"""The driver on the host: calls of compiled programs in sequence, with a checkpoint after each.

The next call begins, in another thread, while the observables of the one before are evaluated and written.
XLA runs programs that one thread has called one after the other, those of two threads side by side."""

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from esail_jax.errors import SimulationError
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import split
from esail_jax.simulation.advance import Advanced, Window
from esail_jax.simulation.look import with_running_observables
from esail_jax.simulation.problem import Carried, Problem, check_steady, require_64_bit
from esail_jax.simulation.programs import Programs, compile_programs
from esail_jax.simulation.rectification import AnyPoint, PointOnOrbit
from esail_jax.simulation.restoring import restored
from esail_jax.simulation.results import Checkpoint, Chunk
from esail_jax.simulation.sampling import hint_at_law
from esail_jax.simulation.schedule import (
    is_multiple,
    sampling_instants,
    save_times,
    segments,
    switch_times,
)
from esail_jax.simulation.statistics import COUNTS, Pending
from esail_jax.steppers.log import Log
from esail_jax.steppers.results import RESULTS, name_of
from esail_jax.steppers.stepper import AbstractStepper, Motion, Point

NO_LIMIT = np.inf
"""Default of `max_steps` on the host."""


class CompiledScene(NamedTuple):
    """A scene with its compiled programs and its start. scene: as given; resolved: with its method;
    carried: what the run carries along at its start; start_time: start of the run [s]."""

    scene: Scene
    resolved: Scene
    programs: Programs
    problem: Problem
    motion: Motion
    carried: Carried
    start_time: float

    @property
    def numerics(self) -> dict[str, str]:
        """Names and units of the statistics that the run reports."""
        of_stepper = {name: how.unit for name, how in self.problem.stepper.statistics.items()}
        constrained = {} if not self.problem.system.has_constraints else {"constraint_violation": "m"}
        return COUNTS | of_stepper | constrained


def compile_scene(
    scene: Scene,
    stepper: AbstractStepper | None = None,
    point: AnyPoint | None = None,
    names: tuple[str, ...] | None = None,
) -> CompiledScene:
    """Compiles a scene and builds its start.

    stepper: a method instead of the scene's; point: an instant to start from; names: the observables to
    save, all if None. Raises SceneError if it has no steady elongation, RuntimeError in 32-bit mode."""
    require_64_bit()
    resolved = scene if stepper is not None else with_method(scene)
    structure, numbers = split(resolved)
    programs = compile_programs(structure, numbers, stepper, point, names)
    first = programs.start(numbers, stepper, point)
    if scene.chain is None:
        check_steady(scene, first)
    start_time = 0.0 if point is None else float(point.time)
    return CompiledScene(scene, resolved, programs, first.problem, first.motion, first.carried, start_time)


class HostRun:
    """A run of a compiled scene, from its start or from a checkpoint.

    counts: numbers of steps taken and rejected so far; point: the last saved instant; checkpoint: where a
    longer run could go on. For a failed run this is the start of the call that failed."""

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
            empty = Pending.empty(self.statistics)
            checkpoint = Checkpoint(compiled.motion, 0, 0, empty, (np.nan, 0.0), compiled.carried)
        elif isinstance(checkpoint.motion, Mapping):
            checkpoint = checkpoint._replace(
                motion=restored(compiled.motion, checkpoint.motion),
                carried=restored(compiled.carried, checkpoint.carried),
            )
        self.checkpoint = checkpoint
        self.point: AnyPoint | None = None
        motion = checkpoint.motion
        since = [float(motion.state.taken), float(motion.state.rejected)]
        self.counts = np.asarray(motion.earlier) + np.array(since)
        scene = compiled.resolved
        self.interval = scene.output.interval if times is None else None
        self.times = save_times(scene.integrator.t_end, scene.output.interval) if times is None else times
        restarts = compiled.programs.restart is not None
        end = float(self.times[-1])
        switches = switch_times(scene, end) if restarts else ()
        self.segments = segments(compiled.start_time, end, switches)
        self.samples = set(sampling_instants(scene, end))

    @property
    def steps(self) -> int:
        """Number of steps taken so far."""
        return int(self.counts[0])

    @property
    def jump(self) -> float | None:
        """Largest jump of what a law commands so far; None if none is looked for (`law_jumps.py`)."""
        jump = self.checkpoint.motion.jump
        return None if jump is None else float(jump)

    def chunks(self) -> Iterator[Chunk]:
        """Integrates the run and yields a chunk for each call that passes a saved instant. Raises
        SimulationError if the run fails, after the last good chunk."""
        if self.checkpoint.rows == len(self.times):
            return  # interrupted after the last instant
        with ThreadPoolExecutor(1) as pool:
            yield from self._calls(lambda *call: pool.submit(self._submitted, *call))

    def _calls(self, submit: "Callable[[int, int, Motion], Future[Submitted]]") -> Iterator[Chunk]:
        """Yields the chunks. submit: makes a call in another thread.

        Two calls overlap: while the observables of one are evaluated here, the next one computes there.
        Only within a segment is it known before what the next call starts from."""
        segment_index, next_call = self.checkpoint.segment, None
        while segment_index < len(self.segments):
            checkpoint = self.checkpoint
            if next_call is None:
                next_call = submit(segment_index, checkpoint.rows, checkpoint.motion)
            call, next_call = self._finished(next_call.result()), None
            if not call.ended and name_of(call.motion.state.result) == "successful":
                rows = self._rows_after(call, min(call.passed, call.saved))
                next_call = submit(segment_index, rows, call.motion)
            seen = self._look(call)
            if seen.result == "successful":
                self.checkpoint = self._after(call, seen, segment_index)
            if seen.saved:
                yield Chunk(call.times[: seen.saved], seen.rows, seen.numerics, float(call.done.time))
            if seen.result != "successful":
                raise self._failure(call, seen)
            if call.ended:
                segment_index += 1

    def _problem(self, number: int) -> Problem:
        """The problem during a segment."""
        problem = self.compiled.problem
        if self.compiled.programs.restart is None:
            return problem.under(self.checkpoint.carried)
        segment = self.segments[number]
        problem = problem.in_segment(np.asarray(segment.start), np.asarray(segment.until))
        return problem.under(self.checkpoint.carried)

    def _submitted(self, number: int, row: int, motion: Motion) -> "Submitted":
        """Calls the compiled program for the next saved instants of a segment. Its results may not be
        there yet."""
        segment, programs = self.segments[number], self.compiled.programs
        times = self._window(row, segment.stop)
        saved = len(times)
        # The stop of a segment may be no saved instant.
        stops = saved > 0 and times[-1] == segment.stop
        if not segment.last and not stops and saved < programs.instants:
            times = np.append(times, segment.stop)
        padded = np.append(times, np.full(programs.instants - len(times), times[-1]))
        window, batches = Window(padded, np.asarray(len(times))), np.asarray(programs.batches)
        problem = self._problem(number)
        done = programs.advance(problem, motion, window, self.max_steps, batches)
        return Submitted(problem, times, saved, segment.stop, done)

    def _finished(self, submitted: "Submitted") -> "Call":
        """Waits for the results of a call."""
        problem, times, saved, stop, done = submitted
        self.counts = np.asarray(done.counts)
        log = Log.from_table(np.asarray(done.kept), self.compiled.programs.statistics)
        passed = int(done.passed)
        ended = passed == len(times) and times[-1] == stop
        return Call(problem, times, saved, done, passed, log, bool(ended))

    def _rows_after(self, call: "Call", count: int) -> int:
        """The number of instants saved before the next call, if this one has saved `count`."""
        is_kept = not count or self._common(call.times[count - 1])
        return self.checkpoint.rows + count * is_kept

    def _look(self, call: "Call") -> "Seen":
        """Evaluates the observables and the statistics at the saved instants that a call has passed."""
        programs, energy = self.compiled.programs, self.checkpoint.energy
        steps = self.checkpoint.pending.with_steps(call.log, self.statistics)
        result = name_of(call.motion.state.result)
        if not call.passed:
            return Seen({}, {}, 0, None, steps, steps, energy, result)
        observables, last, gaps = programs.look(call.problem, call.done.points, np.asarray(call.passed))
        count = min(call.passed, call.saved)
        # Copies: a view would keep the memory of all instants of the window, of which few may be passed.
        rows = {name: np.asarray(x)[:count].copy() for name, x in observables.items()}
        numerics, left = steps.values(call.times[:count], self.compiled.start_time, self.statistics)
        if "constraint_violation" in self.compiled.numerics:
            numerics.setdefault("constraint_violation", np.asarray(gaps)[:count].copy())
        if count:
            self.point = PointOnOrbit.of(last, self.checkpoint.carried.orbit)
            with np.errstate(over="ignore", invalid="ignore"):  # the energy may be infinite
                rows, energy, kept = with_running_observables(call.problem, rows, energy, np)
            if kept is not None and not kept.all():
                count, result = int(np.argmin(kept)), "energy_drift"
                rows, numerics = ({k: x[:count] for k, x in part.items()} for part in (rows, numerics))
        return Seen(rows, numerics, count, last, steps, left, energy, result)

    def _after(self, call: "Call", seen: "Seen", number: int) -> Checkpoint:
        """The checkpoint after a good call, at the start of the next segment if this one has
        ended."""
        motion, before = call.motion, self.checkpoint
        rows, pending, energy = self._rows_after(call, seen.saved), seen.steps, before.energy
        carried = before.carried
        if rows - before.rows == seen.saved:
            pending, energy = seen.left, seen.energy
            if call.passed < len(call.times):
                pending = pending.merged(float(call.done.time), self.statistics)
        if call.ended and not self.segments[number].last:
            number += 1
            start, until = self.segments[number].start, np.asarray(self.segments[number].until)
            due = None if carried.control is None else np.asarray(start in self.samples)
            motion, carried = self.compiled.programs.restart(
                self._problem(number), motion, seen.last, until, carried, due
            )
        return Checkpoint(motion, rows, number, pending, energy, carried)

    def _window(self, row: int, stop: float) -> np.ndarray:
        """The next saved instants, at most as many as one call has room for. The last instant of
        the run is alone in its window if a longer run does not save it."""
        times = self.times[row:]
        times = times[times <= stop][: self.compiled.programs.instants]
        if len(times) > 1 and not self._common(times[-1]):
            times = times[:-1]
        return times

    def _common(self, time: float) -> bool:
        """Tells whether every longer run saves this instant, too."""
        return self.interval is None or is_multiple(float(time), self.interval)

    def _failure(self, call: "Call", seen: "Seen") -> SimulationError:
        """The error that describes a failed run."""
        result, state = getattr(RESULTS, seen.result), call.motion.state
        stepper = call.problem.stepper
        if seen.result == "energy_drift":
            text = f"At t = {call.times[seen.saved]:.6g} s. {stepper.energy_hint()}"
        elif seen.result == "too_many_steps":
            text = f"At t = {float(state.time):.6g} s after {self.steps} steps."
        else:
            text = stepper.failure(call.problem.model, state, call.log)
        hint = hint_at_law(self.compiled.scene, self.checkpoint.carried.control, seen.result)
        return SimulationError(" ".join(filter(None, (RESULTS[result], text, hint))), result)


class Submitted(NamedTuple):
    """A call of the compiled program that may not have ended. times: the instants [s], the first `saved` of
    which are saved; stop: end of the segment [s]; done: the results, for which the host may have to
    wait."""

    problem: Problem
    times: np.ndarray
    saved: int
    stop: float
    done: Advanced


class Call(NamedTuple):
    """One call of the compiled program.

    times: the instants [s], the first `saved` of which are saved; passed: how many were passed; log: the
    steps; ended: whether the call has reached the end of its segment."""

    problem: Problem
    times: np.ndarray
    saved: int
    done: Advanced
    passed: int
    log: Log
    ended: bool

    @property
    def motion(self) -> Motion:
        """The motion at its end."""
        return self.done.motion


class Seen(NamedTuple):
    """The instants passed in a call that are saved: observables and statistics.

    saved: their number; last: the last instant passed, on the constraints; steps: the steps since the saved
    instant before; left: those of them that belong to later instants; energy: as in `Checkpoint`; result:
    name of a member of `RESULTS`."""

    rows: dict[str, np.ndarray]
    numerics: dict[str, np.ndarray]
    saved: int
    last: Point | None
    steps: Pending
    left: Pending
    energy: tuple[float, float]
    result: str
