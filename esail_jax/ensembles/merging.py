"""Putting the pieces of an ensemble together: ensemble.h5, a run file with `member` as first axis."""

import math
import shutil
from pathlib import Path

import h5py
import numpy as np

from esail_jax.array_types import Int
from esail_jax.atomic_file import PART
from esail_jax.ensembles.ensemble_file import (
    COMPLETE,
    FAILED,
    MISSING,
    TEXT,
    Task,
    parts_of,
    pieces_in,
    status_of,
    write_identity,
)
from esail_jax.ensembles.member_program import observable_shapes, system_of
from esail_jax.files.hdf5 import (
    atomic_hdf5,
    create_observables,
    create_quantity,
    require_room,
    versions,
)
from esail_jax.files.opening import SCHEMA_VERSION, WHOLE
from esail_jax.observables import listed
from esail_jax.scenes.method_choice import accuracy_of, with_method
from esail_jax.simulation.schedule import save_times


def merge_pieces(folder: Path, task: Task) -> tuple[str, str]:
    """Writes ensemble.h5 from its earlier version and the pieces, and removes the pieces.

    Returns status and message of the ensemble. Raises NoSpaceError if the disk is full; the pieces then
    stay."""
    whole, pieces = folder / WHOLE, pieces_in(folder)
    require_room(whole, size_of(task))
    with atomic_hdf5(whole, unique=True) as file:
        create(file, task)
        sources = ([whole] if whole.exists() else []) + pieces
        for path in sources:
            with h5py.File(path) as source:
                copy_members(file, source)
        status, message = summary(file)
        file.attrs.update({"status": status, "message": message})
    shutil.rmtree(parts_of(folder))
    for left in folder.glob(f"{WHOLE}.*{PART}"):  # by a process that was killed while it merged
        left.unlink()
    return status, message


def size_of(task: Task) -> int:
    """About the size of ensemble.h5 [B]: 8 bytes a number, and room for texts."""
    instants = len(save_times(task.scene.integrator.t_end, task.scene.output.interval))
    shapes = observable_shapes(task.scene)
    columns = sum(math.prod(shapes[name]) for name in task.observables)
    drawn = sum(values[0].size for values in task.inputs.values())
    return task.count * (8 * (instants * columns + drawn) + TEXT_BYTES) + HEAD_BYTES


TEXT_BYTES, HEAD_BYTES = 100, 2**16
"""Room for status and message of a member, and for scene, attributes and the structure of HDF5 [B]."""


def create(file: h5py.File, task: Task) -> None:
    """Fills a new ensemble.h5 with everything but results. It is a run file with `member` as first axis."""
    system = system_of(task.scene)
    write_identity(file, task)
    file.attrs.update(versions() | {"schema_version": SCHEMA_VERSION, "device": ""})
    method = with_method(task.scene).integrator
    file.attrs.update({"method": method.method, "accuracy": accuracy_of(method)})
    file.attrs.update({"members": task.count, "steps": 0, "wall_time": 0.0, "compile_time": 0.0})
    for key, values in task.inputs.items():
        data = file.create_dataset(f"inputs/{key}", data=values)
        data.attrs["axes"] = ["member", task.scene.members.name][: values.ndim]
    times = save_times(task.scene.integrator.t_end, task.scene.output.interval)
    create_quantity(file, "time", times.shape, ["time"], "s", "t")[:] = times
    wanted = [entry for entry in listed(system) if entry.name in task.observables]
    leading = {"member": task.count, "time": len(times)}
    create_observables(file, wanted, task.scene.sizes, leading)
    create_quantity(file, "numerics/steps", (task.count,), ["member"], "-", "steps")
    file["numerics"].attrs["terms"] = list(system.terms)
    file.create_dataset("members/status", data=[MISSING] * task.count, dtype=TEXT)
    file.create_dataset("members/message", data=[""] * task.count, dtype=TEXT)


def copy_members(file: h5py.File, source: h5py.File) -> None:
    """Copies the members of a piece, or of an earlier ensemble.h5, to a new ensemble.h5."""
    status, messages, steps = status_of(source)
    if "member" in source:
        members, rows = source["member"][()], np.arange(len(status))
    else:
        rows = members = np.flatnonzero(source["members/status"].asstr()[()] != MISSING)
    if not len(members):
        return
    file["members/status"][members] = status
    file["members/message"][members] = messages
    file["numerics/steps"][members] = steps
    for name, data in source["observables"].items():
        for row, member in zip(rows, members, strict=True):
            file["observables"][name][member] = data[row]
    for name in ("compile_time", "wall_time"):
        file.attrs[name] += source.attrs[name]
    file.attrs["steps"] += int(np.nansum(steps))
    file.attrs["device"] = source.attrs["device"]


def summary(file: h5py.File) -> tuple[str, str]:
    """Status and message of an ensemble, from the status of its members."""
    status = file["members/status"].asstr()[()]
    failed, missing = (np.flatnonzero(status == name) for name in (FAILED, MISSING))
    texts = file["members/message"].asstr()[()]
    warned = np.flatnonzero((status == COMPLETE) & (texts != ""))
    parts = [
        f"{len(members)} of {len(status)} members {what} ({some(members)})"
        for members, what in ((missing, "are missing"), (failed, "failed"), (warned, "have a warning"))
        if len(members)
    ]
    return "interrupted" if len(missing) else "complete", "; ".join(parts)


def some(members: Int[np.ndarray, " member"]) -> str:
    """The first five numbers of a list, as text."""
    first = ", ".join(str(member) for member in members[:5])
    return first + (", ..." if len(members) > 5 else "")
