"""`esail ensemble`: an ensemble computed by several processes of this machine.

All processes do the same: they take a piece of the task that no other process has taken, compute it, and
write it to the folder (`commands/ensemble_work.py`). This process starts the others and puts the pieces
together. `commands/cluster.py` is for processes that a cluster has started.
"""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import jax
import numpy as np

from esail_jax.commands.command_line import ExitCode
from esail_jax.commands.ensemble_report import describe_ensemble
from esail_jax.commands.ensemble_work import NO_SPACE, Work, end_process, wait_for
from esail_jax.commands.progress import Interrupts, Progress
from esail_jax.cores import cores
from esail_jax.ensembles.ensemble_file import (
    Task,
    computed_members,
    parts_of,
    pieces_in,
    publish,
)
from esail_jax.ensembles.member_program import observable_shapes, select_observables
from esail_jax.ensembles.member_runner import MemberRunner
from esail_jax.ensembles.merging import merge_pieces
from esail_jax.ensembles.sampling import Vary, draw, variations_of
from esail_jax.errors import NoSpaceError
from esail_jax.files.locks import FolderLock
from esail_jax.files.opening import WHOLE, RunFileError
from esail_jax.scenes.scene import Scene

PIECES_PER_PROCESS = 4
"""Least number of pieces per process, if there are enough members. Fast processes then take more pieces."""


def task_of(
    scene: Scene,
    members: int,
    vary: Vary,
    seed: int,
    sampling: str,
    observables: Sequence[str] | None,
    max_steps: int | None = None,
) -> Task:
    """The task, with the inputs of all members drawn. Raises SceneError, VariationError."""
    inputs = draw(scene, vary, members, seed, sampling)
    texts = tuple(variation.text for variation in variations_of(vary))
    names = select_observables(observable_shapes(scene), observables)
    return Task(scene, members, inputs, texts, sampling, seed, names, max_steps)


def run_here(task: Task, folder: Path, processes: int | None, resume: bool, quiet: bool) -> ExitCode:
    """Computes an ensemble on this machine. Returns the exit code.

    processes: their number; None is one per core, or one in all if JAX's devices are no CPUs.

    Raises RunFileError before anything is written, NoSpaceError if the disk is full."""
    check_folder(folder)
    lock = FolderLock(folder)
    try:
        missing = still_missing(task, folder, resume)
        if missing is None:
            return ExitCode.DONE
        finished = compute_here(task, folder, missing, processes, quiet)
        code = report(folder, *merge_pieces(folder, task), quiet)
    finally:
        lock.release()
    if not finished:
        end_process(code)
    return code


def compute_here(task: Task, folder: Path, missing: np.ndarray, processes: int | None, quiet: bool) -> bool:
    """Computes the missing members with several processes. False if this process had to give up a piece.
    Raises NoSpaceError if the disk is full."""
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
            work = Work(folder, lambda: interrupts.asked)
            finished = wait_for(work, others, lambda: interrupts.asked, show)
    finally:
        progress.close()
        stop_all(others)
    if any(other.returncode == NO_SPACE for other in others):
        raise NoSpaceError(f"no space is left in {parts_of(folder)}")
    return finished


def stop_all(others: Sequence[subprocess.Popen]) -> None:
    """Ends the other processes that are still alive, at once."""
    for other in others:
        other.kill()
    for other in others:
        other.wait()


def progress_texts(_: float, speed: float) -> tuple[str]:
    """The text beside the progress bar."""
    return (f"{speed:.3g} members a second",)


def report(folder: Path, status: str, message: str, quiet: bool) -> ExitCode:
    """Prints how an ensemble ended, and what it holds if it is complete. Returns the exit code."""
    if message and (status != "complete" or not quiet):
        resume = "" if status == "complete" else "; --resume computes them"
        print(message + resume, file=sys.stderr)
    if status != "complete":
        return ExitCode.INTERRUPTED
    if not quiet:
        print(describe_ensemble(folder / WHOLE))
    return ExitCode.DONE


def check_folder(folder: Path) -> None:
    """Raises RunFileError if the folder of an ensemble cannot be one."""
    if folder.exists() and not folder.is_dir():
        raise RunFileError(f"`-o` must be a directory, but {folder} is a file")


def still_missing(task: Task, folder: Path, resume: bool) -> np.ndarray | None:
    """Numbers of the members to be computed; None if ensemble.h5 has all of them. Raises RunFileError."""
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
