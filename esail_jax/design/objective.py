"""The objective of a design as a function of numbers of its scene."""

import functools
import os
from collections.abc import Iterable, Mapping
from typing import Any

import jax
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Float, Scalar
from esail_jax.design import objectives
from esail_jax.ensembles.member_program import observable_shapes
from esail_jax.scenes.loading import read_scene
from esail_jax.scenes.overrides import check_overrides
from esail_jax.scenes.own_terms import OWN_TERMS
from esail_jax.scenes.rules import SceneError, is_traced, numbers_of
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.voltage import OWN_LAW
from esail_jax.simulation.simulate import simulate
from esail_jax.simulation.solution import RESULTS, Solution

KEPT = ("value", "law", "power_limit")
"""Keys of [voltage] that the reference run has, too."""


class Objective:
    """The weighted sum of objectives of a run, as a function of parameters: J(p).

        J(p) = sum_k w_k J_k(p) / J_k(reference)

    Parameters p are a dictionary of numbers or arrays by scene key, in the units of the scene; the key
    `voltage_law` takes a voltage law that a user wrote (`loads/own_law.py`). J is differentiable and may be
    compiled, so it can be handed to any optimiser: `jax.value_and_grad(objective)(p)`,
    `jax.jit(objective)`. The reference is the run with constant voltage, for which every J_k counts 1, but
    for limits (`objectives.LIMITS`). It is simulated when it is first needed, and then kept. An objective
    to be retained (`objectives.RETAINED`, the thrust) counts as in `objectives.weighted_sum`.

    scene: a sail with a voltage, as a `Scene`, a name or a path; weights: by name of an objective
    (`objectives.py`), or by a function of a `Solution` that gives a number to be made small; circumstances:
    arrays by scene key, whose first axis counts circumstances (winds, errors of lengths) over which J is
    averaged. terms: physics of your own (`physics.py`); under the key `terms` they may be parameters, too.

    Raises SceneError for names that do not exist and for a scene without voltage, and when it is called for
    an objective that is zero at constant voltage. A run that fails raises SimulationError, or gives NaN
    under a trace.
    """

    def __init__(
        self,
        scene: Scene | str | os.PathLike,
        weights: Mapping[str, float] | Mapping[objectives.Goal, float],
        circumstances: Mapping[str, Array | np.ndarray] | None = None,
        terms: Any = None,
    ):
        for name, weight in weights.items():
            if not isinstance(name, objectives.SceneGoal):
                objectives.function_of(name)
            number = numbers_of("weights", weight)
            if not is_traced(weight) and (number is None or number.shape or not np.isfinite(number)):
                raise SceneError("weights", "be finite numbers", f"has {weight!r}")
        # A file with `law = "python"` is a scene here: the law is among the parameters.
        added = {} if terms is None else {OWN_TERMS: terms}
        scene = scene.replace(added) if isinstance(scene, Scene) else read_scene(scene, added)
        check_voltage(scene)
        self.scene = scene
        self.weights: dict[objectives.Goal, float] = {name: x for name, x in weights.items()}
        self.circumstances = dict(circumstances or {})
        check_measurable(self.constant_voltage, weights)
        for goal in weights:
            if isinstance(goal, objectives.SceneGoal):
                goal.check(self.constant_voltage)

    def __call__(self, parameters: Mapping[str, Any]) -> Scalar:
        """J(p), the mean over the circumstances if there are any."""
        check_overrides("parameters", parameters, '{"voltage_law": law}')
        references = self.references
        if not self.circumstances:
            return self._of_one(parameters, {}, references)
        # One run after the other, each recomputed in the backward pass: see `problem.py`.
        one = jax.checkpoint(lambda pair: self._of_one(parameters, *pair))
        return lax.map(one, (self.circumstances, references)).mean()

    def _of_one(self, parameters, circumstance, references) -> Scalar:
        scene = self.scene.replace(dict(parameters) | circumstance)
        return objectives.weighted_sum(simulate(scene), self.weights, references, scene)

    def measure(self, run: Solution) -> dict[objectives.Goal, float]:
        """Values of the objectives of a run, by name."""
        values = objectives.values(run, tuple(self.weights))
        return {name: float(value) for name, value in values.items()}

    # ---- reference ------------------------------------------------------------------------------

    # Nothing in a reference is traced. `ensure_compile_time_eval` computes it at once, even if it is needed
    # for the first time while J is being traced.

    @functools.cached_property
    def reference_run(self) -> Solution:
        """The run with constant voltage."""
        with jax.ensure_compile_time_eval():
            return self.simulate_reference()

    @functools.cached_property
    def reference_values(self) -> dict[objectives.Goal, float]:
        """Values of the objectives of `reference_run`, by name."""
        with jax.ensure_compile_time_eval():
            return self.measure(self.reference_run)

    @functools.cached_property
    def references(
        self,
    ) -> dict[objectives.Goal, float] | dict[objectives.Goal, Float[np.ndarray, " circumstance"]]:
        """The values by which the objectives are divided, by name; 1 for limits.

        With circumstances, an objective to be made small is divided by its mean over all circumstances at
        constant voltage, one to be retained by its value in the same circumstance."""
        if not self.circumstances:
            return {name: objectives.reference_of(name, x) for name, x in self.reference_values.items()}
        count = len(next(iter(self.circumstances.values())))
        each = [{key: x[i] for key, x in self.circumstances.items()} for i in range(count)]
        with jax.ensure_compile_time_eval():
            measured = [self.measure(self.simulate_reference(circumstance)) for circumstance in each]
        references: dict[objectives.Goal, Float[np.ndarray, " circumstance"]] = {}
        for name in self.weights:
            values = np.array([one[name] for one in measured])
            if name in objectives.RETAINED:
                objectives.reference_of(name, values.min())
                references[name] = values
            else:
                references[name] = np.full(count, objectives.reference_of(name, values.mean()))
        return references

    def simulate_reference(self, circumstance: Mapping[str, Any] | None = None) -> Solution:
        """The run with constant voltage, within the power limit, in the scene or in one circumstance."""
        return simulate(self.constant_voltage, circumstance)

    @property
    def constant_voltage(self) -> Scene:
        """The scene with constant voltage."""
        law = {f"voltage.{x}": None for x in vars(self.scene.voltage) if x not in KEPT}
        return self.scene.replace(law | {"voltage.law": "constant", OWN_LAW: None})


def check_voltage(scene: Scene) -> None:
    """Raises SceneError unless a scene is a sail with a voltage."""
    if scene.chain is not None:
        raise SceneError("chain", "be left out of a design", "is given")
    if scene.voltage is None or (scene.voltage.value is None and scene.voltage.law == "python"):
        raise SceneError("voltage.value", "be given for a design", "is missing")


def check_measurable(scene: Scene, goals: Iterable[objectives.Goal]) -> None:
    """Raises SceneError for a named objective that a run of the scene cannot have, before anything is run.

    It is measured on rows that have the names and shapes of those of a run, and no meaning."""
    rows = {name: np.ones((2, *shape)) for name, shape in observable_shapes(scene).items()}
    time = np.array([0.0, scene.integrator.t_end])
    run = Solution(time, rows, RESULTS.successful, None, {}, scene=scene)
    jax.eval_shape(lambda: objectives.values(run, tuple(goal for goal in goals if isinstance(goal, str))))
