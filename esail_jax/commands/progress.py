"""Progress bars on a terminal."""

import sys
import time
from collections.abc import Callable
from typing import TextIO

WIDTH = 30


class Progress:
    """Part done, simulated time, speed (x real time) and remaining time, on one line.

    Silent unless `stream` (stderr) is a terminal; redrawn at most ten times a second.
    """

    def __init__(self, t_end: float, start: float = 0.0, quiet: bool = False, stream: TextIO | None = None):
        self.t_end, self.start = t_end, start
        self.stream = stream = sys.stderr if stream is None else stream
        self.shown = not quiet and stream.isatty()
        self._began = self._drawn = None
        if self.shown:
            stream.write("compiling ...")
            stream.flush()

    def update(self, reached: float) -> None:
        """Simulated time reached [s]. The clock starts at the first call: compiling is not speed."""
        now = time.perf_counter()
        if not self.shown:
            return
        if self._began is None:
            self._began, self.start = now, reached
        if self._drawn is not None and now - self._drawn < 0.1 and reached < self.t_end:
            return
        self._drawn = now
        elapsed = max(now - self._began, 1e-9)
        speed = (reached - self.start) / elapsed
        left = (self.t_end - reached) / speed if speed > 0.0 else 0.0
        part = min(max(reached / self.t_end, 0.0), 1.0)
        self.stream.write(
            f"\r{bar(part)}  {reached:.0f} of {self.t_end:.0f} s  "
            f"{speed:.0f} x real time  {clock(left)} left \x1b[K"
        )
        self.stream.flush()

    def close(self) -> None:
        """End the line; nothing more is shown."""
        if self.shown:
            self.stream.write("\n")
            self.stream.flush()
        self.shown = False


class MemberProgress:
    """Part done of an ensemble, members a second, and remaining time, on one line.

    members: to be computed; done(): pieces that are, of `pieces`. Silent unless stderr is a terminal.
    """

    def __init__(self, members: int, done: Callable[[], int], pieces: int, quiet: bool = False):
        self.members, self.done, self.pieces, self.before = members, done, max(pieces, 1), done()
        self.shown = not quiet and sys.stderr.isatty()
        self._began = self._drawn = time.perf_counter()

    def show(self) -> None:
        """Redraw, five times a second at most."""
        now = time.perf_counter()
        if not self.shown or now - self._drawn < 0.2:
            return
        self._drawn = now
        part = (self.done() - self.before) / self.pieces
        speed = part * self.members / (now - self._began)
        left = clock((1.0 - part) * self.members / speed) if speed else "-:--"
        sys.stderr.write(f"\r{bar(part)}  {speed:.3g} members a second  {left} left \x1b[K")
        sys.stderr.flush()

    def close(self) -> None:
        """End the line."""
        if self.shown:
            sys.stderr.write("\n")
        self.shown = False


def bar(part: float) -> str:
    """The bar itself, and per cent."""
    done = round(part * WIDTH)
    return f"[{'#' * done}{'.' * (WIDTH - done)}] {100 * part:3.0f} %"


def clock(seconds: float) -> str:
    """h:mm:ss, or mm:ss."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes:02d}:{seconds:02d}"
