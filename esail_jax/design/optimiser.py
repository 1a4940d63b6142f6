"""Descent by L-BFGS or Adam, of several starts side by side.

optax computes the direction of a step. The host chooses its length, so that an iteration can be saved and
continued.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax

from esail_jax.array_types import Array, Float
from esail_jax.scenes.rules import SceneError

METHODS = ("lbfgs", "adam")

ARMIJO = 1e-4
"""Part of the decrease that the gradient predicts, which an accepted step must reach."""

BACKTRACK = 0.4
"""Factor by which a rejected step is shortened."""

MAX_BACKTRACKS = 8
"""Largest number of step lengths that one iteration tries."""

MAX_MOVE = 0.3
"""Longest step in any coordinate, in its own scale. Runs depend on voltages far from linearly."""


@dataclasses.dataclass(frozen=True)
class State:
    """State of an optimisation after an iteration, `start` first.

    x: coordinates (variables in their scales); value: objective; gradient: its derivatives by x; memory:
    the state of optax's optimiser."""

    iteration: int
    x: Float[Array, "start variable"]
    value: Float[Array, " start"]
    gradient: Float[Array, "start variable"]
    memory: Any

    @property
    def best(self) -> int:
        """Number of the start with the smallest objective."""
        value = np.asarray(self.value)
        return int(np.argmin(np.where(np.isnan(value), np.inf, value)))


class Optimiser:
    """Minimises a function of coordinates.

    evaluate(x): values (start) and gradients (start, variable) at x (start, variable); method: of
    `METHODS`; rate: step of Adam. Raises SceneError for another method."""

    def __init__(self, evaluate: Callable, method: str = "lbfgs", rate: float = 0.05):
        if method not in METHODS:
            raise SceneError("method", f"be one of {', '.join(METHODS)}", f"is {method!r}")
        self.evaluate, self.method = evaluate, method
        self.transform = optax.scale_by_lbfgs() if method == "lbfgs" else optax.scale_by_adam()
        self.rate = 1.0 if method == "lbfgs" else rate

    def init(self, x: Float[Array | np.ndarray, "start variable"]) -> State:
        """The state before the first iteration."""
        x = jnp.asarray(x)
        value, gradient = self.evaluate(x)
        return State(0, x, value, gradient, self.init_memory(x))

    def init_memory(self, x: Float[Array, "start variable"]) -> Any:
        """The state of optax's optimiser before the first iteration."""
        return jax.vmap(self.transform.init)(x)

    def step(self, state: State) -> State:
        """One iteration of every start: a direction and, for L-BFGS, a step along it that satisfies
        Armijo's condition J(x + s d) <= J(x) + ARMIJO s d . J'(x). Adam takes its full step. Both shorten
        a step to where J or its gradient is not finite: from there no direction leads on."""
        update = jax.vmap(lambda g, m, x: self.transform.update(g, m, x))
        direction, memory = update(state.gradient, state.memory, state.x)
        direction = -self.rate * direction
        largest = jnp.abs(direction).max(1, keepdims=True)
        direction = direction * jnp.minimum(1.0, MAX_MOVE / jnp.maximum(largest, 1e-300))
        slope = (direction * state.gradient).sum(1)
        length = jnp.ones(len(state.x))
        x, value, gradient = state.x, state.value, state.gradient
        for _ in range(MAX_BACKTRACKS):
            trial = state.x + length[:, None] * direction
            trial_value, trial_gradient = self.evaluate(trial)
            good = jnp.isfinite(trial_value) & jnp.isfinite(trial_gradient).all(1)
            if self.method == "lbfgs":
                good &= trial_value <= state.value + ARMIJO * length * slope
            new = good & (x == state.x).all(1)
            x = jnp.where(new[:, None], trial, x)
            value = jnp.where(new, trial_value, value)
            gradient = jnp.where(new[:, None], trial_gradient, gradient)
            if bool(good.all()):
                break
            length = jnp.where(good, length, BACKTRACK * length)
        return State(state.iteration + 1, x, value, gradient, memory)
