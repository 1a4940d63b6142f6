"""`esail ensemble` while it computes: its progress, and how it ends."""

import os
import sys
from pathlib import Path

from esail_jax.commands.command_line import ExitCode
from esail_jax.commands.ensemble_report import describe_ensemble
from esail_jax.commands.progress import Progress
from esail_jax.ensembles.engines import Engine
from esail_jax.ensembles.running import Outcome, run_task
from esail_jax.ensembles.task import Task
from esail_jax.files.opening import WHOLE
from esail_jax.interrupts import Interrupts


def compute(task: Task, folder: Path, engine: Engine, resume: bool, quiet: bool) -> ExitCode:
    """Computes an ensemble with an engine. Returns the exit code. Raises SceneError and RunFileError before
    anything is written, NoSpaceError if the disk is full."""
    progress = Progress(float(task.count), lambda _, speed: (f"{speed:.3g} members a second",), quiet)

    def show(done: int, missing: int) -> None:
        if done and progress.due:
            progress.total = float(missing)
            progress.update(done)

    try:
        with Interrupts() as interrupts:
            outcome = run_task(task, folder, engine, resume, lambda: interrupts.asked, show)
    finally:
        progress.close()
    code = ExitCode.DONE if outcome is None else report(folder, outcome, quiet)
    if outcome is not None and outcome.at_work:
        end_process(code)
    return code


def report(folder: Path, outcome: Outcome, quiet: bool) -> ExitCode:
    """Prints how an ensemble ended, and what it holds if it is complete. Returns the exit code."""
    complete = outcome.status == "complete"
    if outcome.message and not (complete and quiet):
        print(outcome.message + ("" if complete else "; --resume computes them"), file=sys.stderr)
    if not complete:
        return ExitCode.INTERRUPTED
    if not quiet:
        print(describe_ensemble(folder / WHOLE))
    return ExitCode.DONE


def end_process(code: int) -> None:
    """Ends this process although a thread of it is still in a compiled program, for which Python and JAX
    would wait."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
