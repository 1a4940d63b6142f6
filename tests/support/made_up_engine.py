"""An executor whose processes compute nothing: what they do with a piece is made up by a test."""

from concurrent.futures import Executor, Future, ThreadPoolExecutor

import numpy as np

from esail_jax.ensembles.ensemble_file import parts_of
from esail_jax.ensembles.pieces import Piece, PieceFile
from esail_jax.ensembles.processes import WorkerDiedError
from esail_jax.ensembles.task import about
from esail_jax.ensembles.work import Prepared, prepare


def piece_of(members, messages=None, complete=None):
    """A piece whose coning angle is the number of the member [rad]."""
    numbers = np.asarray(members)
    rows = {"coning_angle": np.broadcast_to(numbers[:, None, None] + 0.0, (len(numbers), 11, 3))}
    complete = np.ones(len(numbers), bool) if complete is None else np.array(complete)
    messages = tuple(messages or [""] * len(numbers))
    return Piece(numbers, complete, messages, 10.0 + 0.0 * numbers, rows, (0.5, 1.0), "none")


def write_pieces(folder, task, *pieces, name="a"):
    """Writes pieces to a file of their own in the folder of an ensemble."""
    parts_of(folder).mkdir(parents=True, exist_ok=True)
    with PieceFile(parts_of(folder) / f"{name}.pieces", about(task)) as file:
        for piece in pieces:
            file.add(piece)


def died():
    """What a request raises whose process has ended."""
    return WorkerDiedError("a process ended by signal 9")


class MadeUp(Executor):
    """`do(members)` returns a piece, or raises the error of the process that has the piece."""

    def __init__(self, do=piece_of, batch=1, prepared=None):
        self.do, self.batch, self.asked, self.prepared = do, batch, [], prepared
        self._threads = ThreadPoolExecutor(2)

    def submit(self, function, /, argument, *_):
        if function is prepare:
            return self._threads.submit(self.prepared or (lambda: Prepared(self.batch, False, 0.25)))
        self.asked.append(argument.members.tolist())
        return self._threads.submit(self.do, argument.members)


class Never(Executor):
    """Prepares, and then keeps every piece for ever; futures can be cancelled, but `running` first ones."""

    def __init__(self, running=1):
        self.futures, self._running = [], running

    def submit(self, function, /, argument, *_):
        future = Future()
        if function is prepare:
            future.set_result(Prepared(1, False, 0.25))
            return future
        self.futures.append(future)
        if len(self.futures) <= self._running:
            future.set_running_or_notify_cancel()
        return future
