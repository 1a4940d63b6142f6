"""Gradient-based design: an objective of a run, minimised over numbers of its scene.

The run is one differentiable program (`simulate` under a trace). Several starts, and several
circumstances that a robust design has to cope with (winds, errors of lengths), run one after the other:
batched by vmap, the derivative of every run would compute as many steps as a run may have at most.
"""

import dataclasses
import os
from collections.abc import Iterator, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Float, Scalar
from esail_jax.compilation.jit import jit
from esail_jax.design.objective import Objective
from esail_jax.design.objectives import Goal
from esail_jax.design.optimiser import Optimiser, State
from esail_jax.scenes.scene import Scene
from esail_jax.simulation.solution import Solution


@dataclasses.dataclass(frozen=True)
class Variable:
    """A number of a scene, or an array of numbers, that a design may choose.

    start: first value; scale: typical change of the value; lower, upper: bounds that hold by
    construction, one for all numbers or one for each (None: no bounds). A number whose bounds are equal
    stays constant."""

    start: Any
    scale: float = 1.0
    lower: Any = None
    upper: Any = None


class Design:
    """A design problem: objectives of a scene's run, minimised over some of its numbers.

    scene: a sail with a voltage, as a `Scene`, a name or a path; weights: by name of an objective
    (`objectives.py`), or by a function of a `Solution`; variables: by scene key; circumstances: arrays by
    scene key, one entry per circumstance, over which the objective is averaged; method: "lbfgs" or "adam";
    rate: step of Adam.

    Nothing is simulated before it is needed. Raises SceneError for names that do not exist.
    """

    def __init__(
        self,
        scene: Scene | str | os.PathLike,
        weights: Mapping[str, float] | Mapping[Goal, float],
        variables: Mapping[str, Variable],
        circumstances: Mapping[str, Array | np.ndarray] | None = None,
        method: str = "lbfgs",
        rate: float = 0.05,
    ):
        self.objective = Objective(scene, weights, circumstances)
        self.scene, self.variables = self.objective.scene, dict(variables)
        each = jax.value_and_grad(self.objective_at)
        evaluate = jit(lambda x: lax.map(each, x))
        self.optimiser = Optimiser(evaluate, method, rate)

    @property
    def reference_run(self) -> Solution:
        """The run with constant voltage, with which objectives are compared."""
        return self.objective.reference_run

    # ---- variables ------------------------------------------------------------------------------

    @property
    def start(self) -> Float[np.ndarray, " variable"]:
        """Coordinates of the start: the variables in their scales, in one vector."""
        return np.concatenate([np.ravel(coordinate_of_start(v)) for v in self.variables.values()])

    def parameters_at(self, x: Float[Array | np.ndarray, " variable"]) -> dict[str, Any]:
        """The variables at coordinates x, by scene key, in the units of the scene."""
        parameters, first = {}, 0
        for key, variable in self.variables.items():
            shape = np.shape(variable.start)
            size = int(np.prod(shape, dtype=int))
            parameters[key] = value_of(variable, x[first : first + size].reshape(shape))
            first += size
        return parameters

    def scene_at(self, x: Float[Array | np.ndarray, " variable"]) -> Scene:
        """The scene with the variables at coordinates x."""
        return self.scene.replace({key: np.asarray(x).tolist() for key, x in self.parameters_at(x).items()})

    def objective_at(self, x: Float[Array | np.ndarray, " variable"]) -> Scalar:
        """The objective at coordinates x."""
        return self.objective(self.parameters_at(x))

    # ---- optimisation ---------------------------------------------------------------------------

    def optimise(
        self,
        iterations: int,
        state: State | None = None,
        *,
        starts: int = 1,
        seed: int = 0,
        spread: float = 0.1,
    ) -> Iterator[State]:
        """Yields the state after every iteration, until iteration number `iterations` or until no start
        moves.

        state: where to continue. Without it the optimisation begins, and the first state that is yielded
        is that before the first iteration: at the variables' start and, for `starts` > 1, at starts
        normally distributed about it, with standard deviation `spread` in the variables' scales."""
        if state is None:
            x = np.tile(self.start, (starts, 1))
            x[1:] += spread * np.random.default_rng(seed).normal(size=x[1:].shape)
            state = self.optimiser.init(x)
            yield state
        while state.iteration < iterations:
            before, state = state, self.optimiser.step(state)
            if not bool((state.x != before.x).any()):
                return
            yield state


def value_of(
    variable: Variable, x: Float[Array | np.ndarray, "*some"]
) -> Float[Array | np.ndarray, "*some"]:
    """Value of a variable at coordinate x: scale x without bounds; with bounds, middle + half width
    sin(scale x / half width)."""
    if variable.lower is None or variable.upper is None:
        return variable.scale * x
    middle, half = middle_and_half_width(variable)
    return middle + half * jnp.sin(variable.scale * x / np.where(half == 0.0, 1.0, half))


def coordinate_of_start(variable: Variable) -> Float[np.ndarray, "*some"]:
    """Coordinate at which a variable has its start value."""
    start = np.asarray(variable.start, float)
    if variable.lower is None or variable.upper is None:
        return start / variable.scale
    middle, half = middle_and_half_width(variable)
    part = (start - middle) / np.where(half == 0.0, 1.0, half)
    return np.arcsin(np.clip(part, -1.0, 1.0)) * half / variable.scale


def middle_and_half_width(
    variable: Variable,
) -> tuple[Float[np.ndarray, "*some"], Float[np.ndarray, "*some"]]:
    """Middle and half width of a variable's bounds."""
    lower, upper = np.asarray(variable.lower, float), np.asarray(variable.upper, float)
    return np.asarray(0.5 * (upper + lower)), np.asarray(0.5 * (upper - lower))
