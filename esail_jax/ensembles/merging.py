"""Putting the pieces of an ensemble together: ensemble.h5, a run file with `member` as first axis.

Members are copied a piece at a time, so that the memory does not depend on their number."""

import itertools
import math
import shutil
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import h5py
import numpy as np

from esail_jax.atomic_file import PART
from esail_jax.ensembles.ensemble_file import COMPLETE, FAILED, MISSING, parts_of, status_of_pieces
from esail_jax.ensembles.member_program import observable_shapes, system_of
from esail_jax.ensembles.pieces import Piece, files_in, pieces_of
from esail_jax.ensembles.reductions import reduced_name
from esail_jax.ensembles.sampling import BLOCK
from esail_jax.ensembles.task import Task
from esail_jax.files.hdf5 import atomic_hdf5, create_observables, create_quantity, require_room, versions
from esail_jax.files.opening import SCHEMA_VERSION, WHOLE
from esail_jax.observables import listed
from esail_jax.scenes.method_choice import accuracy_of, with_method
from esail_jax.simulation.schedule import save_times

TEXT = h5py.string_dtype()

ROWS_BYTES = 2**26
"""Bytes of numbers that are copied at once, if there is more than one member."""


def merge_pieces(folder: Path, task: Task) -> tuple[str, str]:
    """Writes ensemble.h5 from its earlier version and the pieces, and removes the pieces.

    Returns status and message of the ensemble. Raises NoSpaceError if the disk is full; the pieces then
    stay."""
    whole = folder / WHOLE
    require_room(whole, size_of(task))
    with atomic_hdf5(whole, unique=True) as file:
        create(file, task)
        if whole.exists():
            with h5py.File(whole) as earlier:
                copy_pieces(file, held_by(earlier))
                for name in ("compile_time", "wall_time"):
                    file.attrs[name] += earlier.attrs[name]
                file.attrs["device"] = earlier.attrs["device"]
        copy_pieces(file, (piece for path in files_in(parts_of(folder)) for piece in pieces_of(path)))
        status, message = summary(file)
        file.attrs.update({"status": status, "message": message})
    shutil.rmtree(parts_of(folder), ignore_errors=True)
    for left in folder.glob(f"{WHOLE}.*{PART}"):  # by a process that was killed while it merged
        left.unlink()
    return status, message


def size_of(task: Task) -> int:
    """About the size of ensemble.h5 [B]: 8 bytes a number, and room for texts."""
    instants = len(task.reduce) or len(save_times(task.scene.integrator.t_end, task.scene.output.interval))
    shapes = observable_shapes(task.scene)
    columns = sum(math.prod(shapes[name]) for name in task.observables)
    return task.count * (8 * (instants * columns + task.draws.columns) + TEXT_BYTES) + HEAD_BYTES


TEXT_BYTES, HEAD_BYTES = 100, 2**16
"""Room for status and message of a member, and for scene, attributes and the structure of HDF5 [B]."""


def create(file: h5py.File, task: Task) -> None:
    """Fills a new ensemble.h5 with everything but results. It is a run file with `member` as first axis."""
    system = system_of(task.scene)
    file["scene"] = task.text
    file.attrs.update(task.identity)
    file.attrs.update(versions() | {"schema_version": SCHEMA_VERSION, "device": ""})
    method = with_method(task.scene).integrator
    file.attrs.update({"method": method.method, "accuracy": accuracy_of(method)})
    file.attrs.update({"members": task.count, "steps": 0, "wall_time": 0.0, "compile_time": 0.0})
    for first in range(0, task.count, BLOCK):
        members = np.arange(first, min(first + BLOCK, task.count))
        for key, values in task.draws.of(members).items():
            if not first:
                shape = (task.count, *values.shape[1:])
                data = file.create_dataset(f"inputs/{key}", shape, values.dtype)
                data.attrs["axes"] = ["member", task.scene.members.name][: values.ndim]
            file[f"inputs/{key}"][members[0] : members[-1] + 1] = values
    times = save_times(task.scene.integrator.t_end, task.scene.output.interval)
    create_quantity(file, "time", times.shape, ["time"], "s", "t")[:] = times
    wanted = [entry for entry in listed(system) if entry.name in task.observables]
    file.create_group("observables")
    if not task.reduce:
        leading = {"member": task.count, "time": len(times)}
        create_observables(file, wanted, task.scene.sizes, leading)
    shapes = observable_shapes(task.scene)
    for entry in wanted:
        for reduction in task.reduce:
            name, shape = reduced_name(entry.name, reduction), (task.count, *shapes[entry.name])
            axes = ("member", *entry.axes)
            create_quantity(file, f"reduced/{name}", shape, axes, entry.unit, entry.symbol, entry.equation)
    create_quantity(file, "numerics/steps", (task.count,), ["member"], "-", "steps")
    file["numerics"].attrs["terms"] = list(system.terms)
    for name, value in (("status", MISSING), ("message", "")):
        file.create_dataset(f"members/{name}", (task.count,), TEXT)
        for first in range(0, task.count, BLOCK):
            count = min(BLOCK, task.count - first)
            file[f"members/{name}"][first : first + count] = [value] * count


def held_by(earlier: h5py.File) -> Iterator[Piece]:
    """The members that an earlier ensemble.h5 holds, as pieces."""
    rows = {
        name: data for group in ("observables", "reduced") for name, data in earlier.get(group, {}).items()
    }
    most = max((8 * math.prod(data.shape[1:]) for data in rows.values()), default=1)
    size = int(np.clip(ROWS_BYTES // max(most, 1), 1, BLOCK))
    for first in range(0, len(earlier["members/status"]), size):
        part = slice(first, first + size)
        status = earlier["members/status"].asstr()[part]
        held = status != MISSING
        if held.any():
            yield Piece(
                first + np.flatnonzero(held),
                status[held] == COMPLETE,
                tuple(earlier["members/message"].asstr()[part][held]),
                earlier["numerics/steps"][part][held],
                {name: data[part][held] for name, data in rows.items()},
                (0.0, 0.0),
                "",
            )


def copy_pieces(file: h5py.File, pieces: Iterable[Piece]) -> None:
    """Copies the members of pieces to a new ensemble.h5: many at once, since small pieces would take longer
    to copy one by one than to compute."""
    together: list[Piece] = []
    size = members = 0
    for piece in pieces:
        size += sum(values.nbytes for values in piece.rows.values())
        members += len(piece.members)
        together.append(piece)
        if size > ROWS_BYTES or members > BLOCK:
            copy_members(file, together)
            together, size, members = [], 0, 0
    if together:
        copy_members(file, together)


def copy_members(file: h5py.File, pieces: Sequence[Piece]) -> None:
    """Copies the members of some pieces. Neighbours are written together."""
    members = np.concatenate([piece.members for piece in pieces])
    order = np.argsort(members, kind="stable")

    def column(parts: Iterable[np.ndarray]) -> np.ndarray:
        return np.concatenate(list(parts))[order]

    complete = column(piece.complete for piece in pieces)
    columns = {
        "members/status": np.where(complete, COMPLETE, FAILED).astype(object),
        "members/message": column(np.array(piece.messages, object) for piece in pieces),
        "numerics/steps": column(piece.steps for piece in pieces),
    }
    group = "reduced" if "reduced" in file else "observables"
    for name in pieces[0].rows:
        columns[f"{group}/{name}"] = column(piece.rows[name] for piece in pieces)
    members = members[order]
    ends = [0, *(np.flatnonzero(np.diff(members) != 1) + 1), len(members)]
    for first, last in itertools.pairwise(ends):
        for name, values in columns.items():
            file[name][members[first] : members[last - 1] + 1] = values[first:last]
    file.attrs["steps"] += int(np.nansum(columns["numerics/steps"]))
    file.attrs["compile_time"] += sum(piece.seconds[0] for piece in pieces)
    file.attrs["wall_time"] += sum(piece.seconds[1] for piece in pieces)
    file.attrs["device"] = pieces[-1].device


def summary(file: h5py.File) -> tuple[str, str]:
    """Status and message of an ensemble, from the status of its members."""
    total = len(file["members/status"])
    counts = dict.fromkeys(("are missing", "failed", "have a warning"), 0)
    first: dict[str, list[int]] = {what: [] for what in counts}
    for begin in range(0, total, BLOCK):
        status, texts = (
            file[f"members/{name}"].asstr()[begin : begin + BLOCK] for name in ("status", "message")
        )
        where = (status == MISSING, status == FAILED, (status == COMPLETE) & (texts != ""))
        for what, mask in zip(counts, where, strict=True):
            counts[what] += int(mask.sum())
            if len(first[what]) <= NAMED:
                first[what] += (begin + np.flatnonzero(mask)).tolist()
    parts = [
        f"{count} of {total} members {what} ({some(first[what])})"
        for what, count in counts.items()
        if count
    ]
    return "interrupted" if counts["are missing"] else "complete", "; ".join(parts)


def outcome_counts(folder: Path) -> tuple[int, int, int]:
    """Numbers of members that are computed, that failed, and that have a warning, in the pieces and in
    ensemble.h5."""
    done = failed = warned = 0
    whole, parts = folder / WHOLE, list(status_of_pieces(folder))
    if whole.exists():
        with h5py.File(whole) as file:
            parts.append(tuple(file[f"members/{name}"].asstr()[()] for name in ("status", "message")))
    for status, messages in parts:
        done += int((status != MISSING).sum())
        failed += int((status == FAILED).sum())
        warned += int(((status == COMPLETE) & (messages != "")).sum())
    return done, failed, warned


NAMED = 5
"""Number of members that are named in a message."""


def some(members: Sequence[int]) -> str:
    """The first numbers of a list, as text."""
    first = ", ".join(str(member) for member in members[:NAMED])
    return first + (", ..." if len(members) > NAMED else "")
