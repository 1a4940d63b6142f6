"""The program that simulates members of an ensemble: one member, or a batch of them in lockstep.

Members share one compiled program, so they share the method of integration and every other structural
choice; only physical numbers differ between them.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, PartitionSpec

from esail_jax.compilation.kept import key_of, tree_program
from esail_jax.ensembles.sampling import Inputs
from esail_jax.observables import listed, shape_of
from esail_jax.observables.run_warning import STEP_ERRORS
from esail_jax.scenes.build import build
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import SCHEDULE, split
from esail_jax.simulation.under_trace import simulate_traced
from esail_jax.steppers.results import RESULTS
from esail_jax.system import System
from kept_programs.program import TreeProgram
from kept_programs.remembered import remembered


class MemberResult(NamedTuple):
    """The result of one member, or of several with `member` as first axis.

    rows: observables by name, time first; complete: true at the end time; steps: number of steps;
    step_errors: estimates in the order of `STEP_ERRORS`, zero for methods that control their error; jumped:
    whether the voltage of a user's law has jumped."""

    rows: dict[str, Any]
    complete: Any
    steps: Any
    step_errors: Any
    jumped: Any = False


def members_program(scene: Scene, names: tuple[str, ...], inputs: Inputs, count: int | None) -> TreeProgram:
    """The program (member's number, its inputs, its largest number of steps) -> MemberResult with the named
    observables. Programs are kept, so that worker processes load what one of them has compiled.

    inputs: of all members, for their shapes; count: members in lockstep, or None for one member."""
    return program_of_members(
        SameScene(scene), names, tuple((k, x.shape[1:]) for k, x in inputs.items()), count
    )


TIMES = tuple(key.split(".") for key in SCHEDULE)
"""Table and name of the numbers that decide which instants a run computes; they are never arrays."""


class SameScene:
    """A scene that is equal to another one if the two have the same programs and numbers, also with a law
    of a user's own, for which a program has no key."""

    def __init__(self, scene: Scene):
        structure, numbers = split(scene)
        values = tuple((key, x.shape, np.asarray(x).tobytes()) for key, x in sorted(numbers.items()))
        times = tuple(getattr(getattr(scene, table), name, None) for table, name in TIMES)
        self.scene, self._identity = scene, (structure, values, times)

    def __hash__(self) -> int:
        return hash(self._identity)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SameScene) and self._identity == other._identity


@remembered(maxsize=16)
def program_of_members(
    same: SameScene,
    names: tuple[str, ...],
    inputs: tuple[tuple[str, tuple[int, ...]], ...],
    count: int | None,
) -> TreeProgram:
    """The program of `members_program`, which is compiled once in a process. inputs: keys, and the
    shape of a member's numbers."""
    scene, leading = same.scene, () if count is None else (count,)
    shapes = {key: jax.ShapeDtypeStruct((*leading, *shape), float) for key, shape in inputs}
    member, limit = jax.ShapeDtypeStruct(leading, int), jax.ShapeDtypeStruct(leading, float)
    function = member_function(scene, names)
    key = key_of(members_program, scene, names, shapes, count)
    return tree_program(function if count is None else in_lockstep(function), (member, shapes, limit), key)


def member_function(scene: Scene, names: tuple[str, ...]) -> Callable:
    """The function (member's number, its inputs, its largest number of steps) -> MemberResult."""

    def simulate_member(member, inputs, limit):
        run = simulate_traced(scene.replace(inputs), limit=limit)
        # The member's number makes the result depend on an argument, even if nothing is varied. Otherwise
        # the whole run would be a constant, computed while compiling.
        steps = run.stats["steps"] + 0 * member
        errors = run.stats.get("step_errors", jnp.zeros(len(STEP_ERRORS)))
        rows = {name: run[name] for name in names}
        jumped = run.stats.get("jumped", jnp.asarray(False))
        return MemberResult(rows, run.result == RESULTS.successful, steps, errors, jumped)

    return simulate_member


def in_lockstep(function: Callable) -> Callable:
    """A function of one member, for many members in lockstep, divided among the local devices."""
    side_by_side = jax.vmap(function)
    devices = jax.local_devices()
    if len(devices) == 1:
        return side_by_side
    mesh = Mesh(np.array(devices), ("member",))
    shares = PartitionSpec("member")
    return jax.shard_map(side_by_side, mesh=mesh, in_specs=shares, out_specs=shares, check_vma=False)


# ---- what members have in common ----------------------------------------------------------------


def with_common_method(scene: Scene) -> Scene:
    """The scene with the method of integration, and the fixed step if there is one, that the scene's own
    numbers call for. All members use them. A tolerance that is not given follows from each member's
    numbers."""
    table = with_method(scene).integrator
    chosen = {"integrator.method": table.method, "integrator.step": table.step}
    return scene.replace({key: value for key, value in chosen.items() if value is not None})


def system_of(scene: Scene) -> System:
    """The scene's system, with shapes in place of numbers."""
    structure, numbers = split(scene)
    return jax.eval_shape(lambda n: build(structure, n).system, numbers)


def observable_shapes(scene: Scene) -> dict[str, tuple[int, ...]]:
    """Shapes of the scene's observables at one instant, by name."""
    return {x.name: shape_of(x.axes, scene.sizes) for x in listed(system_of(scene))}


def select_observables(known: Iterable[str], names: Sequence[str] | None) -> tuple[str, ...]:
    """The given names without repetition, or all known ones if None. Raises SceneError for an unknown
    name."""
    for name in names or ():
        if name not in known:
            raise SceneError("observables", f"be among {', '.join(known)}", f"is {name!r}")
    return tuple(known) if names is None else tuple(dict.fromkeys(names))
