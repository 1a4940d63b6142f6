"""A pause of Python's garbage collector while a program is traced and lowered.

Tracing makes millions of objects that stay alive. The collector looks through them again and again and
finds nothing to free: for 3.3 s of the 35 s of processor time that the first gradient of a small sail
takes, and for 0.6 s of the 11 s of a first run of the baseline. With the pause these are 0.8 s and 0.2 s.
"""

import contextlib
import gc
import threading
from collections.abc import Iterator


class Pauses:
    """Counts the pauses that overlap, in all threads. The last one that ends resumes the collector, unless
    it was off before the first began."""

    def __init__(self) -> None:
        self.lock, self.count, self.was_enabled = threading.Lock(), 0, False

    def begin(self) -> None:
        """Stops the collector."""
        with self.lock:
            if self.count == 0:
                self.was_enabled = gc.isenabled()
                gc.disable()
            self.count += 1

    def end(self) -> None:
        """Resumes the collector if no other pause goes on."""
        with self.lock:
            self.count -= 1
            if self.count == 0 and self.was_enabled:
                gc.enable()


PAUSES = Pauses()


@contextlib.contextmanager
def collector_paused() -> Iterator[None]:
    """Context manager: the garbage collector pauses within it."""
    PAUSES.begin()
    try:
        yield
    finally:
        PAUSES.end()
