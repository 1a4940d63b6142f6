"""Ensembles: many runs of one scene, with numbers of their own for every member.

Members run in one compiled program. On a CPU every core takes one at a time, from a thread of its own, and
its numbers then stay in its cache (in lockstep they take no less time: `experiments/ensembles`); on a GPU
all of a batch go in lockstep, and several GPUs share a batch. Members that fail there are run again by
themselves, where a run may repair its steps and say what went wrong.
"""

import dataclasses
import functools
import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, PartitionSpec

from esail_jax.array_types import Array, Bool, Float
from esail_jax.compiler import compile_lowered
from esail_jax.cores import cores
from esail_jax.ensembles.sampling import Inputs, of_members
from esail_jax.numerics.lockstep import LOCKSTEP
from esail_jax.observables import listed, shape_of
from esail_jax.observables.balance import TERMS
from esail_jax.observables.run_warning import STEP_ERRORS, joined_warnings
from esail_jax.scenes.build import build
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import split
from esail_jax.simulation.prepare import plan_of, require_64_bit
from esail_jax.simulation.results import RESULTS
from esail_jax.simulation.schedule import save_times
from esail_jax.simulation.simulate import simulate, simulate_traced
from esail_jax.system import System

Rows = dict[str, Float[np.ndarray, "member time ..."]]

MOST_BYTES = 2**28
"""Of a batch's results."""

CPU_BATCH = 8
"""Members of a core in one call, at most, on a CPU: some seconds, after which the host may stop."""

PROBE, GPU_BATCH, SHARE = 8, 4096, 0.4
"""On a GPU: the batch whose memory is measured, the largest, and the part of the memory it may take."""

BALANCE = {"tethers": TERMS, "chain": ("energy_error", *TERMS)}
"""What is looked at to see whether a member's energy is accounted for."""


@dataclasses.dataclass(frozen=True)
class Ensemble:
    """Members and what was seen of them.

    inputs: by key, member first; rows: observables, (member, time, ...), NaN from a failure on; complete:
    which members reached their end; messages: what is to be said of a member, or nothing; steps: how many
    it took."""

    scene: Scene
    members: np.ndarray
    time: Float[np.ndarray, " time"]
    inputs: Inputs
    rows: Rows
    complete: Bool[np.ndarray, " member"]
    messages: tuple[str, ...]
    steps: Float[np.ndarray, " member"]

    def __getitem__(self, name: str) -> Float[np.ndarray, "member time *some"]:
        return self.rows[name]

    def __len__(self) -> int:
        return len(self.members)

    @property
    def failed(self) -> np.ndarray:
        """Numbers of the members that did not reach their end."""
        return self.members[~self.complete]


def simulate_members(
    scene: Scene,
    inputs: Inputs,
    observables: Sequence[str] | None = None,
    batch: int | None = None,
    lockstep: bool | None = None,
) -> Ensemble:
    """Run a scene once for every member of `inputs` (arrays by scene key, member first), all at once in
    this process.

    observables: those wanted, all if None; batch, lockstep: members in one call, and whether they go side
    by side (None: what suits the device). Raises SceneError."""
    run = Runner(scene, inputs, observables, batch, lockstep)
    members = np.arange(len(next(iter(inputs.values()))))
    firsts = range(0, len(members), run.batch)
    return joined([run(members[first : first + run.batch]) for first in firsts])


def joined(parts: Sequence[Ensemble]) -> Ensemble:
    """Parts of an ensemble as one."""
    first = parts[0]

    def column(name):
        return np.concatenate([getattr(part, name) for part in parts])

    def columns(name):
        of_parts = [getattr(part, name) for part in parts]
        return {key: np.concatenate([x[key] for x in of_parts]) for key in getattr(first, name)}

    messages = tuple(text for part in parts for text in part.messages)
    return Ensemble(
        first.scene, column("members"), first.time, columns("inputs"), columns("rows"),
        column("complete"), messages, column("steps"),
    )  # fmt: skip


class Runner:
    """Runs members of an ensemble, `batch` in one call.

    inputs: of all members; one_core: on a CPU, one member after the other, not as many at once as there are
    cores. Raises SceneError for observables that do not exist."""

    def __init__(
        self,
        scene: Scene,
        inputs: Inputs,
        observables: Sequence[str] | None = None,
        batch: int | None = None,
        lockstep: bool | None = None,
        one_core: bool = False,
    ):
        require_64_bit()
        self.scene, self.inputs, self.one_core = scene, inputs, one_core
        self.common = with_common_method(scene)
        self.time = save_times(scene.integrator.t_end, scene.output.interval)
        self.lockstep = jax.default_backend() != "cpu" if lockstep is None else lockstep
        self.shapes = shapes_of(scene)
        self.observables = chosen(self.shapes, observables)
        balance = tuple(name for name in BALANCE[scene.main] if name in self.shapes)
        self._wanted = tuple(dict.fromkeys((*self.observables, *balance)))
        self._compiled: Callable | None = None
        batch = self._fitting() if batch is None else batch
        devices = len(jax.local_devices()) if self.lockstep else 1
        self.batch = -(-batch // devices) * devices

    def _fitting(self) -> int:
        """Members in one call: as many as memory holds, and on a CPU not more than take some seconds."""
        each = 8 * len(self.time) * sum(math.prod(self.shapes[name]) for name in self._wanted)
        if not self.lockstep:
            return int(np.clip(MOST_BYTES // each, 1, CPU_BATCH * (1 if self.one_core else cores())))
        devices = jax.local_devices()
        room = (devices[0].memory_stats() or {}).get("bytes_limit", MOST_BYTES)
        # Of each device's own share of the program.
        memory = compile_lowered(self._lowered(PROBE * len(devices))).memory_analysis()
        each = max(each, (memory.temp_size_in_bytes + memory.output_size_in_bytes) / PROBE)
        return int(np.clip(SHARE * room / each, 1, GPU_BATCH)) * len(devices)

    def _lowered(self, count: int) -> jax.stages.Lowered:
        """The program of `count` members side by side, or of one."""
        leading = (count,) if self.lockstep else ()
        inputs = {
            key: jax.ShapeDtypeStruct((*leading, *values.shape[1:]), float)
            for key, values in self.inputs.items()
        }
        member = jax.ShapeDtypeStruct(leading, int)
        return jax.jit(program(self.common, self._wanted, self.lockstep)).lower(member, inputs)

    def compile(self) -> None:
        """Do it now, unless it is done."""
        if self._compiled is None:
            self._compiled = compile_lowered(self._lowered(self.batch))

    def __call__(self, members: np.ndarray) -> Ensemble:
        """These members, `batch` at most."""
        self.compile()
        count = len(members)
        if self.lockstep:
            # The last ones are members again: the program has as many as it was compiled for.
            padded = np.append(members, np.full(self.batch - count, members[-1]))
            found = jax.device_get(self._compiled(padded, of_members(self.inputs, padded)))
        else:
            found = jax.tree.map(lambda *x: np.stack(x), *self._each(members))
        rows, complete, steps, errors = jax.tree.map(lambda x: np.array(x[:count]), found)
        steps, messages = steps.astype(float), []
        for k, member in enumerate(members):
            message = joined_warnings({name: x[k] for name, x in rows.items()}, errors[k].tolist())
            if not complete[k]:
                alone, complete[k], steps[k], message = self.alone(int(member))
                for name, values in alone.items():
                    rows[name][k] = values
            messages.append(message)
        return Ensemble(
            self.scene, np.asarray(members), self.time, of_members(self.inputs, members),
            {name: rows[name] for name in self.observables}, complete, tuple(messages), steps,
        )  # fmt: skip

    def _each(self, members: np.ndarray) -> list[Any]:
        """Results of members, as many of them at once as there are cores."""
        if self.one_core:
            return [self._one(member) for member in members]
        # Called one after the other they would run so, too, although JAX's calls return at once.
        pool = ThreadPoolExecutor(cores())
        try:
            return list(pool.map(self._one, members))
        finally:
            pool.shutdown(cancel_futures=True)

    def _one(self, member: np.integer) -> Any:
        """Results of a member."""
        return jax.device_get(self._compiled(member, of_members(self.inputs, member)))

    def alone(self, member: int) -> tuple[dict[str, np.ndarray], bool, float, str]:
        """A member run by itself: its rows, NaN from a failure on, whether it is complete, its steps, and
        what is to be said of it."""
        try:
            run = simulate(self.common, of_members(self.inputs, member), throw=False)
        except SceneError as error:
            length = len(self.time)
            rows = {name: np.full((length, *self.shapes[name]), np.nan) for name in self._wanted}
            return rows, False, 0.0, str(error)
        rows = {name: np.asarray(run[name]) for name in self._wanted}
        return rows, bool(run.result == RESULTS.successful), float(run.steps), run.stats["message"]


def system_of(scene: Scene) -> System:
    """The scene's system, shapes in place of numbers."""
    structure, numbers = split(with_method(scene))
    return jax.eval_shape(lambda n: build(structure, n).system, numbers)


def shapes_of(scene: Scene) -> dict[str, tuple[int, ...]]:
    """Shapes of the scene's observables at one instant."""
    return {x.name: shape_of(x.axes, scene.members.count) for x in listed(system_of(scene))}


def chosen(known: Iterable[str], observables: Sequence[str] | None) -> tuple[str, ...]:
    """The known observables that are asked for, all if None. Raises SceneError for one that is none."""
    for name in observables or ():
        if name not in known:
            raise SceneError("observables", f"be among {', '.join(known)}", f"is {name!r}")
    return tuple(known) if observables is None else tuple(dict.fromkeys(observables))


def with_common_method(scene: Scene) -> Scene:
    """The scene with the method, and the fixed step, that its own numbers call for: all members take
    those. A tolerance that is not given follows from each member's numbers."""
    table = with_method(scene).integrator
    chosen = {"integrator.method": table.method, "integrator.step": table.step}
    return scene.replace({key: value for key, value in chosen.items() if value is not None})


def program(scene: Scene, names: tuple[str, ...], lockstep: bool) -> Callable:
    """Of a member's number and inputs: the named observables, whether it reached its end, its steps, and
    what they may be off by (nothing where the method has control of them).
    Lockstep: of many members, side by side, shared out among the devices."""

    def one(member, inputs):
        run = simulate_traced(scene.replace(inputs))
        # A number of the member's own keeps the run a traced one where nothing is varied.
        steps = steps_of(scene, run.stats) + 0 * member
        errors = run.stats.get("step_errors", jnp.zeros(len(STEP_ERRORS)))
        return {name: run[name] for name in names}, run.result == RESULTS.successful, steps, errors

    if not lockstep:
        return one
    side_by_side = jax.vmap(one, axis_name=LOCKSTEP)
    devices = jax.local_devices()
    if len(devices) == 1:
        return side_by_side
    mesh = Mesh(np.array(devices), ("member",))
    shares = PartitionSpec("member")
    return jax.shard_map(side_by_side, mesh=mesh, in_specs=shares, out_specs=shares, check_vma=False)


@functools.lru_cache(maxsize=8)
def planned_steps(scene: Scene) -> float:
    """Of a method of fixed steps."""
    return float(sum(entry.take for entry in plan_of(scene).entries if entry.kind == "march"))


def steps_of(scene: Scene, stats: dict[str, Any]) -> Array | float:
    """Steps of a traced run."""
    return stats["steps"] if "steps" in stats else planned_steps(scene)
