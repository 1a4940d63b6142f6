"""`esail design`: a design from the shell, its files, and going on with one.

The folder holds design.h5 (variables, objective and what the optimiser remembers, iteration by iteration),
designed.toml (the scene with the best variables), before.h5 and after.h5 (its runs); the command line
adds design.png.
"""

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.design import objectives
from esail_jax.design.problem import Design, State, Variable
from esail_jax.files.run_file import RunFileError, save
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene, to_toml
from esail_jax.simulation.simulate import Solution, simulate

WEIGHTS = {"mean-torque": 1.0, "thrust": 1.0}
"""Where none are given: nothing turns the spin axis in the mean, and 96 % of the thrust is kept."""

HARMONICS = 2
"""Of a scene with constant voltage."""

FREE = {
    "harmonic": {"cosine": 0.1, "sine": 0.1},
    "piecewise-linear": {"table": 0.1},
    "feedback": {"gain": 1.0},
    "on-off": {"on": 10.0, "rise_time": 10.0},
}
"""By law, what is chosen, and what counts as a change of one."""


def design_scene(
    scene: Scene,
    folder: Path,
    weights: Mapping[str, float],
    iterations: int,
    method: str,
    starts: int,
    seed: int,
    resume: bool,
    quiet: bool,
) -> tuple[Solution, Solution, np.ndarray]:
    """Design and save: the runs before and after, and the objective by iteration and start. Raises
    SceneError, RunFileError."""
    path = folder / "design.h5"
    if path.exists() and not resume:
        raise RunFileError(f"{path} must not exist (or ask for --resume), but does")
    scene = modulated(scene)
    problem = Design(scene, weights or WEIGHTS, variables_of(scene), method=method)
    identity = {"scene": to_toml(scene), "weights": repr(sorted(problem.weights.items())), "method": method}
    folder.mkdir(parents=True, exist_ok=True)
    if path.exists():
        state = read(path, problem, identity)
    else:
        state = problem.begin(starts, seed)
        append(path, state, identity)
    for after in problem.iterations(state, iterations):
        state = after
        append(path, state, identity)
        if not quiet and sys.stderr.isatty():
            print(f"iteration {state.iteration}: {float(state.value[state.best]):.6g}", file=sys.stderr)
    best = problem.designed(state.x[state.best])
    (folder / "designed.toml").write_text(to_toml(best), encoding="utf-8")
    before, after = problem.plain, simulate(best)
    save(before, folder / "before.h5", overwrite=True)
    save(after, folder / "after.h5", overwrite=True)
    if not quiet:
        for name, value in objectives.values(after, tuple(problem.weights)).items():
            print(f"{name:16s} {problem.before[name]:12.5g} -> {float(value):12.5g}")
    with h5py.File(path) as file:
        return before, after, file["value"][:]


def modulated(scene: Scene) -> Scene:
    """With a law that has something to choose."""
    if scene.voltage is None:
        raise SceneError("voltage.value", "be given for a design", "is missing")
    if scene.voltage.law == "constant":
        nothing = [0.0] * HARMONICS
        return scene.replace(
            {"voltage.law": "harmonic", "voltage.cosine": nothing, "voltage.sine": nothing}
        )
    if scene.voltage.law not in FREE:
        known = ", ".join(FREE)
        raise SceneError("voltage.law", f"be one of {known} for a design", f'is "{scene.voltage.law}"')
    return scene


def variables_of(scene: Scene) -> dict[str, Variable]:
    """What the scene's law leaves to choose. Tables stay between 0 and the maximum."""
    table, found = scene.voltage, {}
    for name, scale in FREE[table.law].items():
        start = getattr(table, name)
        limits: dict[str, Any] = {}
        if name == "table":
            top = 1.0 if table.maximum is None else float(table.maximum / np.max(table.value))
            limits = {"lower": 0.0, "upper": top}
        if start is not None:
            found[f"voltage.{name}"] = Variable(start, scale, **limits)
    return found


def append(path: Path, state: State, identity: Mapping[str, str]) -> None:
    """One more iteration in the file, which is replaced as a whole: it is small, and never half written."""
    columns = {name: np.asarray(getattr(state, name))[None] for name in ("x", "value", "gradient")}
    if path.exists():
        with h5py.File(path) as file:
            columns = {name: np.concatenate([file[name][:], new]) for name, new in columns.items()}
    scratch = path.with_suffix(".part")
    with h5py.File(scratch, "w") as file:
        for name, column in columns.items():
            file[name] = column
        for i, leaf in enumerate(jax.tree.leaves(state.memory)):
            file[f"memory/{i}"] = np.asarray(leaf)
        file.attrs.update(identity)
    os.replace(scratch, path)


def read(path: Path, problem: Design, identity: Mapping[str, str]) -> State:
    """The last state in a file. Raises RunFileError where it is of another design."""
    with h5py.File(path) as file:
        for name, value in identity.items():
            if file.attrs[name] != value:
                raise RunFileError(f"{path} must be of the same {name} to go on with, but is of another")
        x, value, gradient = (jnp.asarray(file[name][-1]) for name in ("x", "value", "gradient"))
        count = len(file["value"]) - 1
        leaves = [jnp.asarray(file[f"memory/{i}"][()]) for i in range(len(file["memory"]))]
    structure = jax.tree.structure(jax.vmap(problem.optimiser.init)(x))
    return State(count, x, value, gradient, jax.tree.unflatten(structure, leaves))
