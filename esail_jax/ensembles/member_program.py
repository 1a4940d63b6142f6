"""The program that simulates members of an ensemble: one member, or a batch of them in lockstep.

Members share one compiled program, so they share the method of integration and every other structural
choice; only physical numbers differ between them.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, PartitionSpec

from esail_jax.ensembles.sampling import Inputs
from esail_jax.observables.run_warning import STEP_ERRORS
from esail_jax.scenes.scene import Scene
from esail_jax.simulation.simulate import simulate_traced
from esail_jax.steppers.results import RESULTS


class MemberResult(NamedTuple):
    """The result of one member, or of several with `member` as first axis.

    rows: observables by name, time first; complete: true at the end time; steps: number of steps;
    step_errors: estimates in the order of `STEP_ERRORS`, zero for methods that control their error."""

    rows: dict[str, Any]
    complete: Any
    steps: Any
    step_errors: Any


def lower_members(
    scene: Scene, names: tuple[str, ...], inputs: Inputs, count: int | None
) -> jax.stages.Lowered:
    """The lowered program (member's number, its inputs) -> MemberResult with the named observables.

    inputs: of all members, for their shapes; count: members in lockstep, or None for one member."""
    leading = () if count is None else (count,)
    shapes = {key: jax.ShapeDtypeStruct((*leading, *x.shape[1:]), float) for key, x in inputs.items()}
    member = jax.ShapeDtypeStruct(leading, int)
    function = member_function(scene, names)
    return jax.jit(function if count is None else in_lockstep(function)).lower(member, shapes)


def member_function(scene: Scene, names: tuple[str, ...]) -> Callable:
    """The function (member's number, its inputs) -> MemberResult."""

    def simulate_member(member, inputs):
        run = simulate_traced(scene.replace(inputs))
        # The member's number makes the result depend on an argument, even if nothing is varied. Otherwise
        # the whole run would be a constant, computed while compiling.
        steps = run.stats["steps"] + 0 * member
        errors = run.stats.get("step_errors", jnp.zeros(len(STEP_ERRORS)))
        rows = {name: run[name] for name in names}
        return MemberResult(rows, run.result == RESULTS.successful, steps, errors)

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
