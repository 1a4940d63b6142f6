"""`esail ensemble`: an ensemble computed by several processes.

All processes do the same: they take a piece of the task that no other process has taken, compute it, and
write it to the folder. On one machine this process starts the others. On a cluster the cluster starts all
processes, and JAX's distributed runtime numbers them; they exchange only the message that the task is
there.
"""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import jax
import numpy as np
from jax.experimental import multihost_utils

from esail_jax.commands.exit_codes import ExitCode
from esail_jax.commands.interrupts import Interrupts
from esail_jax.commands.progress import Progress
from esail_jax.cores import cores
from esail_jax.ensembles.ensemble_file import (
    WHOLE,
    Task,
    computed_members,
    merge_pieces,
    parts_of,
    pieces_in,
    publish,
    read_task,
    take_pieces,
    try_claim,
    write_piece,
)
from esail_jax.ensembles.member_program import observable_shapes, select_observables
from esail_jax.ensembles.member_runner import MemberRunner
from esail_jax.ensembles.sampling import Vary, draw, variations_of
from esail_jax.files.opening import RunFileError
from esail_jax.scenes.scene import Scene

PIECES_PER_PROCESS = 4
"""Least number of pieces per process, if there are enough members. Fast processes then take more pieces."""

COMPUTE, NOTHING_TO_DO, REFUSED = 0, 1, 2
"""Messages from the first of many processes to the others."""


def task_of(
    scene: Scene,
    members: int,
    vary: Vary,
    seed: int,
    sampling: str,
    observables: Sequence[str] | None,
) -> Task:
    """The task, with the inputs of all members drawn. Raises SceneError, VariationError."""
    inputs = draw(scene, vary, members, seed, sampling)
    texts = tuple(variation.text for variation in variations_of(vary))
    names = select_observables(observable_shapes(scene), observables)
    return Task(scene, members, inputs, texts, sampling, seed, names)


def run_here(task: Task, folder: Path, processes: int | None, resume: bool, quiet: bool) -> ExitCode:
    """Computes an ensemble on this machine. Returns the exit code.

    processes: their number; None is one per core, or one in all if JAX's devices are no CPUs.

    Raises RunFileError before anything is written."""
    missing = still_missing(task, folder, resume)
    if missing is None:
        return ExitCode.DONE
    if processes is None:
        processes = cores() if jax.default_backend() == "cpu" else 1
    pieces = publish_pieces(task, folder, missing, processes)
    progress, before = Progress(float(len(missing)), progress_texts, quiet), len(pieces_in(folder))

    def show() -> None:
        if progress.due:
            progress.update(len(missing) * (len(pieces_in(folder)) - before) / len(pieces))

    others = [start_worker(folder) for _ in range(min(processes, len(pieces)) - 1)]
    try:
        with Interrupts() as interrupts:
            work(folder, lambda: interrupts.asked, show)
            wait_for(others, lambda: interrupts.asked, show)
    finally:
        progress.close()
        for worker in others:
            worker.kill()
    return report(*merge_pieces(folder, task), quiet)


def progress_texts(_: float, speed: float) -> tuple[str]:
    """Returns the text beside the progress bar."""
    return (f"{speed:.3g} members a second",)


def wait_for(others: list[subprocess.Popen], stop: Callable[[], bool], each: Callable[[], None]) -> None:
    """Waits until other processes have ended. Once `stop()` is true, tells each of them to end after its
    piece; calls `each()` all the time."""
    told = False
    while any(other.poll() is None for other in others):
        if stop() and not told:
            told = True
            for other in others:
                other.send_signal(signal.SIGTERM)
        each()
        time.sleep(0.05)


def run_distributed(task: Task, folder: Path, resume: bool, quiet: bool) -> ExitCode:
    """Computes this process's part of an ensemble that many processes compute. Returns the exit code.

    `jax.distributed.initialize` comes first. All processes must see the folder. If a process is killed,
    only the members of its current piece are lost. The last process to end merges the pieces; if some are
    missing, a later call computes and merges them.

    Raises RunFileError in the first process before anything is written."""
    error, state, first = None, COMPUTE, jax.process_index() == 0
    if first:
        try:
            missing = still_missing(task, folder, resume)
            state = NOTHING_TO_DO if missing is None else COMPUTE
            if missing is not None:
                publish_pieces(task, folder, missing, jax.process_count())
        except (RunFileError, OSError) as found:
            error, state = found, REFUSED
    state = int(multihost_utils.broadcast_one_to_all(np.array(state)))
    # From here on the processes are independent: if one ends, even the first, the others go on.
    jax.distributed.shutdown()
    if error is not None:
        raise error
    if state != COMPUTE:
        return ExitCode.DONE if state == NOTHING_TO_DO else ExitCode.BAD_INPUT
    with Interrupts() as interrupts:
        work(folder, lambda: interrupts.asked)
    if interrupts.asked:
        return ExitCode.INTERRUPTED
    if len(computed_members(folder, task)[0]) == task.count and try_claim(folder, "merge"):
        return report(*merge_pieces(folder, task), quiet)
    return ExitCode.DONE


def report(status: str, message: str, quiet: bool) -> ExitCode:
    """Prints how an ensemble ended. Returns the exit code."""
    if message and (status != "complete" or not quiet):
        resume = "" if status == "complete" else "; --resume computes them"
        print(message + resume, file=sys.stderr)
    return ExitCode.DONE if status == "complete" else ExitCode.INTERRUPTED


def still_missing(task: Task, folder: Path, resume: bool) -> np.ndarray | None:
    """Numbers of the members to be computed; None if ensemble.h5 has all of them. Raises RunFileError."""
    if folder.exists() and not folder.is_dir():
        raise RunFileError(f"`-o` must be a directory, but {folder} is a file")
    whole, pieces = folder / WHOLE, pieces_in(folder)
    if (whole.exists() or parts_of(folder).exists()) and not resume:
        raise RunFileError(f"`-o` must not hold an ensemble yet (or use --resume), but {folder} does")
    done, held = computed_members(folder, task)
    if held > task.count:
        raise RunFileError(f"`--members` must not be less than the {held} of {whole}, but is {task.count}")
    missing = np.setdiff1d(np.arange(task.count), done)
    return None if held == task.count and not len(missing) and not pieces else missing


def publish_pieces(task: Task, folder: Path, missing: np.ndarray, processes: int) -> list[np.ndarray]:
    """Writes the task to its folder, cut into pieces for a number of processes. Returns the pieces."""
    most = MemberRunner(task.scene, task.inputs, task.observables, one_core=True).batch
    size = int(np.clip(len(missing) // (PIECES_PER_PROCESS * processes), 1, most))
    pieces = [missing[first : first + size] for first in range(0, len(missing), size)]
    publish(folder, task, pieces)
    return pieces


def start_worker(folder: Path) -> subprocess.Popen:
    """Starts another process on the task of a folder."""
    # The worker has its own session: Ctrl-C reaches it only through this process, once.
    command = [sys.executable, "-m", "esail_jax.commands.ensemble_worker", str(folder)]
    return subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL)


def work(folder: Path, stop: Callable[[], bool], each: Callable[[], None] = lambda: None) -> None:
    """Computes pieces of a folder's task until none is left or `stop()`. `each()` follows every piece."""
    task, pieces = read_task(folder)
    run = None
    for name, members in take_pieces(folder, pieces):
        began = time.perf_counter()
        if run is None:
            most = max(len(piece) for piece in pieces)
            run = MemberRunner(task.scene, task.inputs, task.observables, most, one_core=True)
            run.compile()
        compiled = time.perf_counter()
        found = run(members)
        write_piece(folder, name, task, found, (compiled - began, time.perf_counter() - compiled))
        each()
        if stop():
            return
