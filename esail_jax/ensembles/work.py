"""What a process computes of an ensemble. The functions are called by the engine that the process belongs
to; they need nothing but their argument."""

import dataclasses
import functools
import json
import os
import platform
import time
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from esail_jax.cores import one_thread
from esail_jax.ensembles.member_runner import MemberRunner
from esail_jax.ensembles.pieces import Piece, PieceFile, new_path
from esail_jax.ensembles.reductions import reduced
from esail_jax.ensembles.sampling import Inputs
from esail_jax.scenes.loading import parse

LARGE_BYTES = 2**25
"""Results of one piece that are larger are written to the folder by the process that computed them, if it
sees the folder [B]. One of 32 MiB takes the driver a tenth of a second: 300 MB/s through the pipe of a
process, 370 MB/s from Dask, 450 MB/s to the disk, as measured on two cores."""


@dataclasses.dataclass(frozen=True)
class Program:
    """What all pieces of an ensemble have in common.

    identity: that of the ensemble, as JSON; shapes: of one member's inputs, by key; max_steps: largest
    number of steps of a member; driver: the process that hands out the pieces, by `this_process`."""

    identity: str
    shapes: tuple[tuple[str, tuple[int, ...]], ...]
    max_steps: int | None
    driver: tuple[str, int]

    @functools.cached_property
    def about(self) -> dict[str, Any]:
        """The identity of the ensemble."""
        return json.loads(self.identity)

    def names(self, key: str) -> tuple[str, ...]:
        """The names that the identity lists under a key."""
        return tuple(filter(None, self.about.get(key, "").split("\n")))


@dataclasses.dataclass(frozen=True)
class Work:
    """A piece that is to be computed.

    batch: most members in one call; folder: where large results may be written, if it holds the file
    `token`; serial: differs from one attempt to the next: Dask does not repeat what looks the same."""

    program: Program
    batch: int
    members: np.ndarray
    inputs: Inputs
    folder: str
    token: str
    serial: int


class Written(NamedTuple):
    """A piece that the process has written to the folder itself. members: their numbers."""

    members: np.ndarray


class Prepared(NamedTuple):
    """What a process says that has prepared the program. batch: most members that it computes in one call;
    lockstep: whether they run side by side in one program; seconds: that it took."""

    batch: int
    lockstep: bool
    seconds: float


def this_process() -> tuple[str, int]:
    """The machine and the number of this process."""
    return platform.node(), os.getpid()


@functools.lru_cache(maxsize=2)
def runner_of(program: Program, batch: int | None) -> MemberRunner:
    """The runner of an ensemble in this process, compiled. A process of an engine computes with one thread,
    unless the environment says otherwise. In that of the driver JAX may have begun with more of them, which
    its programs are kept for, and the environment is the user's."""
    if program.driver != this_process():
        one_thread()
    like = {key: np.empty((1, *shape)) for key, shape in program.shapes}
    runner = MemberRunner(
        parse(program.about["scene"], "scene"),
        like,
        program.names("observables"),
        batch,
        one_core=True,
        max_steps=program.max_steps,
        members=program.about["count"],
    )
    runner.compile()
    return runner


def prepare(program: Program, token: str, serial: int) -> Prepared:
    """Compiles the program, which is kept for the other processes, and tells how many members it computes
    in one call. token, serial: tell this request from others, as in `Work`."""
    began = time.perf_counter()
    runner = runner_of(program, None)
    return Prepared(runner.batch, runner.lockstep, time.perf_counter() - began)


def compute(work: Work) -> Piece | Written:
    """Computes a piece."""
    began = time.perf_counter()
    runner = runner_of(work.program, work.batch)
    compiled = time.perf_counter()
    found = runner(work.members, work.inputs)
    rows, reductions = found.observables, work.program.names("reduce")
    if reductions:
        rows = reduced(found.time, rows, reductions)
    seconds = (compiled - began, time.perf_counter() - compiled)
    device = jax.devices()[0].device_kind
    piece = Piece(found.members, found.complete, found.messages, found.steps, rows, seconds, device)
    size, folder = sum(x.nbytes for x in rows.values()), Path(work.folder)
    if size <= LARGE_BYTES or not (folder / work.token).exists():
        return piece
    with PieceFile(new_path(folder), work.program.about) as file:
        file.add(piece)
    return Written(piece.members)
