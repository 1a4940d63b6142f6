"""Computing an ensemble into a folder, on one machine or on many."""

import contextlib
import os
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from esail_jax.array_types import Int
from esail_jax.ensembles.driver import Ended, drive
from esail_jax.ensembles.engines import Engine, local
from esail_jax.ensembles.ensemble import Ensemble
from esail_jax.ensembles.ensemble_file import computed_members, load_ensemble, parts_of
from esail_jax.ensembles.merging import merge_pieces, some
from esail_jax.ensembles.pieces import files_in
from esail_jax.ensembles.reductions import Reduction
from esail_jax.ensembles.sampling import BLOCK, Vary, check
from esail_jax.ensembles.task import Task, task_of
from esail_jax.files.locks import FolderLock
from esail_jax.files.opening import WHOLE, ArgumentError
from esail_jax.interrupts import Interrupts
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene


class Outcome(NamedTuple):
    """How an ensemble ended.

    status, message: those of ensemble.h5; at_work: whether pieces are still being computed, after an
    interruption."""

    status: str
    message: str
    at_work: bool


def run_ensemble(
    scene: Scene | str | os.PathLike,
    folder: str | os.PathLike,
    *,
    members: int,
    vary: Vary,
    seed: int = 0,
    sampling: str = "random",
    observables: Sequence[str] | None = None,
    max_steps: int | None = None,
    reduce: Sequence[str | Reduction] = (),
    executor: Executor | None = None,
    resume: bool = False,
) -> Ensemble:
    """Computes an ensemble into FOLDER/ensemble.h5, as `esail ensemble` does, and returns it.

    The members are handed, a piece at a time, to an executor of `concurrent.futures`: that of
    `dask.distributed.Client.get_executor()`, `mpi4py.futures.MPIPoolExecutor()`, or one of your own.
    `None` takes processes of this machine, one per core. The members are the same bit for bit with every
    executor. What is computed is in the folder at once, and `resume=True` computes what is missing.

    vary, seed, sampling: as for `draw`; observables: names to keep, all if None; max_steps: bound of the
    steps of a member; reduce: names of `REDUCTIONS`, or functions (time, rows) -> numbers, that take the
    place of histories: `reduce=["mean", "max"]` keeps `ensemble["coning_angle.mean"]` and
    `ensemble["coning_angle.max"]`.

    Members whose process dies again and again, or that an executor does not compute, are missing: NaN, with
    a warning. Raises SceneError, VariationError and RunFileError before anything is written, NoSpaceError
    if the disk is full, and KeyboardInterrupt after Ctrl-C, when what is computed has been put together.

        from esail_jax.ensembles import Normal, run_ensemble

        vary = {"tethers.length": Normal(10e3, 10, per_tether=True)}
        ensemble = run_ensemble("baseline", "many", members=1000, vary=vary, observables=["coning_angle"])
    """
    check_executor(executor)
    if not isinstance(folder, str | os.PathLike) or not os.fspath(folder):
        raise SceneError("folder", "be the path of a folder", f"is {folder!r}")
    if not isinstance(resume, bool):
        raise SceneError("resume", "be true or false", f"is {resume!r}")
    task = task_of(scene, members, vary, seed, sampling, observables, max_steps, reduce)
    folder = Path(folder).absolute()  # a change of directory must not move it
    engine = local if executor is None else lambda: contextlib.nullcontext(executor)
    with Interrupts() as interrupts:
        outcome = run_task(task, folder, engine, resume, lambda: interrupts.asked)
    if outcome is not None and outcome.status != "complete":
        text = f"{outcome.message}; resume=True computes them"
        if interrupts.asked:
            raise KeyboardInterrupt(text)
        warnings.warn(text, stacklevel=2)
    return load_ensemble(folder / WHOLE)


def run_task(
    task: Task,
    folder: Path,
    engine: Engine,
    resume: bool,
    stop: Callable[[], bool] = lambda: False,
    show: Callable[[int, int], None] = lambda *_: None,
) -> Outcome | None:
    """Computes a task into a folder. None if ensemble.h5 already has all members.

    stop: whether to end as soon as what is computed can be kept; show: is told how many members are
    computed, of how many that were missing. Raises SceneError and RunFileError before anything is written,
    KeyboardInterrupt if `stop()` before that, NoSpaceError if the disk is full."""
    check_folder(folder)
    lock = FolderLock(folder)
    try:
        if (folder / WHOLE).exists() or parts_of(folder).exists():
            if not resume:
                must = "not hold an ensemble yet (or use --resume)"
                raise ArgumentError("folder", must, f"{folder} does")
        done, held = computed_members(folder, task)
        if held == task.count and done.all() and not files_in(parts_of(folder)):
            return None
        ended, missing = Ended(False, {}), np.flatnonzero(~done)
        count = len(missing)
        check_draws(task, missing, stop)
        if count:
            with engine() as executor:
                ended = drive(task, folder, ~done, executor, stop, lambda computed: show(computed, count))
        status, message = merge_pieces(folder, task)
    finally:
        lock.release()
    causes = [f"{text}{of(members)}" for text, members in ended.reasons.items()]
    return Outcome(status, "; ".join([message, *causes]), ended.at_work)


def of(members: Sequence[int]) -> str:
    """The members that something is about, in brackets."""
    return f" ({some(sorted(members))})" if members else ""


def check_executor(executor: Any) -> None:
    """Raises SceneError for what is no executor, and for one that forks: JAX does not survive that."""
    if not isinstance(executor, Executor | None):
        must = "be an executor of concurrent.futures, or None"
        raise SceneError("executor", must, f"is of type {type(executor).__name__}")
    context = getattr(executor, "_mp_context", None)  # of ProcessPoolExecutor
    if context is not None and context.get_start_method() == "fork":
        must = 'start its processes by spawn (mp_context=multiprocessing.get_context("spawn"))'
        raise SceneError("executor", must, "forks")


def check_folder(folder: Path) -> None:
    """Raises RunFileError if the folder of an ensemble cannot be one."""
    if folder.exists() and not folder.is_dir():
        raise ArgumentError("folder", "be a directory", f"{folder} is a file")


def check_draws(task: Task, members: Int[np.ndarray, " member"], stop: Callable[[], bool]) -> None:
    """Raises SceneError for the first of some members whose values are refused by the scene, and
    KeyboardInterrupt if `stop()`."""
    for first in range(0, len(members), BLOCK):
        if stop():
            raise KeyboardInterrupt
        some_of_them = members[first : first + BLOCK]
        check(task.scene, task.draws.of(some_of_them), some_of_them)
