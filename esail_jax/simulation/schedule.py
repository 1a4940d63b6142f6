"""When to step, when to save: the plan of a run as a list of equal entries.

Every entry runs the same compiled program over the same number of steps, so a run compiles once,
whatever its length, and the host loop and a traced scan do the same arithmetic. An entry may use only
its first steps (`take`); a run, and the shorter last step before `t_end`, begin afresh:

    begin   read off the consistent acceleration of the state, save it if asked, step nowhere
    trial   (twice) take one step to find the jerk, from which a_0 = vdot(t_0 + (alpha_m - alpha_f) h)
    march   step, save
"""

import dataclasses

import numpy as np

from esail_jax.scenes.rules import known
from esail_jax.scenes.tables import Event, Voltage

SNAP = 1e-9
"""Part of a step by which a saved time may miss a step's end and still be that end: multiples of
decimal numbers are not exact in binary."""


@dataclasses.dataclass(frozen=True)
class Entry:
    """One call of the compiled program.

    start [s] and step [s]; `take` of its steps count. kind: "begin", "trial" or "march". rows:
    saved instants as (time [s], step index k, part of the step theta in (0, 1]). The last entry
    before a new beginning hands over the state after `take` steps (`hand_over`).
    """

    kind: str
    start: float
    step: float
    take: int
    rows: tuple[tuple[float, int, float], ...] = ()
    hand_over: bool = False

    @property
    def end(self) -> float:
        """Time reached [s]."""
        return self.start + self.take * self.step


@dataclasses.dataclass(frozen=True)
class Plan:
    """A run's entries, and what they have in common."""

    entries: tuple[Entry, ...]
    steps_per_entry: int
    rows_per_entry: int
    between: bool  # are saved instants possible that are not the end of a step?


def save_times(t_end: float, interval: float) -> np.ndarray:
    """0, every multiple of `interval` before `t_end`, and `t_end` [s]."""
    count = int(np.ceil(t_end / interval * (1.0 - SNAP)))
    return np.append(np.arange(count) * interval, t_end)


def steps_per_entry(unknowns: int, step: float, interval: float, block: int) -> int:
    """Steps of an entry, a multiple of `block`, from the scene alone (never from `t_end`): about
    at most some tenths of a second of work, and no more than some hundred saved instants."""
    by_work = max(1, min(20, 40_000 // unknowns))
    by_rows = max(1, int(100 * interval / (block * step)))
    return block * min(by_work, by_rows)


def rows_per_entry(steps: int, step: float, interval: float) -> int:
    """Most saved instants an entry can hold, and one for handing over."""
    return int(np.ceil(steps * step / interval)) + 2


def beginning(start: float, step: float, save: bool) -> list[Entry]:
    """Entries that make a state ready to march."""
    rows = ((start, 0, 0.0),) if save else ()
    trial = Entry("trial", start, step, 1)
    return [Entry("begin", start, step, 0, rows, hand_over=True), trial, trial]


def marching(start: float, count: int, step: float, steps: int, times: np.ndarray) -> list[Entry]:
    """Entries that take `count` steps from `start`; saved are the `times` within."""
    entries = []
    for done in range(0, count, steps):
        take = min(steps, count - done)
        origin = start + done * step
        first, last = np.searchsorted(times, origin + step * np.array([SNAP, take + SNAP]))
        position = (times[first:last] - origin) / step
        rows = []
        for time, x in zip(times[first:last], position, strict=True):
            k = min(int(np.ceil(x - SNAP)) - 1, take - 1)
            theta = 1.0 if abs(x - k - 1) < SNAP * max(1.0, abs(x)) * 10 else float(x - k)
            rows.append((float(time), k, theta))
        entries.append(Entry("march", origin, step, take, tuple(rows), hand_over=take < steps))
    return entries


def stretch(
    start: float, end: float, step: float, steps: int, times: np.ndarray, save_start: bool
) -> list[Entry]:
    """Entries from `start` to `end` with steps of `step`, the last one shorter if it must be."""
    count = int(np.floor((end - start) / step * (1.0 + SNAP) + SNAP))
    rest = end - start - count * step
    entries = beginning(start, step, save_start)
    entries += marching(start, count, step, steps, times)
    if rest > SNAP * step:
        last = start + count * step
        if count and not entries[-1].hand_over:
            entries[-1] = dataclasses.replace(entries[-1], hand_over=True)
        entries += beginning(last, rest, False) + marching(last, 1, rest, steps, times)
    return entries


def stops(t_end: float, event: Event | None, voltage: Voltage | None = None) -> tuple[float, ...]:
    """Where a run begins afresh, in order, and its end [s]: at events and, with `voltage`, where that
    begins to rise or fall; instants under a trace have no value, and the steps find them."""
    times = set() if event is None else set(event.time)
    for switched in () if voltage is None else (voltage.on, voltage.off):
        if switched is not None and known(switched) is not None:
            times |= set(known(switched).ravel().tolist())
    return (*sorted(time for time in times if 0.0 < time < t_end), t_end)


def next_switch(stops: tuple[float, ...], time: float) -> float:
    """When something is switched after `time`, infinite if never: a run's end is no such instant."""
    return min((stop for stop in stops[:-1] if stop > time), default=np.inf)


def is_multiple(time: float, step: float) -> bool:
    """Is a time a whole number of steps, to rounding?"""
    ratio = time / step
    return abs(ratio - round(ratio)) <= SNAP * ratio


def plan(
    t_end: float, step: float, interval: float, unknowns: int, block: int, event: Event | None = None
) -> Plan:
    """The plan of a whole run, which begins afresh at every event."""
    steps = steps_per_entry(unknowns, step, interval, block)
    times, start, entries = save_times(t_end, interval), 0.0, []
    for stop in stops(t_end, event):
        part = times[(times > start) & (times <= stop)]
        entries += stretch(start, stop, step, steps, part, not entries)
        start = stop
    # Steps after an event are counted from it.
    between = not all(is_multiple(x, step) for x in (interval, *stops(t_end, event)[:-1]))
    return Plan(tuple(entries), steps, rows_per_entry(steps, step, interval), between)
