"""A line in a notebook that says that the compiler is at work, and then how long it took.

A first run compiles for ten seconds and a first gradient for half a minute, in which a notebook would show
nothing. Outside notebooks nothing is printed: what a script prints is its author's matter, and the commands
have a line of their own (`announcements.py`)."""

import contextlib
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

from esail_jax.compilation.stored import STORE

PATIENCE = 2.0
"""Time that the compiler may take before the line appears [s]."""

AT_WORK = "Compiling; this takes from seconds to a minute ..."
"""The line while the compiler is at work."""


class NotebookLine:
    """The line of all programs that a cell compiles, one after the other or at the same time in several
    threads.

    An instance counts who waits. The line is written once a wait has lasted for PATIENCE. When the last one
    has ended it is replaced by the time that all of the cell's waits took."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waits, self._began, self._before = 0, 0.0, 0.0
        self._cell: int | None = None
        self._line: Any = None
        self._timer: threading.Timer | None = None

    @contextlib.contextmanager
    def shown(self) -> Iterator[None]:
        """Context manager: the compiler is at work within it."""
        cell = running_cell()
        if cell is None:
            yield
            return
        self._begin(cell)
        try:
            yield
        finally:
            self._end()

    def _begin(self, cell: int) -> None:
        with self._lock:
            self._waits += 1
            if self._waits > 1:
                return
            self._began = time.perf_counter()
            if cell != self._cell:
                self._cell, self._line, self._before = cell, None, 0.0
            self._timer = threading.Timer(PATIENCE, self._write)
            self._timer.daemon = True
            self._timer.start()

    def _write(self) -> None:
        """Writes the line, if the wait goes on."""
        with self._lock:
            if self._waits and self._line is None:
                self._line = show(AT_WORK)
            elif self._waits:
                self._line.update(plain(AT_WORK), raw=True)

    def _end(self) -> None:
        with self._lock:
            self._waits -= 1
            if self._waits:
                return
            self._before += time.perf_counter() - self._began
            if self._timer is not None:
                self._timer.cancel()
            if self._line is not None:
                kept = "" if STORE.location() is None else ", and kept for later sessions"
                self._line.update(plain(f"Compiled in {self._before:.0f} s{kept}."), raw=True)


def running_cell() -> int | None:
    """The number of the cell that is running; None if this process is not the kernel of a notebook.
    IPython is not imported for it."""
    module = sys.modules.get("IPython")
    shell = module.get_ipython() if hasattr(module, "get_ipython") else None
    return None if getattr(shell, "kernel", None) is None else shell.execution_count


def show(text: str) -> Any:
    """Writes a line below the cell that is running, and returns the handle that replaces it."""
    from IPython.display import display

    return display(plain(text), raw=True, display_id=True)


def plain(text: str) -> dict[str, str]:
    """A text as the data of an output cell."""
    return {"text/plain": text}


compiler_at_work = NotebookLine().shown
"""Context manager around everything that compiles."""
