"""Running members of an ensemble, a batch at a time.

On a CPU every core takes one member at a time, from a thread of its own; the member's numbers then stay
in the core's cache. Lockstep is not faster there (`experiments/ensembles`). On a GPU all members of a
batch run in lockstep, and several GPUs divide the batch among them. Members that fail are run again
alone, as a single run, which can repair steps and explains its failure.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import numpy as np

from esail_jax.compilation.options import lower
from esail_jax.cores import cores
from esail_jax.ensembles.batch_size import batch_in_lockstep, batch_on_cores
from esail_jax.ensembles.ensemble import Ensemble
from esail_jax.ensembles.member_program import (
    MemberResult,
    members_program,
    observable_shapes,
    select_observables,
    with_common_method,
)
from esail_jax.ensembles.sampling import Inputs, select_members
from esail_jax.observables.balance import TERMS
from esail_jax.observables.run_warning import joined_warnings
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.tethers import Thermal
from esail_jax.simulation.law_jumps import JUMPS
from esail_jax.simulation.problem import require_64_bit
from esail_jax.simulation.schedule import save_times
from esail_jax.simulation.simulate import simulate
from esail_jax.steppers.results import RESULTS
from kept_programs.program import TreeProgram

BALANCE = {"sail": TERMS, "chain": ("energy_error", *TERMS)}
"""Observables that show whether a member's energy is balanced, for sails and for chains."""


class MemberRunner:
    """Runs members of an ensemble, at most `batch` in one call.

    inputs: of any members, for their shapes; observables: names, all if None; batch: members in one call,
    lockstep: whether they run in lockstep (None: what suits the device); one_core: on a CPU run one member
    after the other instead of one per core; max_steps: largest number of steps of a member; members: their
    number in all, which bounds the batch (None: those of `inputs`). Raises SceneError for an unknown
    observable, RuntimeError in 32-bit mode."""

    def __init__(
        self,
        scene: Scene,
        inputs: Inputs,
        observables: Sequence[str] | None = None,
        batch: int | None = None,
        lockstep: bool | None = None,
        one_core: bool = False,
        max_steps: int | None = None,
        members: int | None = None,
    ):
        require_64_bit()
        self.scene, self.max_steps, self._like = scene, max_steps, inputs
        self._limit = np.inf if max_steps is None else float(max_steps)
        self.threads = 1 if one_core else cores()
        self.common = with_common_method(scene)
        self.time = save_times(scene.integrator.t_end, scene.output.interval)
        self.lockstep = jax.default_backend() != "cpu" if lockstep is None else lockstep
        self.shapes = observable_shapes(scene)
        self.observables = select_observables(self.shapes, observables)
        balance = tuple(name for name in BALANCE[scene.model] if name in self.shapes)
        self._computed = tuple(dict.fromkeys((*self.observables, *balance)))
        self._program: TreeProgram | None = None
        devices = len(jax.local_devices()) if self.lockstep else 1
        count = len(next(iter(inputs.values()), ())) if members is None else members
        batch = self._fitting_batch(count) if batch is None else batch
        self.batch = -(-batch // devices) * devices

    def __call__(self, members: np.ndarray, inputs: Inputs) -> Ensemble:
        """Computes these members, at most `batch`. inputs: of these members."""
        self.compile()
        results = (self._in_lockstep if self.lockstep else self._on_cores)(members, inputs)
        rows, complete, steps, errors, jumped = jax.tree.map(np.array, results)
        steps, messages = steps.astype(float), []
        for k in range(len(members)):
            of_member = {name: x[k] for name, x in rows.items()}
            own = select_members(inputs, k)
            message = joined_warnings(of_member, errors[k].tolist(), self._heat(own))
            if jumped[k]:
                message = " ".join(filter(None, (JUMPS, message)))
            if not complete[k]:
                alone, message = self.run_alone(own)
                complete[k], steps[k] = alone.complete, alone.steps
                for name, values in alone.rows.items():
                    rows[name][k] = values
            messages.append(message)
        return Ensemble(
            self.scene, np.asarray(members), self.time, inputs,
            {name: rows[name] for name in self.observables}, complete, tuple(messages), steps,
        )  # fmt: skip

    def _heat(self, inputs: Mapping[str, Any]) -> Thermal | None:
        """The table [thermal] of a member, with its own numbers."""
        table = self.scene.thermal
        if table is None:
            return None
        names = [name for name in vars(table) if f"thermal.{name}" in inputs]
        own = {name: inputs[f"thermal.{name}"] for name in names}
        return dataclasses.replace(table, **own) if own else table

    # ---- program and batch ----------------------------------------------------------------------

    def program(self, count: int | None) -> TreeProgram:
        """The program of `count` members in lockstep, or of one member (None)."""
        return members_program(self.common, self._computed, self._like, count)

    def lower(self, count: int) -> jax.stages.Lowered:
        """The lowered program of `count` members in lockstep."""
        return lower(self.program(count).program.traced)

    def compile(self) -> None:
        """Compiles the program, unless this is done already."""
        if self._program is None:
            self._program = self.program(self.batch if self.lockstep else None)
            self._program.compile()

    def _fitting_batch(self, count: int) -> int:
        """Members in one call: all `count`, or as many as the memory holds; on a CPU not more than take
        some seconds."""
        result_bytes = 8 * len(self.time) * sum(math.prod(self.shapes[name]) for name in self._computed)
        if self.lockstep:
            return batch_in_lockstep(result_bytes, count, self.lower)
        return batch_on_cores(result_bytes, self.threads)

    # ---- members --------------------------------------------------------------------------------

    def _in_lockstep(self, members: np.ndarray, inputs: Inputs) -> MemberResult:
        """Results of members in lockstep."""
        # The program has a fixed number of members: the last one is repeated to fill the batch.
        padded = np.minimum(np.arange(self.batch), len(members) - 1)
        limits = np.full(self.batch, self._limit)
        results = jax.device_get(self._program(members[padded], select_members(inputs, padded), limits))
        return jax.tree.map(lambda x: x[: len(members)], results)

    def _on_cores(self, members: np.ndarray, inputs: Inputs) -> MemberResult:
        """Results of members, one per core at a time."""
        each = [(member, select_members(inputs, k)) for k, member in enumerate(members)]
        if self.threads == 1:
            results = [self._run_one(*one) for one in each]
        else:
            # From one thread the runs would be sequential, although JAX's calls return at once.
            pool = ThreadPoolExecutor(self.threads)
            try:
                results = list(pool.map(self._run_one, *zip(*each, strict=True)))
            finally:
                pool.shutdown(cancel_futures=True)
        return jax.tree.map(lambda *x: np.stack(x), *results)

    def _run_one(self, member: np.integer, inputs: Mapping[str, Any]) -> MemberResult:
        """Result of one member, by the compiled program."""
        return jax.device_get(self._program(member, inputs, self._limit))

    def run_alone(self, inputs: Mapping[str, Any]) -> tuple[MemberResult, str]:
        """Result of one member as a single run, and its warning or failure. Rows are NaN after a
        failure."""
        try:
            run = simulate(self.common, inputs, throw=False, max_steps=self.max_steps)
        except SceneError as error:
            length = len(self.time)
            rows = {name: np.full((length, *self.shapes[name]), np.nan) for name in self._computed}
            return MemberResult(rows, False, 0.0, None), str(error)
        rows = {name: np.asarray(run[name]) for name in self._computed}
        complete = bool(run.result == RESULTS.successful)
        return MemberResult(rows, complete, float(run.steps), None), run.stats["message"]
