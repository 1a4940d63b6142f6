"""The host's loop over the entries of a run: repair, checkpoints, failure."""

import dataclasses
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.observables import chain, is_chain
from esail_jax.observables.run_warning import STEP_ERRORS
from esail_jax.simulation import block_march, explicit
from esail_jax.simulation.block_march import BlockMarch
from esail_jax.simulation.entry import Carry, entry_data, look_at_entry_jitted, step_entry_jitted
from esail_jax.simulation.explicit import ExplicitMarch
from esail_jax.simulation.prepare import Prepared
from esail_jax.simulation.results import RESULTS, Checkpoint, Piece, SimulationError, join
from esail_jax.simulation.schedule import Entry, stretch
from esail_jax.steppers.fixed_step import StepInfo

MAX_HALVINGS = 6
"""Times a stretch that does not converge is repeated with half the step before the run gives up."""

NUMERICS = {
    "iterations_per_step": "-",
    "last_increment": "m",
    "constraint_violation": "m",
    "residual": "N",
}
"""Names and units of what is kept per saved interval: mean chord iterations of a step, and the
largest last increment, constraint violation and unbalanced force of a node (`StepInfo`). Beside them
stands what the steps may have come to be off by at the end of an instant's entry (`STEP_ERRORS`)."""


def march_of(
    prepared: Prepared, checkpoint: Checkpoint | None = None
) -> "March | ExplicitMarch | BlockMarch":
    """The loop for a prepared scene's method, from its start or from a checkpoint."""
    if prepared.plan is not None:
        return March(prepared, checkpoint)
    return (BlockMarch if prepared.collocated else ExplicitMarch)(prepared, checkpoint)


def numerics_of(prepared: Prepared) -> dict[str, str]:
    """Names and units of what a method keeps per saved interval."""
    if prepared.plan is not None:
        return NUMERICS | dict.fromkeys(STEP_ERRORS, "-")
    return (block_march if prepared.collocated else explicit).NUMERICS


class March:
    """Runs a prepared scene entry by entry, repairing what does not converge."""

    def __init__(self, prepared: Prepared, checkpoint: Checkpoint | None = None):
        self.prepared, self.plan = prepared, prepared.plan
        start = checkpoint or Checkpoint(prepared.carry, 0, 0, 0, Tally().values)
        self.carry, self.position, self.rows, self.steps, tally, self.energy = start
        self.tally = Tally(*tally)
        self.checkpoint = start
        self.repairs = 0

    def pieces(self) -> Iterator[Piece]:
        """One piece per entry. Raises SimulationError when even small steps fail, after a last
        piece with what the failed entry still saw."""
        while self.position < len(self.plan.entries):
            entry = self.plan.entries[self.position]
            try:
                rows, time, numerics = self._entry(entry)
            except SimulationError as error:
                yield error.seen
                raise
            self.position += 1
            self.rows += len(time)
            if self.common(entry):
                here = (self.carry, self.position, self.rows, self.steps, self.tally.values)
                self.checkpoint = Checkpoint(*here, self.energy)
            yield Piece(rows, time, numerics, entry.end)

    def common(self, entry: Entry) -> bool:
        """Does this entry stand in a longer run's plan too, rows and all, so that one may go on
        from its end? Not the last one (it saves t_end), nor those of a shorter last step."""
        whole_steps = entry.step == self.prepared.resolved.integrator.step
        whole_entry = entry.kind == "begin" or not entry.hand_over
        return whole_steps and whole_entry and self.position < len(self.plan.entries)

    def _call(self, entry: Entry, carry: Carry, *, repair: bool):
        # Room for as many saved instants in a repair, whose steps hold fewer: one program for all of them.
        data = entry_data(entry, self.plan.rows_per_entry)
        problem, compiled = self.prepared.problem, self.prepared.programs
        if not repair:
            stepped = compiled.step(problem, carry.state, data)
            carry, seen = compiled.look(problem, carry, data, *stepped)
        else:  # compiled when it is needed
            stepped = step_entry_jitted(problem, carry.state, data, self.plan.steps_per_entry, 1, True)
            carry, seen = look_at_entry_jitted(problem, carry, data, *stepped, True)
        return carry, (seen, stepped[2])

    def _entry(self, entry: Entry) -> tuple[dict, np.ndarray, dict]:
        carry, (seen, info) = self._call(entry, self.carry, repair=False)
        if int(carry.failed) and entry.kind == "march":
            return self._repair(entry, seen, info)
        if int(carry.failed):  # a trial step only improves the start: go on without it
            carry = carry._replace(failed=jnp.zeros((), int), state=self.carry.state)
        self.carry = carry
        return self._collect(entry, seen, info)

    def _collect(self, entry: Entry, seen: dict, info: StepInfo):
        count = len(entry.rows)
        rows = {name: np.asarray(value)[:count] for name, value in seen.items()}
        time = np.array([row[0] for row in entry.rows])
        if count and is_chain(self.prepared.problem.system):
            rows, self.energy = chain.with_energy_error(rows, self.energy, np)
        parts = np.asarray(self.carry.errors.parts)
        numerics = self.tally.add(entry, jax.tree.map(np.asarray, info))
        numerics |= {name: np.full(count, part) for name, part in zip(STEP_ERRORS, parts, strict=True)}
        self.steps += entry.take if entry.kind == "march" else 0
        return rows, time, numerics

    def _repair(self, entry: Entry, seen: dict, info: StepInfo) -> tuple[dict, np.ndarray, dict]:
        """The stretch of an entry again: factors of every step, then half the step, and so on.

        `seen` are the rows of the first attempt, NaN from its failure on, `info` its steps.
        """
        self.repairs += 1
        steps, times = self.plan.steps_per_entry, np.array([row[0] for row in entry.rows])
        attempts = [[entry]]
        for halving in range(1, MAX_HALVINGS + 1):
            fine = stretch(entry.start, entry.end, entry.step / 2**halving, steps, times, False)
            fine[-1:] = [_handing_over(fine[-1])]
            attempts.append(fine + stretch_start(entry.end, entry.step))
        for attempt in attempts:
            carry, parts, failure = self.carry, [], None
            for part in attempt:
                before = carry
                carry, (found, how) = self._call(part, carry, repair=True)
                if int(carry.failed) and part.kind == "trial":
                    carry = before._replace(failed=jnp.zeros((), int))
                elif int(carry.failed):
                    failure = (part, jax.tree.map(np.asarray, how))
                    break
                parts.append((part, found, how))
            if failure is None:
                self.carry = carry
                collected = [self._collect(*part) for part in parts]
                rows, times, numerics = zip(*collected, strict=True)
                return join(rows), np.concatenate(times), join(numerics)
        good = int(np.isfinite(np.asarray(seen["kinetic_energy"])[: len(entry.rows)]).sum())
        part = dataclasses.replace(entry, rows=entry.rows[:good])
        rows, time, numerics = self._collect(part, seen, info)
        last = Piece(rows, time, numerics, entry.start)
        raise failure_of(*failure, last)


def stretch_start(start: float, step: float) -> list[Entry]:
    """Entries that begin afresh at `start`, saving nothing."""
    return stretch(start, start, step, 1, np.empty(0), False)


def _handing_over(entry: Entry) -> Entry:
    return dataclasses.replace(entry, hand_over=True)


def failure_of(entry: Entry, info: StepInfo, seen: Piece) -> SimulationError:
    """The error that describes an entry's first failed step."""
    good = np.asarray(jax.vmap(StepInfo.converged)(info))[: max(entry.take, 1)]
    step = int(np.argmin(good))
    increment = float(info.increment[step].max())
    finite = np.isfinite(increment)
    result = RESULTS.newton_diverged if finite else RESULTS.nonfinite
    return SimulationError(
        f"{RESULTS[result]} At t = {entry.start + (step + 1) * entry.step:.6g} s with steps of "
        f"{entry.step:.3g} s, tether {int(info.tether[step])}: last increment {increment:.3g} m "
        f"after {int(info.iterations[step])} iterations, constraint violation "
        f"{float(info.constraint[step]):.3g} m. Smaller steps did not help.",
        result,
        seen,
    )


class Tally:
    """Iterations and steps since the last saved instant, and the largest of what `NUMERICS` keeps."""

    NOTHING = (0.0,) * (1 + len(NUMERICS))

    def __init__(self, *values: float):
        self.values = values or self.NOTHING

    def add(self, entry: Entry, info: StepInfo) -> dict[str, np.ndarray]:
        """Values at an entry's saved instants; the remainder is kept for the next one."""
        marching = entry.kind == "march"
        cuts = [row[1] + 1 if marching else 0 for row in entry.rows]
        found, done = [], 0
        for cut in [*cuts, entry.take if marching else 0]:
            part = slice(done, max(cut, done))
            iterations, steps, *largest = self.values
            now = (info.increment, info.constraint, info.residual)
            self.values = (
                iterations + float(info.iterations[part].sum()),
                steps + max(cut - done, 0),
                *(float(x[part].max(initial=before)) for x, before in zip(now, largest, strict=True)),
            )
            done = max(done, cut)
            if len(found) < len(entry.rows):
                iterations, steps, *largest = self.values
                found.append((iterations / max(steps, 1.0), *largest))
                self.values = self.NOTHING
        columns = np.array(found, float).reshape(-1, len(NUMERICS)).T
        return dict(zip(NUMERICS, columns, strict=True))
