"""`esail ensemble --distributed`: one of many processes that a cluster has started.

JAX's distributed runtime numbers the processes; they exchange only the message that the task is there. From
then on they are independent: if one ends, even the first, the others go on. All of them share the lock on
the folder. Who has no more pieces waits until all others have ended, in whatever way; the first to find
that puts the pieces together and reports, and all end with the same exit code.
"""

import time
from collections.abc import Callable
from pathlib import Path

import h5py
import jax
import numpy as np
from jax.experimental import multihost_utils

from esail_jax.commands.command_line import ExitCode, UsageError
from esail_jax.commands.ensemble_here import check_folder, publish_pieces, report, still_missing
from esail_jax.commands.ensemble_work import Work, end_process, wait_for
from esail_jax.commands.progress import Interrupts
from esail_jax.ensembles.ensemble_file import (
    Task,
    computed_members,
    parts_of,
    try_claim,
)
from esail_jax.ensembles.merging import merge_pieces
from esail_jax.files.locks import FolderLock
from esail_jax.files.opening import WHOLE, RunFileError

COMPUTE, NOTHING_TO_DO, REFUSED = 0, 1, 2
"""Messages from the first of many processes to the others."""

WAIT_SECONDS = 0.5
"""Time between two looks at whether the other processes have ended [s]."""


def join_cluster(coordinator: str | None, processes: int | None, process: int | None) -> None:
    """Makes this process one of many. JAX recognises SLURM, Open MPI and Kubernetes by itself.

    coordinator: address of process 0, with a port; processes: their number; process: the number of this
    one. Raises UsageError if the others are not found."""
    try:
        jax.distributed.initialize(coordinator, processes, process)
    except (ValueError, RuntimeError) as error:
        raise UsageError(f"`--distributed` must find the other processes, but does not: {error}") from None


def run_distributed(task: Task, folder: Path, resume: bool, quiet: bool) -> ExitCode:
    """Computes this process's part of an ensemble that many processes compute. Returns the exit code.

    `join_cluster` comes first. All processes must see the folder. If a process is killed, the members of
    its current piece are missing; a later call computes them.

    Raises RunFileError in the first process before anything is written."""
    error, state, lock = None, COMPUTE, None
    if jax.process_index() == 0:
        try:
            check_folder(folder)
            lock = FolderLock(folder)
            missing = still_missing(task, folder, resume)
            if missing is None:
                state = NOTHING_TO_DO
            else:
                publish_pieces(task, folder, missing, jax.process_count())
                lock.share()
        except (RunFileError, OSError) as refusal:
            error, state = refusal, REFUSED
        if lock is not None and state != COMPUTE:
            lock.release()
    state = int(multihost_utils.broadcast_one_to_all(np.array(state)))
    if state == COMPUTE:
        lock = lock or FolderLock(folder, shared=True)
        multihost_utils.sync_global_devices("all processes hold the lock")
    jax.distributed.shutdown()
    if error is not None:
        raise error
    if lock is None or state != COMPUTE:
        return ExitCode.DONE if state == NOTHING_TO_DO else ExitCode.BAD_INPUT
    with Interrupts() as interrupts:
        finished = wait_for(Work(folder, lambda: interrupts.asked), stop=lambda: interrupts.asked)
        code = end_together(task, folder, lock, lambda: interrupts.asked, quiet)
    if not finished:
        end_process(code)
    return code


def end_together(
    task: Task, folder: Path, lock: FolderLock, stop: Callable[[], bool], quiet: bool
) -> ExitCode:
    """Waits until the other processes have ended, unless `stop()`. Puts the pieces together and reports, if
    no other process has. Returns the exit code."""
    while not lock.try_alone():
        if stop():
            lock.release(remove=False)
            return ExitCode.INTERRUPTED
        time.sleep(WAIT_SECONDS)
    try:
        if not lock.works:  # whether the others have ended is not known
            complete = len(computed_members(folder, task)[0]) == task.count
            return finish(task, folder, quiet) if complete and try_claim(folder, "merge") else ExitCode.DONE
        if parts_of(folder).exists():
            return finish(task, folder, quiet)
        with h5py.File(folder / WHOLE) as file:
            return ExitCode.DONE if file.attrs["status"] == "complete" else ExitCode.INTERRUPTED
    finally:
        lock.release(remove=lock.works)


def finish(task: Task, folder: Path, quiet: bool) -> ExitCode:
    """Puts the pieces together and reports."""
    return report(folder, *merge_pieces(folder, task), quiet)
