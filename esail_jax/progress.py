"""A progress bar on a terminal."""

import sys
import time
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
        bar = "#" * round(part * WIDTH) + "." * (WIDTH - round(part * WIDTH))
        self.stream.write(
            f"\r[{bar}] {100 * part:3.0f} %  {reached:.0f} of {self.t_end:.0f} s  "
            f"{speed:.0f} x real time  {clock(left)} left \x1b[K"
        )
        self.stream.flush()

    def close(self) -> None:
        """End the line; nothing more is shown."""
        if self.shown:
            self.stream.write("\n")
            self.stream.flush()
        self.shown = False


def clock(seconds: float) -> str:
    """h:mm:ss, or mm:ss."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes:02d}:{seconds:02d}"
