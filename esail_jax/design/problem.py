"""Gradient-based design of voltages: an objective of a run made small over numbers of its scene.

The run is one differentiable program (`simulate` under a trace); optax chooses the direction of a step
(L-BFGS or Adam), the host its length. Several starts, and several circumstances that a robust design has
to cope with (winds, errors of lengths), are runs one after the other: batched by vmap, the derivative of
each would compute as many steps as a run may have at most.
"""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jax import lax

from esail_jax.array_types import Array, Float, Scalar
from esail_jax.compiler import jit
from esail_jax.design import objectives
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.simulation.simulate import Solution, simulate

Numbers = Float[Array | np.ndarray, "*some"]

METHODS = ("lbfgs", "adam")

ENOUGH, SHORTEN, TRIALS = 1e-4, 0.4, 8
"""Of the search along a direction: part of the promised decrease that will do, what a step too long is
shortened by, and how often."""

LONGEST = 0.3
"""Of a step in any variable, in its own scale: voltages answer far from linearly."""


@dataclasses.dataclass(frozen=True)
class Variable:
    """A number, or array of numbers, of a scene that may be chosen. start: where from; scale: what counts
    as a change of one; lower, upper: limits that hold by construction (None: none), one for all or one
    for each; where they are equal nothing is chosen."""

    start: Any
    scale: float = 1.0
    lower: Any = None
    upper: Any = None


@dataclasses.dataclass(frozen=True)
class State:
    """Of an optimisation after an iteration, start by start: variables x (in their scales), objective,
    gradient, and what optax remembers."""

    iteration: int
    x: Float[Array, "start variable"]
    value: Float[Array, " start"]
    gradient: Float[Array, "start variable"]
    memory: Any

    @property
    def best(self) -> int:
        """Number of the start with the smallest objective."""
        return int(np.nanargmin(np.asarray(self.value)))


class Design:
    """A design problem.

    scene: with a voltage law; weights: by name of an objective (`objectives.py`); variables: by scene
    key; circumstances: arrays by scene key, one entry for each, over which the objective is averaged.

    Raises SceneError for names that do not exist.
    """

    def __init__(
        self,
        scene: Scene,
        weights: Mapping[str, float],
        variables: Mapping[str, Variable],
        circumstances: Mapping[str, Array | np.ndarray] | None = None,
        method: str = "lbfgs",
        rate: float = 0.05,
    ):
        for name in weights:
            objectives.function_of(name)
        if method not in METHODS:
            raise SceneError("method", f"be one of {', '.join(METHODS)}", f"is {method!r}")
        self.scene, self.weights, self.variables = scene, dict(weights), dict(variables)
        self.circumstances = dict(circumstances or {})
        self.method = method
        self.optimiser = optax.scale_by_lbfgs() if method == "lbfgs" else optax.scale_by_adam()
        self.rate = 1.0 if method == "lbfgs" else rate
        self.plain = self.unmodulated()
        self.before = self.measured(self.plain)
        self.compared = self.before if not self.circumstances else self.before_each()
        each = jax.value_and_grad(self.objective)
        self._evaluate = jit(lambda x: lax.map(each, x))

    def measured(self, run: Solution) -> dict[str, float]:
        """The objectives of a run."""
        found = objectives.values(run, tuple(self.weights))
        return {name: float(value) for name, value in found.items()}

    def before_each(self) -> dict[str, Float[np.ndarray, " circumstance"]]:
        """What objectives are compared with, by circumstance: for those to be made small the mean over all
        circumstances with constant voltage, for what is to be kept the value in the same wind."""
        count = len(next(iter(self.circumstances.values())))
        each = [{key: x[i] for key, x in self.circumstances.items()} for i in range(count)]
        found = [self.measured(self.unmodulated(circumstance)) for circumstance in each]
        rows = {name: np.array([one[name] for one in found]) for name in self.weights}
        kept = objectives.KEPT
        return {name: x if name in kept else np.full(count, x.mean()) for name, x in rows.items()}

    def unmodulated(self, circumstance: Mapping[str, Any] | None = None) -> Solution:
        """The run with constant voltage that objectives are compared with."""
        law = {f"voltage.{x}": None for x in vars(self.scene.voltage) if x not in ("value", "law")}
        plain = self.scene.replace(law | {"voltage.law": "constant"})
        run = simulate(plain, circumstance)
        constant = np.broadcast_to(plain.voltage.value, (len(run.time), plain.tethers.count))
        return dataclasses.replace(run, rows=run.rows | {"voltage": np.asarray(constant)})

    # ---- variables ------------------------------------------------------------------------------

    @property
    def start(self) -> Float[np.ndarray, " variable"]:
        """Where the variables start, in their scales."""
        return np.concatenate([np.ravel(inward(v)) for v in self.variables.values()])

    def overrides(self, x: Float[Array | np.ndarray, " variable"]) -> dict[str, Any]:
        """Scene keys and values of the variables."""
        found, first = {}, 0
        for key, variable in self.variables.items():
            shape = np.shape(variable.start)
            size = int(np.prod(shape, dtype=int))
            found[key] = outward(variable, x[first : first + size].reshape(shape))
            first += size
        return found

    def designed(self, x: Float[Array | np.ndarray, " variable"]) -> Scene:
        """The scene with these variables."""
        return self.scene.replace({key: np.asarray(x).tolist() for key, x in self.overrides(x).items()})

    # ---- objective ------------------------------------------------------------------------------

    def objective(self, x: Float[Array | np.ndarray, " variable"]) -> Scalar:
        """J(x), 1 per weight without modulation, averaged over the circumstances."""

        def of_one(circumstance, before):
            run = simulate(self.scene, self.overrides(x) | circumstance)
            return objectives.of_run(run, self.weights, before)

        if not self.circumstances:
            return of_one({}, self.before)
        return lax.map(jax.checkpoint(lambda x: of_one(*x)), (self.circumstances, self.compared)).mean()

    # ---- iterations -----------------------------------------------------------------------------

    def begin(self, starts: int = 1, seed: int = 0, spread: float = 0.1) -> State:
        """Before the first iteration: from the given start, and from others about it."""
        x = np.tile(self.start, (starts, 1))
        x[1:] += spread * np.random.default_rng(seed).normal(size=x[1:].shape)
        x = jnp.asarray(x)
        value, gradient = self._evaluate(x)
        return State(0, x, value, gradient, jax.vmap(self.optimiser.init)(x))

    def iterations(self, state: State, count: int) -> Iterator[State]:
        """The states after each further iteration, until `count` of them or no start gets better."""
        while state.iteration < count:
            after = self.iterate(state)
            moved = bool((after.x != state.x).any())
            state = after
            if not moved:
                return
            yield state

    def iterate(self, state: State) -> State:
        """One iteration of every start: a direction, and along it a step that makes the objective smaller
        (Armijo); Adam takes steps as they are."""
        ask = jax.vmap(lambda g, m, x: self.optimiser.update(g, m, x))
        direction, memory = ask(state.gradient, state.memory, state.x)
        direction = -self.rate * direction
        largest = jnp.abs(direction).max(1, keepdims=True)
        direction = direction * jnp.minimum(1.0, LONGEST / jnp.maximum(largest, 1e-300))
        slope = (direction * state.gradient).sum(1)
        step = jnp.ones(len(state.x))
        x, value, gradient = state.x, state.value, state.gradient
        for _ in range(TRIALS):
            trial = state.x + step[:, None] * direction
            found, slopes = self._evaluate(trial)
            good = jnp.isfinite(found)
            if self.method == "lbfgs":
                good &= found <= state.value + ENOUGH * step * slope
            new = good & (x == state.x).all(1)
            x = jnp.where(new[:, None], trial, x)
            value, gradient = jnp.where(new, found, value), jnp.where(new[:, None], slopes, gradient)
            if bool(good.all()):
                break
            step = jnp.where(good, step, SHORTEN * step)
        return State(state.iteration + 1, x, value, gradient, memory)

    def run(
        self, count: int, starts: int = 1, seed: int = 0, each: Callable[[State], None] | None = None
    ) -> Sequence[State]:
        """All states of an optimisation; each: called after every iteration."""
        states = [self.begin(starts, seed)]
        for state in self.iterations(states[0], count):
            states.append(state)
            if each is not None:
                each(state)
        return states


def outward(
    variable: Variable, x: Float[Array | np.ndarray, "*some"]
) -> Float[Array | np.ndarray, "*some"]:
    """A variable's value from its coordinate: scale x, or between its limits by a sine."""
    if variable.lower is None or variable.upper is None:
        return variable.scale * x
    middle, half = between(variable)
    return middle + half * jnp.sin(variable.scale * x / np.where(half == 0.0, 1.0, half))


def inward(variable: Variable) -> Float[np.ndarray, "*some"]:
    """The coordinate of a variable's start."""
    start = np.asarray(variable.start, float)
    if variable.lower is None or variable.upper is None:
        return start / variable.scale
    middle, half = between(variable)
    part = (start - middle) / np.where(half == 0.0, 1.0, half)
    return np.arcsin(np.clip(part, -1.0, 1.0)) * half / variable.scale


def between(variable: Variable) -> tuple[Float[np.ndarray, "*some"], Float[np.ndarray, "*some"]]:
    """Middle and half width of a variable's limits."""
    lower, upper = np.asarray(variable.lower, float), np.asarray(variable.upper, float)
    return np.asarray(0.5 * (upper + lower)), np.asarray(0.5 * (upper - lower))
