"""The work of one process on an ensemble: it takes pieces of the task that no other process has taken, and
computes them in a thread. The main thread stays free to take signals, which Python delivers to it alone:
a member in its compiled program, or the compiler, may hold the thread for long."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from esail_jax.commands.command_line import ExitCode
from esail_jax.ensembles.ensemble_file import read_task, take_pieces, write_piece
from esail_jax.ensembles.member_runner import MemberRunner

GRACE_SECONDS = 10.0
"""Time to finish the current pieces after an interruption [s]. SLURM kills 30 s after SIGTERM."""

NO_SPACE = 28
"""Exit code of a worker process that found the disk full; the process that started it says so."""

POLL_SECONDS = 0.05
"""Time between two looks at the work [s]."""


class Work:
    """The pieces that this process computes, until none is left or `stop()`.

    `join` waits a moment; `alive` tells whether a piece is being computed; `give_up` leaves the current
    piece to a later process."""

    def __init__(self, folder: Path, stop: Callable[[], bool]):
        self._folder, self._stop = folder, stop
        self._error: BaseException | None = None
        self._given_up, self._writing = False, threading.Lock()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def alive(self) -> bool:
        """True while a piece is being computed. Raises the error that has ended the work, if one has."""
        if self._error is not None:
            raise self._error
        return self._thread.is_alive()

    def join(self) -> None:
        """Waits until the work has ended, for POLL_SECONDS at most."""
        self._thread.join(POLL_SECONDS)

    def give_up(self) -> None:
        """Leaves the current piece: nothing is written from here on."""
        with self._writing:
            self._given_up = True

    def _run(self) -> None:
        try:
            self._compute()
        except BaseException as error:  # the main thread raises it
            self._error = error

    def _compute(self) -> None:
        task, pieces = read_task(self._folder)
        run = None
        for name, members in take_pieces(self._folder, pieces):
            began = time.perf_counter()
            if run is None:
                most = max(len(piece) for piece in pieces)
                run = MemberRunner(
                    task.scene, task.inputs, task.observables, most, one_core=True, max_steps=task.max_steps
                )
                run.compile()
            compiled = time.perf_counter()
            piece = run(members)
            seconds = (compiled - began, time.perf_counter() - compiled)
            with self._writing:
                if self._given_up:
                    return
                write_piece(self._folder, name, task, piece, seconds)
            if self._stop():
                return


def wait_for(
    work: Work,
    others: Sequence[subprocess.Popen] = (),
    stop: Callable[[], bool] = lambda: False,
    each: Callable[[], None] = lambda: None,
) -> bool:
    """Waits until the work of this process and the other processes have ended, and calls `each()` all the
    time. Once `stop()` is true, the others are told to end after their pieces, and all have GRACE_SECONDS
    for them. Returns false if this process gave up its piece: its thread may then never end. A second
    signal ends all processes at once."""
    told: float | None = None
    try:
        while work.alive or any(other.poll() is None for other in others):
            if stop() and told is None:
                told = time.monotonic()
                for other in others:
                    other.terminate()
            if told is not None and time.monotonic() - told > GRACE_SECONDS:
                break
            each()
            work.join()
            if not work.alive:
                time.sleep(POLL_SECONDS)
    except KeyboardInterrupt:
        for other in others:
            other.kill()
        end_process(ExitCode.INTERRUPTED)
    work.give_up()
    return not work.alive


def end_process(code: int) -> None:
    """Ends this process although a thread of it is still in a compiled program, for which Python and JAX
    would wait."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
