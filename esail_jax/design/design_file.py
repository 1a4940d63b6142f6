"""Files of designs: the states of an optimisation, iteration by iteration.

    /x, /value, /gradient     coordinates, objective and its gradient: iteration first, then start
    /memory/NUMBER            state of the optimiser after the last iteration

Attributes identify the design: scene, weights, method.
"""

from collections.abc import Mapping
from pathlib import Path

import h5py
import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.design.optimiser import Optimiser, State
from esail_jax.files.hdf5 import atomic_hdf5
from esail_jax.files.opening import RunFileError

COLUMNS = ("x", "value", "gradient")


def append_state(path: Path, state: State, identity: Mapping[str, str]) -> None:
    """Adds the state after an iteration to a file of a design, or makes the file."""
    columns = {name: np.asarray(getattr(state, name))[None] for name in COLUMNS}
    if path.exists():
        with h5py.File(path) as file:
            columns = {name: np.concatenate([file[name][:], new]) for name, new in columns.items()}
    with atomic_hdf5(path) as file:
        for name, column in columns.items():
            file[name] = column
        for i, leaf in enumerate(jax.tree.leaves(state.memory)):
            file[f"memory/{i}"] = np.asarray(leaf)
        file.attrs.update(identity)


def read_state(path: Path, optimiser: Optimiser, identity: Mapping[str, str]) -> State:
    """The last state in a file. Raises RunFileError if the file belongs to another design."""
    with h5py.File(path) as file:
        for name, own in identity.items():
            if file.attrs[name] != own:
                raise RunFileError(f"`{path}` must be of the same {name} to go on with, but is of another")
        x, value, gradient = (jnp.asarray(file[name][-1]) for name in COLUMNS)
        iteration = len(file["value"]) - 1
        leaves = [jnp.asarray(file[f"memory/{i}"][()]) for i in range(len(file["memory"]))]
    structure = jax.tree.structure(optimiser.init_memory(x))
    return State(iteration, x, value, gradient, jax.tree.unflatten(structure, leaves))


def read_history(path: Path) -> np.ndarray:
    """The objective in a file, (iteration, start)."""
    with h5py.File(path) as file:
        return file["value"][:]
