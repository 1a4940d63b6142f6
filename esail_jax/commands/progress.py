"""What a command that takes long shows: a progress bar on a terminal or a line a
minute in a log file."""

import shutil
import sys
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from esail_jax.scenes.scene import Scene
    from esail_jax.simulation.results import Chunk


WIDTH = 20
"""Number of characters in the bar."""


REDRAW_SECONDS = 0.1
"""Least time between two drawings [s]."""


LOG_SECONDS = 60.0
"""Time between two lines of a log, and before the first one [s]."""


class Progress:
    """One line with a bar, what is done, the speed, and the remaining time.

    total: amount of work; describe(done, speed): texts beside the bar, the most important first, with the
    speed in work per second; quiet: draw nothing. The last texts are left out if the terminal is too
    narrow, because a line that wraps cannot be drawn over. The line is drawn on stderr, and only if that is
    a terminal. If it is none, every minute a line is printed on stdout, which a log file or that of a batch
    job keeps.
    """

    def __init__(
        self, total: float, describe: Callable[[float, float], Sequence[str]], quiet: bool = False
    ):
        self.total, self.describe, self.stream = total, describe, sys.stderr
        self.shown = not quiet and self.stream.isatty()
        self.logged = not quiet and not self.shown
        self._first: tuple[float, float] | None = None
        self._drawn = -float("inf") if self.shown else time.perf_counter()

    def stage(self, text: str) -> None:
        """Shows what is being prepared, before any work is done."""
        self._write(f"\r{text}\x1b[K")

    @property
    def due(self) -> bool:
        """True if the next `update` draws or prints."""
        since = time.perf_counter() - self._drawn
        return (self.shown and since >= REDRAW_SECONDS) or (self.logged and since >= LOG_SECONDS)

    def update(self, done: float) -> None:
        """Reports the amount of work done. The clock starts at the first call, so that the speed does not
        include compiling."""
        if self._first is None:
            self._first = (time.perf_counter(), done)
        if not (self.due or (self.shown and done >= self.total)):
            return
        now = self._drawn = time.perf_counter()
        began, before = self._first
        speed = (done - before) / max(now - began, 1e-9)
        left = clock((self.total - done) / speed) if speed > 0.0 else "-:--"
        part = min(max(done / self.total, 0.0), 1.0) if self.total > 0.0 else 1.0
        texts = self.describe(done, speed)
        if self.logged:
            print("  ".join([f"{100 * part:3.0f} %", *texts, f"{left} left"]), flush=True)
        self._write(f"\r{self._line(part, texts, left)} \x1b[K")

    def _line(self, part: float, texts: Sequence[str], left: str) -> str:
        """The line with as many of the texts as the terminal is wide enough for."""
        columns, shown = shutil.get_terminal_size().columns - 1, [*texts]
        while len(line := "  ".join([bar(part), *shown, f"{left} left"])) > columns and shown:
            shown.pop()
        return line

    def close(self) -> None:
        """Ends the line. Later calls draw nothing."""
        self._write("\n")
        self.shown = self.logged = False

    def _write(self, text: str) -> None:
        if self.shown:
            self.stream.write(text)
            self.stream.flush()


def bar(part: float) -> str:
    """A bar for the part done, 0 to 1, and the percentage."""
    done = round(part * WIDTH)
    return f"[{'#' * done}{'.' * (WIDTH - done)}] {100 * part:3.0f} %"


def clock(seconds: float) -> str:
    """A duration as h:mm:ss, or as mm:ss below an hour."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes:02d}:{seconds:02d}"


class RunProgress(Progress):
    """The line of a run: simulated time, speed, remaining time, and as far as the terminal is wide enough
    the length of the last step, the iterations per step and the error of the energy balance."""

    def __init__(self, scene: "Scene", quiet: bool = False):
        super().__init__(scene.integrator.t_end, self.texts, quiet)
        self.latest: Chunk | None = None

    def show(self, chunk: "Chunk") -> None:
        """Reports the newest results of the run."""
        self.latest = chunk
        self.update(chunk.reached)

    def texts(self, reached: float, speed: float) -> tuple[str, ...]:
        """The texts of the line, the most important first. reached: simulated time [s]; speed:
        simulated seconds per second."""
        texts = [f"{min(reached, self.total):.0f} of {self.total:.0f} s", f"{speed:.0f} x real time"]
        chunk = self.latest
        if chunk is None or not len(chunk.time):
            return tuple(texts)
        texts.append(f"step {chunk.numerics['last_step'][-1]:.3g} s")
        if "iterations_per_step" in chunk.numerics:
            texts.append(f"{chunk.numerics['iterations_per_step'][-1]:.1f} iterations")
        for name, unit in (("energy_balance_error", " J"), ("energy_error", "")):
            if name in chunk.observables:
                texts.append(f"energy error {np.abs(chunk.observables[name][-1]):.0e}{unit}")
                break
        return tuple(texts)
