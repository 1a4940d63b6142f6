"""Ctrl-C and SIGTERM as a request to stop where files are consistent."""

import signal
import threading
from typing import Any


class Interrupts:
    """Context manager that turns the first Ctrl-C or SIGTERM into a request to stop, `asked`.

    The command stops at the next point where its files are consistent. A second signal raises
    KeyboardInterrupt at once; the files then stay as they were last written.

    asked: true once a signal has come.
    """

    def __init__(self):
        self.asked = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> "Interrupts":
        # Python runs signal handlers in the main thread only, and lets no other thread set them.
        if threading.current_thread() is threading.main_thread():
            self._before = {n: signal.signal(n, self._ask) for n in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _ask(self, *_: object) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True
