"""The host's loop around the programs of a sail's run by collocation (`simulation/blocks.py`)."""

from collections.abc import Iterator

import jax
import numpy as np

from esail_jax.simulation.blocks import ROWS_PER_LOOK, Carry, standing
from esail_jax.simulation.results import RESULTS, Checkpoint, Piece, SimulationError, join
from esail_jax.simulation.schedule import next_switch, save_times, stops
from esail_jax.steppers.collocation_steps import Progress, Record

NUMERICS = {
    "steps": "-",
    "rejected_steps": "-",
    "last_step": "s",
    "iterations_per_step": "-",
    "constraint_violation": "m",
}
"""Names and units of what is kept per saved instant: steps that ended since the instant before, those
repeated (in the call the instant was seen in, with its first instant), the size of the step it lies in,
mean iterations (of the steps of that call), and its constraint violation."""


class BlockMarch:
    """Runs a prepared sail block by block."""

    def __init__(self, prepared, checkpoint: Checkpoint | None = None):
        self.prepared = prepared
        start = checkpoint or Checkpoint(prepared.carry, 0, 0, 0, (0.0, 0.0))
        self.carry, self.rows, self.steps = start.carry, start.rows, start.steps
        self.rejected = float(start.tally[0])
        self.checkpoint = start
        self.repairs = 0
        scene = prepared.resolved
        self.times = save_times(scene.integrator.t_end, scene.output.interval)
        self.stops = stops(scene.integrator.t_end, scene.event, scene.voltage)
        # Those after the end time too: a longer run must be the same until there.
        self.switches = stops(np.inf, scene.event, scene.voltage)

    def pieces(self) -> Iterator[Piece]:
        """One piece per call. Raises SimulationError when the run is stuck, after a last piece with
        what was seen before."""
        compiled = self.prepared.programs
        while self.rows < len(self.times):
            began = float(self.carry.progress.now.time)
            problem = self.prepared.problem.with_events_until(np.asarray(began))
            stop = next((time for time in self.stops if time > began), self.stops[-1])
            carry, records = compiled.blocks(problem, self.carry, np.asarray(stop))
            reached = min(float(carry.progress.now.time), stop)
            tried = np.asarray(records.h)
            shown = records
            if not self.rows and not np.asarray(records.taken).any():
                shown = standing(carry.progress.now, records)  # stuck at the start, which is seen still
            count = int(np.searchsorted(self.times, reached, side="right"))
            times = self.times[self.rows : max(count, self.rows)]
            rows, violation = [], []
            for first in range(0, len(times), ROWS_PER_LOOK):
                part = times[first : first + ROWS_PER_LOOK]
                padded = np.append(part, np.zeros(ROWS_PER_LOOK - len(part)))
                seen, last, gap = compiled.look(problem, carry, shown, padded, len(part))
                rows.append({name: np.asarray(value)[: len(part)] for name, value in seen.items()})
                violation.append(np.asarray(gap)[: len(part)])
                carry = carry._replace(seen=last)
            numerics = self._numerics(records, carry, times, violation)
            if len(times):
                counted = carry.counted + numerics["steps"].sum()
                carry = carry._replace(counted=counted)
            if reached == stop < self.stops[-1]:
                here = np.asarray(stop)
                until = np.asarray(next_switch(self.switches, stop))
                carry = compiled.go_on(
                    problem, problem.with_events_until(here), carry, records, here, until
                )
            self.carry, self.rows = carry, self.rows + len(times)
            self.steps = int(carry.progress.taken)
            if self.rows < len(self.times):
                # Not the last one: a longer run saves other instants after this one's end time.
                self.checkpoint = Checkpoint(carry, self.rows, self.rows, self.steps, (self.rejected, 0.0))
            if rows:
                yield Piece(join(rows), times, numerics, reached)
            here = jax.tree.map(np.asarray, carry.progress)
            if self.rows < len(self.times) and problem.method.stuck(here, np):
                raise self._failure(carry.progress, tried)

    def _numerics(
        self, records: Record, carry: Carry, times: np.ndarray, violation: list[np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Of the steps that ended since the saved instant before; rejections with the first instant of
        their call."""
        progress, records = jax.tree.map(np.asarray, (carry.progress, records))
        taken = records.taken
        ends, sizes = records.end[taken], records.h[taken]
        cuts = np.searchsorted(ends, times, side="right")
        iterations = np.append(0, np.cumsum(records.info.iterations[taken]))
        before = float(progress.taken) - len(ends)
        steps = np.diff(before + cuts, prepend=float(carry.counted))
        of_call, work = np.diff(cuts, prepend=0), np.diff(iterations[cuts], prepend=0)
        rejected = np.zeros(len(times))
        if len(times):
            rejected[0] = float(progress.rejected) - self.rejected
            self.rejected = float(progress.rejected)
        inside = np.minimum(cuts, max(len(sizes) - 1, 0))
        values = (
            steps,
            rejected,
            np.append(sizes, float(progress.h))[inside],
            work / np.maximum(of_call, 1),
            np.concatenate([*violation, []]),
        )
        return dict(zip(NUMERICS, values, strict=True))

    def _failure(self, progress: Progress, tried: np.ndarray) -> SimulationError:
        """tried: sizes [s] of the last call's steps."""
        finite = all(np.isfinite(np.asarray(x)).all() for x in jax.tree.leaves(progress.now))
        result = RESULTS.newton_diverged if finite else RESULTS.nonfinite
        size = tried[tried > 0.0][-1] if (tried > 0.0).any() else float("nan")
        hint = "Ask for a shorter one." if self.prepared.problem.method.step_size is not None else ""
        time = float(progress.now.time)
        message = f"{RESULTS[result]} At t = {time:.6g} s with a step of {size:.3g} s. {hint}".strip()
        return SimulationError(message, result, Piece({}, np.empty(0), {}, time))
