"""An ensemble to be computed, and the parts of it that are handed to other processes."""

import dataclasses
import os
from collections.abc import Sequence
from typing import Any

from esail_jax.ensembles.member_program import observable_shapes, select_observables
from esail_jax.ensembles.reductions import Reduction, names_of
from esail_jax.ensembles.sampling import Draws, Vary, draws_of
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.toml_text import to_toml
from esail_jax.simulation.arguments import check_max_steps


@dataclasses.dataclass(frozen=True)
class Task:
    """An ensemble to be computed.

    text: the scene as TOML; draws: the inputs of its members; observables: names to keep; max_steps:
    largest number of steps of a member, which may change when the ensemble is resumed; reduce: names of the
    reductions that take the place of histories, or none."""

    scene: Scene
    text: str
    draws: Draws
    observables: tuple[str, ...]
    max_steps: int | None = None
    reduce: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        """Number of members."""
        return self.draws.count

    @property
    def vary(self) -> tuple[str, ...]:
        """The variations, as on the command line."""
        return tuple(variation.text for variation in self.draws.variations)

    @property
    def identity(self) -> dict[str, Any]:
        """Attributes that, with the scene, identify the ensemble a file belongs to."""
        # The points of a Latin hypercube depend on the number of members.
        latin = self.draws.sampling == "latin"
        found = {
            "vary": "\n".join(self.vary),
            "sampling": f"latin of {self.count}" if latin else self.draws.sampling,
            "seed": self.draws.seed,
            "observables": "\n".join(self.observables),
        }
        return found | ({"reduce": "\n".join(self.reduce)} if self.reduce else {})


def about(task: Task) -> dict[str, Any]:
    """What files of pieces say of their ensemble."""
    return {"scene": task.text, "count": task.count, **task.identity}


def task_of(
    scene: Scene | str | os.PathLike,
    members: int,
    vary: Vary,
    seed: int = 0,
    sampling: str = "random",
    observables: Sequence[str] | None = None,
    max_steps: int | None = None,
    reduce: Sequence[str | Reduction] = (),
) -> Task:
    """The task of these arguments. Raises SceneError, VariationError."""
    for name, value in (("observables", observables), ("reduce", reduce)):
        if name == "observables" and value is None:
            continue
        if not isinstance(value, list | tuple):
            raise SceneError(name, "be a list of names", f"is {value!r}")
    scene = load_scene(scene)
    if scene.terms or scene.voltage_law is not None:
        own = "a voltage law" if scene.voltage_law is not None else "terms"
        must = "be one that a file can hold, for other processes"
        raise SceneError("scene", must, f"has {own} of your own (`simulate_members` computes it)")
    check_max_steps(max_steps)
    draws = draws_of(scene, vary, members, seed, sampling)
    names = select_observables(observable_shapes(scene), observables)
    return Task(scene, to_toml(scene), draws, names, max_steps, names_of(reduce))
