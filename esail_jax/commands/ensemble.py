"""`esail ensemble`: an ensemble computed by several processes.

All of them do the same: take a piece of the task that nobody has taken, compute it, leave it in the
folder. On one machine this process starts the others. On several the cluster starts them, and JAX's
distributed runtime numbers them; they exchange nothing but the word that the task is there.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import jax
import numpy as np
from jax.experimental import multihost_utils

from esail_jax.commands.progress import MemberProgress
from esail_jax.commands.run import Interrupts
from esail_jax.cores import cores
from esail_jax.ensembles import sampling as samples
from esail_jax.ensembles.ensemble_file import (
    Task,
    claim,
    computed,
    gather,
    parts_of,
    pieces_in,
    read_task,
    unclaimed,
    write_piece,
    write_task,
)
from esail_jax.ensembles.members import Runner, chosen, shapes_of
from esail_jax.files.run_file import RunFileError
from esail_jax.scenes.scene import Scene

COMPLETE, BAD_INPUT, INTERRUPTED = 0, 2, 130

TURNS = 4
"""Pieces for every process, at least, where there are members enough: others take those of a slow one."""

GO, NOTHING, REFUSED = 0, 1, 2
"""What the first of many processes tells the others."""


def task_of(
    scene: Scene,
    members: int,
    variations: Sequence[samples.Variation],
    seed: int,
    sampling: str,
    observables: Sequence[str] | None,
) -> Task:
    """What is asked for. Raises SceneError, VariationError."""
    inputs = samples.draw(scene, variations, members, seed, sampling)
    vary = tuple(f"{v.key}{'[*]' if v.each else ''}={v.text}" for v in variations)
    return Task(scene, members, inputs, vary, sampling, seed, chosen(shapes_of(scene), observables))


def run_here(task: Task, folder: Path, processes: int | None, resume: bool, quiet: bool) -> int:
    """Compute an ensemble on this machine; returns the exit status. processes: None for one per core, or
    one in all where JAX has other devices.

    Raises RunFileError before anything is written."""
    missing = still_missing(task, folder, resume)
    if missing is None:
        return COMPLETE
    if processes is None:
        processes = cores() if jax.default_backend() == "cpu" else 1
    pieces = leave(task, folder, missing, processes)
    progress = MemberProgress(len(missing), lambda: len(pieces_in(folder)), len(pieces), quiet)
    others = [start_worker(folder) for _ in range(min(processes, len(pieces)) - 1)]
    try:
        with Interrupts() as interrupts:
            work(folder, lambda: interrupts.asked, progress.show)
            wait_for(others, lambda: interrupts.asked, progress.show)
    finally:
        progress.close()
        for worker in others:
            worker.kill()
    return report(*gather(folder, task), quiet)


def wait_for(others: list[subprocess.Popen], stop: Callable[[], bool], each: Callable[[], None]) -> None:
    """Until other processes have ended; they are told once to stop after what they are at."""
    told = False
    while any(other.poll() is None for other in others):
        if stop() and not told:
            told = True
            for other in others:
                other.send_signal(signal.SIGTERM)
        each()
        time.sleep(0.05)


def run_distributed(task: Task, folder: Path, resume: bool, quiet: bool) -> int:
    """This process's share of an ensemble that many compute, after `jax.distributed.initialize`; returns
    the exit status. The folder must be one that all of them see. A process that ends before its time costs
    the members it was at; the last one to end gathers the pieces, or, if some are missing, a later call.

    Raises RunFileError in the first process before anything is written."""
    error, state, first = None, GO, jax.process_index() == 0
    if first:
        try:
            missing = still_missing(task, folder, resume)
            state = NOTHING if missing is None else GO
            if missing is not None:
                leave(task, folder, missing, jax.process_count())
        except (RunFileError, OSError) as found:
            error, state = found, REFUSED
    state = int(multihost_utils.broadcast_one_to_all(np.array(state)))
    # From here on each is on its own: one that ends, the first one too, does not end the others.
    jax.distributed.shutdown()
    if error is not None:
        raise error
    if state != GO:
        return COMPLETE if state == NOTHING else BAD_INPUT
    with Interrupts() as interrupts:
        work(folder, lambda: interrupts.asked)
    if interrupts.asked:
        return INTERRUPTED
    if len(computed(folder, task)[0]) == task.count and claim(folder, "gather"):
        return report(*gather(folder, task), quiet)
    return COMPLETE


def report(status: str, message: str, quiet: bool) -> int:
    """Say how an ensemble ended; the exit status."""
    if message and (status != "complete" or not quiet):
        resume = "" if status == "complete" else "; --resume computes them"
        print(message + resume, file=sys.stderr)
    return COMPLETE if status == "complete" else INTERRUPTED


def still_missing(task: Task, folder: Path, resume: bool) -> np.ndarray | None:
    """Members that are to be computed; None if all is done. Raises RunFileError."""
    if folder.exists() and not folder.is_dir():
        raise RunFileError(f"`-o` must be a directory, but {folder} is a file")
    whole, pieces = folder / "ensemble.h5", pieces_in(folder)
    if (whole.exists() or parts_of(folder).exists()) and not resume:
        raise RunFileError(f"`-o` must not hold an ensemble yet (or use --resume), but {folder} does")
    done, held = computed(folder, task)
    if held > task.count:
        raise RunFileError(f"`--members` must not be less than the {held} of {whole}, but is {task.count}")
    missing = np.setdiff1d(np.arange(task.count), done)
    return None if held == task.count and not len(missing) and not pieces else missing


def leave(task: Task, folder: Path, missing: np.ndarray, processes: int) -> list[np.ndarray]:
    """Leave the task in its folder, cut into pieces for so many processes: the pieces."""
    most = Runner(task.scene, task.inputs, task.observables, one_core=True).batch
    size = int(np.clip(len(missing) // (TURNS * processes), 1, most))
    pieces = [missing[first : first + size] for first in range(0, len(missing), size)]
    write_task(folder, task, pieces)
    return pieces


def start_worker(folder: Path) -> subprocess.Popen:
    """Another process that works on the task of a folder, with this one's cache of programs."""
    cache = {
        "JAX_COMPILATION_CACHE_DIR": jax.config.jax_compilation_cache_dir,
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": jax.config.jax_persistent_cache_min_compile_time_secs,
        "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": jax.config.jax_persistent_cache_min_entry_size_bytes,
    }
    environment = os.environ | {name: str(value) for name, value in cache.items() if value is not None}
    # In a session of its own: an interruption from the keyboard reaches it through this process, once.
    command = [sys.executable, "-m", "esail_jax.ensemble_worker", str(folder)]
    return subprocess.Popen(command, env=environment, start_new_session=True, stdout=subprocess.DEVNULL)


def work(folder: Path, stop: Callable[[], bool], each: Callable[[], None] = lambda: None) -> None:
    """Compute pieces of a folder's task until none is left, or `stop()`; `each()` after every one."""
    task, pieces = read_task(folder)
    run = None
    for name, members in unclaimed(folder, pieces):
        began = time.perf_counter()
        if run is None:
            most = max(len(piece) for piece in pieces)
            run = Runner(task.scene, task.inputs, task.observables, most, one_core=True)
            run.compile()
        compiled = time.perf_counter()
        found = run(members)
        write_piece(folder, name, task, found, (compiled - began, time.perf_counter() - compiled))
        each()
        if stop():
            return
