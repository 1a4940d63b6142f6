"""`esail design`: a design, its files, and continuing it.

The folder holds design.h5 (the states of the optimisation, `design/design_file.py`), designed.toml (the
scene with the best variables), before.h5 and after.h5 (the runs with constant voltage and with the
design); the command line adds design.png.
"""

import dataclasses
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from esail_jax.commands.progress import Progress
from esail_jax.design.design_file import append_state, read_history, read_state
from esail_jax.design.law_variables import law_variables, with_free_law
from esail_jax.design.objectives import Goal, name_of
from esail_jax.design.optimiser import State
from esail_jax.design.problem import Design
from esail_jax.files.opening import DESIGN, RUNS_OF_DESIGN, RunFileError
from esail_jax.files.run_file import save
from esail_jax.identification.goal import NAME, Information
from esail_jax.identification.model import steps_with_room
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.toml_text import to_toml
from esail_jax.simulation.simulate import simulate
from esail_jax.simulation.solution import Solution

WEIGHTS: dict[Goal, float] = {"mean-torque": 1.0, "thrust": 1.0}
"""Weights if none are given: no mean torque that turns the spin axis, and 96 % of the thrust retained."""


@dataclasses.dataclass(frozen=True)
class Optimisation:
    """How a design is optimised: iterations, method ("lbfgs" or "adam"), number of starts, and the seed
    of all starts but the first."""

    iterations: int = 30
    method: str = "lbfgs"
    starts: int = 1
    seed: int = 0


def run_design(
    scene: Scene,
    folder: Path,
    weights: Mapping[Goal, float],
    how: Optimisation,
    resume: bool,
    quiet: bool,
) -> tuple[Solution, Solution, np.ndarray]:
    """Designs the voltages of a scene and writes the files. weights: by objective, WEIGHTS if empty.

    Returns the runs with constant voltage and with the design, and the objective, (iteration, start).
    Raises SceneError and RunFileError before anything is written, SimulationError if a run fails."""
    path = folder / DESIGN
    if path.exists() and not resume:
        raise RunFileError(f"`{path}` must not exist (or ask for --resume), but does")
    scene = with_free_law(scene)
    weights = weights or WEIGHTS
    design = Design(scene, weights, law_variables(scene), method=how.method)
    goals = sorted(weights.items(), key=lambda item: name_of(item[0]))
    identity = {"scene": to_toml(scene), "weights": repr(goals), "method": how.method}
    last = read_state(path, design.optimiser, identity) if path.exists() else None
    check_folder(folder)
    before, _ = design.reference_run, design.objective.references
    folder.mkdir(parents=True, exist_ok=True)

    def texts(*_: float) -> tuple[str, ...]:
        return () if last is None else (value_text(last),)

    progress = Progress(float(how.iterations), texts, quiet)
    for state in design.optimise(how.iterations, last, starts=how.starts, seed=how.seed):
        last = state
        append_state(path, state, identity)
        if state.iteration and progress.shown:
            print(value_text(state), file=sys.stderr)
        elif state.iteration:
            progress.update(float(state.iteration))
    assert last is not None  # a design begins with a state, or goes on from one
    after = save_design(design, last, folder)
    if not quiet:
        measured = design.objective.measure(after)
        value = float(last.value[last.best])
        if last.iteration < how.iterations:
            print("The design ends before its last iteration: no shorter step makes the objective smaller.")
        print(f"objective after {last.iteration} iterations: {value:.6g}. Its parts, in their own units:")
        print(f"{'':16s} {'constant':>12s}    {'designed':>12s}")
        for name, value in design.objective.reference_values.items():
            print(f"{name_of(name):16s} {value:12.5g} -> {measured[name]:12.5g}")
    return before, after, read_history(path)


def with_information(
    scene: Scene,
    weights: Mapping[str, float],
    free: Sequence[str],
    noise: Mapping[str, float],
    priors: Mapping[str, Any],
) -> dict[Goal, float]:
    """The weights with the objective of information in place of its name. Raises SceneError for parameters,
    noise and priors that do not suit the scene, before anything is run."""
    goals: dict[Goal, float] = {}
    for name, weight in weights.items():
        kind, _, key = name.partition(":")
        if kind != NAME:
            goals[name] = weight
            continue
        goal = Information(tuple(free), tuple(noise.items()), key or None, tuple(priors.items()))
        goal.check(scene)
        steps = steps_with_room(scene, goal.measured(scene).cells)
        goals[dataclasses.replace(goal, max_steps=steps)] = weight
    return goals


def value_text(state: State) -> str:
    """The number of an iteration and the objective of the best start."""
    return f"iteration {state.iteration}: {float(state.value[state.best]):.6g}"


def check_folder(folder: Path) -> None:
    """Raises RunFileError unless files can be made in a folder, which may not exist yet."""
    place = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not place.is_dir() or not os.access(place, os.W_OK):
        raise RunFileError(f"`-o` must be in a writable directory, but {place} is not")


def save_design(design: Design, state: State, folder: Path) -> Solution:
    """Writes designed.toml, before.h5 and after.h5. Returns the run with the design."""
    best = design.scene_at(state.x[state.best])
    (folder / "designed.toml").write_text(to_toml(best), encoding="utf-8")
    before, after = design.reference_run, simulate(best)
    for run, name in zip((before, after), RUNS_OF_DESIGN, strict=True):
        save(run, folder / name, overwrite=True)
    return after
