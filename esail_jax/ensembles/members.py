"""Ensembles in this process: one scene simulated for many sets of numbers."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from esail_jax.ensembles.ensemble import Ensemble, concatenate
from esail_jax.ensembles.member_runner import MemberRunner
from esail_jax.ensembles.sampling import Vary, checked_inputs, draw, select_members
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.own_terms import OWN_TERMS
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.simulation.arguments import check_max_steps


def simulate_members(
    scene: Scene | str | os.PathLike,
    inputs: Mapping[str, Any] | None = None,
    observables: Sequence[str] | None = None,
    batch: int | None = None,
    lockstep: bool | None = None,
    *,
    vary: Vary | None = None,
    members: int | None = None,
    seed: int = 0,
    sampling: str = "random",
    max_steps: int | None = None,
    terms: Any = None,
) -> Ensemble:
    """Simulates a scene once for every member, in this process.

    The members' numbers are given as `inputs` (arrays or lists by scene key, member first), or are drawn
    as by `draw`: `simulate_members(scene, vary={"tethers.length": Normal(10e3, 10, per_tether=True)},
    members=256, seed=1)`. observables: names to keep, all if None; batch: members in one call, lockstep:
    whether they run in lockstep (None: what suits the device); max_steps: bound of the steps of a
    member: one that needs more has failed, but the last block of steps (24 at most) is completed; terms:
    physics of your own (`physics.py`).

    Raises SceneError."""
    scene = load_scene(scene, None if terms is None else {OWN_TERMS: terms})
    if (inputs is None) == (vary is None and members is None):
        got = "neither is" if inputs is None else "both are"
        raise SceneError("inputs", "be given, or `vary` and `members`", got)
    if inputs is None:
        if members is None:
            raise SceneError("members", "be given with `vary`", "is missing")
        inputs = draw(scene, vary or {}, members, seed, sampling)
    else:
        inputs = checked_inputs(scene, inputs)
        members = len(next(iter(inputs.values())))
    check_max_steps(max_steps)
    run = MemberRunner(scene, inputs, observables, batch, lockstep, max_steps=max_steps)
    numbers = np.arange(members)
    batches = [numbers[first : first + run.batch] for first in range(0, members, run.batch)]
    return concatenate([run(batch, select_members(inputs, batch)) for batch in batches])
