"""The driver of an ensemble: it hands pieces to an executor, and writes each as soon as it is computed.

Processes that compute know nothing of each other. An engine is an executor of `concurrent.futures`:
processes of this machine (`ensembles/processes.py`), Dask, MPI, or one of a user's.
"""

import contextlib
import json
import queue
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from esail_jax.array_types import Bool, Int
from esail_jax.ensembles.ensemble_file import parts_of
from esail_jax.ensembles.pieces import Piece, PieceFile, new_path
from esail_jax.ensembles.task import Task, about
from esail_jax.ensembles.work import Prepared, Program, Work, Written, compute, prepare, this_process
from esail_jax.errors import InputError, NoSpaceError, SceneError

ATTEMPTS = 4
"""How often a piece is handed out: once, and three times more if its process dies or raises an error."""

IN_FLIGHT = 4096
"""Most pieces that the executor has at a time: four for each of a thousand cores."""

LEAST_PIECES = 256
"""Least number of pieces, if there are enough members: fast processes then take more of them."""

GRACE_SECONDS = 10.0
"""Time to finish the current pieces after an interruption [s]. SLURM kills 30 s after SIGTERM."""

POLL_SECONDS = 0.1
"""Time between two looks at whether to stop [s]."""


class Ended(NamedTuple):
    """How the computation ended.

    at_work: whether pieces are still being computed, after an interruption; reasons: why members are
    missing, by text."""

    at_work: bool
    reasons: dict[str, list[int]]


class Attempt(NamedTuple):
    """Members that are handed out together. number: how often they have been before."""

    members: Int[np.ndarray, " member"]
    number: int


def drive(
    task: Task,
    folder: Path,
    missing: Bool[np.ndarray, " member"],
    executor: Executor,
    stop: Callable[[], bool] = lambda: False,
    show: Callable[[int], None] = lambda _: None,
) -> Ended:
    """Computes the missing members, and writes them to the folder piece by piece.

    executor: of any kind; stop: whether to end after the current pieces; show: is told how many members are
    computed, again and again. The folder must be locked by this process.

    A piece whose process dies, or that raises an error, is taken apart, and each member is tried again.
    Raises NoSpaceError if the disk is full, SceneError for an executor that takes no work and InputError
    for a function of a user that does not fit; what is computed stays in the folder."""
    parts = parts_of(folder)
    parts.mkdir(parents=True, exist_ok=True)
    token = parts / f"{uuid.uuid4().hex}.token"
    token.touch()
    file = PieceFile(new_path(parts), about(task))
    try:
        with file:
            return Driver(task, missing, executor, file, token, stop, show).run()
    finally:
        token.unlink(missing_ok=True)
        if file.empty:
            file.path.unlink()
            with contextlib.suppress(OSError):  # it has other pieces
                parts.rmdir()


class Driver:
    """The state of `drive`."""

    def __init__(
        self,
        task: Task,
        missing: Bool[np.ndarray, " member"],
        executor: Executor,
        file: PieceFile,
        token: Path,
        stop: Callable[[], bool],
        show: Callable[[int], None],
    ):
        self._task, self._executor, self._file = task, executor, file
        self._token, self._stop, self._show = token, stop, show
        self._missing, self._done = np.flatnonzero(missing), 0
        one = task.draws.of(self._missing[:1])
        shapes = tuple((key, values.shape[1:]) for key, values in one.items())
        self._program = Program(json.dumps(about(task)), shapes, task.max_steps, this_process())
        self._batch, self._preparing = 1, 0.0
        self._waiting: Iterator[Attempt] = iter(())
        self._again: deque[Attempt] = deque()
        self._running: dict[Future, Attempt] = {}
        self._finished: queue.SimpleQueue[Future] = queue.SimpleQueue()
        self._reasons: dict[str, list[int]] = {}
        self._told: float | None = None
        self._lost = ""

    def run(self) -> Ended:
        """Computes all pieces, after one process has prepared the program."""
        try:
            prepared = self._prepare()
            if prepared is not None:
                self._batch, count = prepared.batch, len(self._missing)
                self._preparing = prepared.seconds
                size = prepared.batch
                if not prepared.lockstep:
                    size = int(np.clip(count // LEAST_PIECES, 1, prepared.batch))
                pieces = (self._missing[first : first + size] for first in range(0, count, size))
                self._waiting = (Attempt(piece, 0) for piece in pieces)
                self._compute()
        finally:
            for future in self._running:
                future.cancel()
        if self._lost:
            self._reasons.setdefault(self._lost, [])
        return Ended(bool(self._running), self._reasons)

    # ---- stopping -------------------------------------------------------------------------------

    def _stopping(self) -> bool:
        """Whether to hand out nothing more. The first time, what has not begun is cancelled."""
        if self._told is None and (self._lost or self._stop()):
            self._told = time.monotonic()
            self._again.clear()
            self._waiting = iter(())
            for future in list(self._running):
                future.cancel()
        return self._told is not None

    def _late(self) -> bool:
        """Whether the current pieces have had their time."""
        return self._told is not None and time.monotonic() - self._told > GRACE_SECONDS

    # ---- handing out ----------------------------------------------------------------------------

    def _submit(self, attempt: Attempt, function: Callable, *arguments: Any) -> None:
        try:
            future = self._executor.submit(function, *arguments)
        except RuntimeError as error:  # also that of a broken executor
            if function is prepare:
                must = 'take work (a script that starts processes needs `if __name__ == "__main__"`)'
                raise SceneError("executor", must, f"does not: {said(error)}") from error
            self._lost = f"the executor takes nothing more: {error}"
            return
        self._running[future] = attempt
        future.add_done_callback(self._finished.put)

    def _next_finished(self) -> Future | None:
        try:
            return self._finished.get(timeout=POLL_SECONDS)
        except queue.Empty:
            return None

    def _prepare(self) -> Prepared | None:
        """Lets one process compile the program. None if that was interrupted, or if it died again and
        again."""
        nobody = self._missing[:0]
        for number in range(ATTEMPTS):
            attempt = Attempt(nobody, number)
            self._submit(attempt, prepare, self._program, self._token.name, number)
            future = None
            while future is None and not (self._stopping() and (self._late() or not self._running)):
                self._show(0)
                future = self._next_finished()
            if future is None or self._stopping():
                return None
            self._running.pop(future)
            try:
                return future.result()
            except InputError:
                raise
            except Exception as error:
                self._lost = said(error) if number == ATTEMPTS - 1 else ""
        return None

    def _compute(self) -> None:
        """Hands out pieces as long as there are any, and takes them back."""
        while True:
            while not self._stopping() and len(self._running) < IN_FLIGHT:
                attempt = self._again.popleft() if self._again else next(self._waiting, None)
                if attempt is None:
                    break
                inputs = self._task.draws.of(attempt.members)
                folder = str(self._token.parent.absolute())
                work = Work(
                    self._program,
                    self._batch,
                    attempt.members,
                    inputs,
                    folder,
                    self._token.name,
                    attempt.number,
                )
                self._submit(attempt, compute, work)
            if not self._running or self._late():
                return
            future = self._next_finished()
            if future is not None:
                self._take(future)
            self._show(self._done)

    # ---- taking back ----------------------------------------------------------------------------

    def _take(self, future: Future) -> None:
        """Writes a piece, or lets its members be tried again."""
        attempt = self._running.pop(future)
        try:
            piece: Piece | Written = future.result()
        except (InputError, NoSpaceError):
            raise
        except Exception as error:
            self._retry(attempt, error)
            return
        if isinstance(piece, Piece):
            preparing, running = piece.seconds
            self._file.add(piece._replace(seconds=(preparing + self._preparing, running)))
            self._preparing = 0.0
        self._done += len(attempt.members)

    def _retry(self, attempt: Attempt, error: BaseException) -> None:
        """Hands out members again, each alone, unless they have been often enough."""
        if self._told is not None:
            return
        if attempt.number + 1 >= ATTEMPTS:
            self._reasons.setdefault(said(error), []).extend(attempt.members.tolist())
            return
        self._again.extend(Attempt(member, attempt.number + 1) for member in attempt.members[:, None])


def said(error: BaseException) -> str:
    """An error in one line."""
    lines = str(error).splitlines()
    return f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__
