"""The state of a run in its file: the checkpoint from which it goes on, and its last saved instant."""

import h5py
import jax.numpy as jnp
import numpy as np

from esail_jax.coordinates import Coordinates
from esail_jax.environment.kepler_orbit import KeplerOrbit
from esail_jax.simulation.rectification import AnyPoint, PointOnOrbit
from esail_jax.simulation.restoring import paths
from esail_jax.simulation.results import Checkpoint
from esail_jax.simulation.statistics import Pending
from esail_jax.steppers.stepper import Point
from esail_jax.system import Power


def save_checkpoint(file: h5py.File, checkpoint: Checkpoint) -> None:
    """Writes /state: the arrays of the motion and of what the run carries along by path, and what belongs
    to them."""
    if "state" in file:
        del file["state"]
    group = file.create_group("state")
    arrays = checkpoint.motion if isinstance(checkpoint.motion, dict) else paths(checkpoint.motion)
    for name, leaf in arrays.items():
        group[f"motion/{name}"] = np.asarray(leaf)
    carried = checkpoint.carried if isinstance(checkpoint.carried, dict) else paths(checkpoint.carried)
    for name, leaf in carried.items():
        group[f"carried/{name}"] = np.asarray(leaf)
    group["pending"] = checkpoint.pending.table
    group["energy"] = np.array(checkpoint.energy)
    group.attrs.update({"rows": checkpoint.rows, "segment": checkpoint.segment})


def load_checkpoint(file: h5py.File) -> Checkpoint:
    """The checkpoint of a run file. Its motion is a mapping of arrays by path, which
    `simulation.restoring.restored` reads."""
    group = file["state"]
    motion = arrays_of(group["motion"])
    carried = arrays_of(group["carried"]) if "carried" in group else {}
    rows, segment = (int(group.attrs[name]) for name in ("rows", "segment"))
    start, largest = (float(x) for x in group["energy"][()])
    return Checkpoint(motion, rows, segment, Pending(group["pending"][()]), (start, largest), carried)


def arrays_of(group: h5py.Group) -> dict[str, np.ndarray]:
    """The arrays in a group and its groups, by path."""
    arrays = {}

    def visit(name, data):
        if isinstance(data, h5py.Dataset):
            arrays[name] = np.asarray(data[()])

    group.visititems(visit)
    return arrays


def save_point(file: h5py.File, point: AnyPoint) -> None:
    """Writes /final: the last saved instant, from which another run may start."""
    if "final" in file:
        del file["final"]
    for name, leaf in paths(point).items():
        file[f"final/{name}"] = np.asarray(leaf)


def load_point(file: h5py.File) -> AnyPoint | None:
    """The last saved instant of a run file; None if it has none."""
    if "final" not in file:
        return None
    group = file["final"]

    def coordinates(name: str) -> Coordinates:
        parts = (group[name][x][()] if x in group[name] else None for x in ("hub", "ring", "reel"))
        return Coordinates(group[f"{name}/tether"][()], *parts)

    work = Power(**{name: group[f"work/{name}"][()] for name in Power._fields if f"work/{name}" in group})
    point = Point(group["time"][()], coordinates("q"), coordinates("v"), work, group["exact"][()])
    if "orbit" not in group:
        return point
    orbit = {name: jnp.asarray(x) for name, x in arrays_of(group["orbit"]).items()}
    return PointOnOrbit.of(point, KeplerOrbit(**orbit))
