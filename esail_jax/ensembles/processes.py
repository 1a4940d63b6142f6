"""Processes of this machine as an executor.

Every process is a new interpreter, which shares nothing with this one: a process in which JAX has started
may not be forked, and a user's script is not run again in it. Requests go to its standard input, and
answers come from its standard output. A process whose input ends has lost the one that started it, and ends
at once, in the middle of a member or of compiling. Each has a session of its own, so that Ctrl-C reaches it
only through the process that started it.
"""

import contextlib
import os
import pickle
import queue
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from typing import IO, Any


class WorkerDiedError(BrokenExecutor):
    """The error of a request whose process has ended before it answered. Another takes its place."""


class Worker:
    """A process that answers one request at a time."""

    def __init__(self) -> None:
        command = [sys.executable, "-c", f"from {__name__} import serve; serve()"]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),  # on Windows
        )
        assert self._process.stdin is not None and self._process.stdout is not None
        self._requests, self._answers = self._process.stdin, self._process.stdout
        with contextlib.suppress(OSError):  # the first request finds that it has died
            send(self._requests, pickle.dumps(sys.path))

    def __call__(self, function: Callable, arguments: tuple) -> Any:
        """The result of a function of a module. Raises its error, or WorkerDiedError."""
        request = pickle.dumps((function, arguments), pickle.HIGHEST_PROTOCOL)
        try:
            send(self._requests, request)
            answer = receive(self._answers)
        except (EOFError, OSError) as error:
            raise WorkerDiedError(self._end()) from error
        good, result = pickle.loads(answer)
        if good:
            return result
        raise result

    def kill(self) -> None:
        """Ends the process at once."""
        self._process.kill()

    def _end(self) -> str:
        """Waits for the end of the process, and says how it ended."""
        self._process.kill()  # what is left of one that has closed its output
        self.close()
        code = self._process.returncode
        return (
            f"a process ended by signal {-code}" if code < 0 else f"a process ended with exit code {code}"
        )

    def close(self) -> None:
        """Lets the process end, and waits for it."""
        with contextlib.suppress(OSError):
            self._requests.close()
        self._process.wait()
        self._answers.close()


class ProcessExecutor(ThreadPoolExecutor):
    """An executor with processes of this machine. All start at once.

    A process that dies spoils only its own request, which raises WorkerDiedError, and is replaced.
    Functions and arguments must be such that `pickle` can take them, as for
    `concurrent.futures.ProcessPoolExecutor`."""

    def __init__(self, processes: int):
        super().__init__(processes, thread_name_prefix="ensemble")
        self._lock, self._closed = threading.Lock(), False
        self._workers: set[Worker] = set()
        self._idle: queue.SimpleQueue[Worker | None] = queue.SimpleQueue()
        for _ in range(processes):
            self._start()

    def submit(self, function: Callable, /, *arguments: Any) -> Future:  # type: ignore[override]
        """Calls a function in one of the processes. Returns the future of its result."""
        return super().submit(self._call, function, arguments)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Ends the processes; those that are at work when they have answered."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        if wait:
            with self._lock:
                self._closed = True
            while self._workers:
                self._workers.pop().close()

    def kill(self) -> None:
        """Ends the processes at once, in the middle of their work. Nothing is computed after that."""
        with self._lock:
            self._closed = True
            for worker in self._workers:
                worker.kill()
        self.shutdown(cancel_futures=True)

    def _start(self) -> None:
        """Adds a process, unless all are to end."""
        with self._lock:
            worker = None if self._closed else Worker()
            if worker is not None:
                self._workers.add(worker)
        self._idle.put(worker)

    def _call(self, function: Callable, arguments: tuple) -> Any:
        worker = self._idle.get()
        if worker is None:
            self._idle.put(None)
            raise WorkerDiedError("all processes are to end")
        try:
            result = worker(function, arguments)
        except WorkerDiedError:
            with self._lock:
                self._workers.discard(worker)
            self._start()
            raise
        except BaseException:
            self._idle.put(worker)
            raise
        self._idle.put(worker)
        return result


# ---- messages -----------------------------------------------------------------------------------

SIZE = struct.Struct("<Q")
"""A message begins with its number of bytes."""


def send(file: IO[bytes], message: bytes) -> None:
    """Writes a message to a pipe."""
    file.write(SIZE.pack(len(message)))
    file.write(message)
    file.flush()


def receive(file: IO[bytes]) -> bytes:
    """Reads a message from a pipe. Raises EOFError if there is none, or only a part."""
    head = file.read(SIZE.size)
    message = file.read(*SIZE.unpack(head)) if len(head) == SIZE.size else b""
    if len(head) < SIZE.size or len(message) < SIZE.unpack(head)[0]:
        raise EOFError
    return message


# ---- in the process -----------------------------------------------------------------------------


def serve() -> None:
    """Answers requests until the input ends."""
    requests, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what is printed does not mix with the answers
    sys.path[:] = pickle.loads(receive(requests))
    waiting: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=take, args=(requests, waiting), daemon=True).start()
    while True:
        message = waiting.get()
        try:
            function, arguments = pickle.loads(message)
            answer = pickle.dumps((True, function(*arguments)), pickle.HIGHEST_PROTOCOL)
        except Exception as error:
            answer = failure(error)
        send(answers, answer)


def take(requests: IO[bytes], waiting: "queue.SimpleQueue[bytes]") -> None:
    """Takes requests, in a thread that sees the end of the input whatever the main thread does, and ends
    the process then."""
    try:
        while True:
            waiting.put(receive(requests))
    finally:
        os._exit(0)


def failure(error: Exception) -> bytes:
    """The answer for an error; its text, if it cannot travel itself."""
    try:
        answer = pickle.dumps((False, error))
        pickle.loads(answer)  # some errors can be written, but not read
    except Exception:
        answer = pickle.dumps((False, RuntimeError(f"{type(error).__name__}: {error}")))
    return answer
