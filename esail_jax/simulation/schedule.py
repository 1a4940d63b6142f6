"""The times of a run: saved instants, switch times, and the windows of instants of a traced run."""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from esail_jax.array_types import Array, Bool, Float, Int
from esail_jax.scenes.control_period import control_period
from esail_jax.scenes.parts import parts_of
from esail_jax.scenes.rules import SceneError, known
from esail_jax.scenes.scene import Scene

SNAP = 1e-9
"""Fraction of an interval by which a time may miss a multiple of it: multiples of decimal fractions are
rounded in binary."""

MOST_SAMPLES = 10**6
"""Largest number of samples of a law in a run: two years of one a minute."""


def save_times(t_end: float, interval: float) -> np.ndarray:
    """The saved instants [s]: 0, every multiple of `interval` before `t_end`, and `t_end`."""
    count = int(np.ceil(t_end / interval * (1.0 - SNAP)))
    return np.append(np.arange(count) * interval, t_end)


def is_multiple(time: float, interval: float) -> bool:
    """Tells whether a time is a whole number of intervals, except for rounding (SNAP)."""
    ratio = time / interval
    return bool(abs(ratio - round(ratio)) <= SNAP * max(1.0, ratio))


def switch_times(scene: Scene, end: float | None = None) -> tuple[float, ...]:
    """The switch times [s] in increasing order, at which the stepper is initialised again. end: of
    the run [s], that of the scene if None.

    They are the instants at which the motion has a kink by a part of the scene (`Part.switches`), such as
    those of events, every multiple of the interval after which a part starts the stepper anew
    (`Part.every`), and the sampling instants of a user's laws, if they are positive. A time that is
    a tracer has no value yet: see `divided_at`."""
    times = set()
    for instants in instants_of(scene).values():
        if known(instants) is not None:
            times |= set(known(instants).ravel().tolist())
    end = scene.integrator.t_end if end is None else end
    for part in parts_of(scene.model).values():
        if part.every is not None and scene.has(part.name):
            times |= set(np.arange(part.every, end, part.every).tolist())
    samples, clock = sampling_instants(scene, end), control_period(scene)
    if samples and clock is not None:
        times = {time for time in times if not is_multiple(time, clock[1])} | set(samples)
    return tuple(sorted(time for time in times if time > 0.0))


def sampling_instants(scene: Scene, end: float | None = None) -> tuple[float, ...]:
    """The sampling instants [s] of a user's laws after the start: all multiples of their
    period until the end of the run [s], that of the scene if None. Raises SceneError if they are more than
    MOST_SAMPLES. A switch time that differs from one of them by rounding only is replaced by it."""
    clock = control_period(scene)
    if clock is None:
        return ()
    name, period = clock
    last = (scene.integrator.t_end if end is None else end) / period * (1.0 + SNAP)
    if last > MOST_SAMPLES:
        raise SceneError(name, f"leave at most {MOST_SAMPLES:.0e} samples", f"is {period:g}")
    return tuple((np.arange(1, int(last) + 1) * period).tolist())


def divided_at(scene: Scene) -> tuple[str, ...]:
    """The keys of switch times that divide a run although they are tracers, without a value until
    the program runs (`divided_windows.py`)."""
    return tuple(key for key, x in instants_of(scene).items() if known(x) is None)


def instants_of(scene: Scene) -> dict[str, Any]:
    """The switch times that the scene's tables give, by key."""
    parts = parts_of(scene.model).values()
    keys = [
        (part.name, name) for part in parts for name in part.switches if scene.has(f"{part.name}.{name}")
    ]
    return {f"{table}.{name}": getattr(getattr(scene, table), name) for table, name in keys}


@dataclasses.dataclass(frozen=True)
class Segment:
    """A part of a run that contains no switch time in its interior.

    start, stop [s]; until: the next switch time after `start` [s], even if the run ends before it
    (infinite if there is none); last: true for the segment at the end of the run."""

    start: float
    stop: float
    until: float
    last: bool


def segments(start: float, end: float, switches: Sequence[float]) -> list[Segment]:
    """The segments of a run from `start` to `end` [s], in order."""
    inner = [time for time in switches if start < time < end]
    starts, stops = [start, *inner], [*inner, end]
    known = np.append(np.sort(np.asarray(switches, float)), np.inf)
    later = known[np.searchsorted(known, starts, side="right")].tolist()
    last = [stop == end for stop in stops]
    return [Segment(*values) for values in zip(starts, stops, later, last, strict=True)]


# ---- windows of a traced run --------------------------------------------------------------------


class Windows(NamedTuple):
    """The windows of a traced run. The first axis is `window`.

    times: instants [s]; count: how many of them are used, the others repeat the last; start: the start of
    the segment that contains the window [s]; after_switch: true if the window is the first one after a
    switch time; until: the next switch time [s]; samples: true if the window begins at a sampling
    instant."""

    times: Float[Array | np.ndarray, "window instant"]
    count: Int[Array | np.ndarray, " window"]  # type: ignore[assignment]  # hides `tuple.count`
    start: Float[Array | np.ndarray, " window"]
    after_switch: Bool[Array | np.ndarray, " window"]
    until: Float[Array | np.ndarray, " window"]
    samples: Bool[Array | np.ndarray, " window"]


class Plan(NamedTuple):
    """The windows of a traced run as arguments of its program, and for every saved time the index of its
    window and its place in that window (both with the axis `time`)."""

    windows: Windows
    number: Int[Array | np.ndarray, " time"]
    place: Int[Array | np.ndarray, " time"]


@dataclasses.dataclass(frozen=True)
class Schedule:
    """The times of a traced run.

    times: the saved instants [s]; switches: the switch times [s]; start: the start [s]; size: the largest
    number of instants in a window; least: the least number of windows; divided: keys of traced numbers of
    the scene at whose instants the run is divided, too; samples: the switch times that are sampling
    instants of a voltage law. Windows also contain instants that are not saved: the ends of segments, and
    cuts that divide the run into enough windows for its derivative."""

    times: tuple[float, ...]
    switches: tuple[float, ...]
    start: float
    size: int
    least: int
    divided: tuple[str, ...] = ()
    samples: tuple[float, ...] = ()

    @property
    def is_switched(self) -> bool:
        """Tells whether the run has a switch time, or may have one."""
        return bool(self.divided) or any(self.start < time < self.times[-1] for time in self.switches)

    def plan(self) -> Plan:
        """The windows of the run. Further windows follow, at the end of the run, in which nothing
        happens, and the last saved time is repeated: the numbers of both are rounded up (`rounded_up`), so
        that one program serves runs of several lengths."""
        rows: list[tuple] = []
        where: dict = {}
        end, times = self.times[-1], np.array(self.times)
        for segment in segments(self.start, end, self.switches):
            share = (segment.stop - segment.start) / max(end - self.start, 1e-300)
            cuts = segment.start + (segment.stop - segment.start) * (
                np.arange(1, max(1, int(np.ceil(self.least * share))))
                / max(1, int(np.ceil(self.least * share)))
            )
            first = segment.start == self.start
            low, high = np.searchsorted(times, (segment.start, segment.stop), side="right")
            saved = self.times[0 if first else low : high]
            ends = {*cuts.tolist(), segment.stop}
            window: list[float] = []
            switched = not first
            for time in sorted({*saved, *ends}):
                window.append(time)
                where[time] = (len(rows), len(window) - 1)
                if len(window) == self.size or time in ends:
                    rows.append((window, segment.start, switched, segment.until))
                    window, switched = [], False
        last = rows[-1]
        rows += [([end], last[1], False, last[3])] * (rounded_up(len(rows)) - len(rows))
        padded = np.array([[*w, *[w[-1]] * (self.size - len(w))] for w, *_ in rows])
        count = np.array([len(w) for w, *_ in rows])
        start, after_switch, until = (np.array([row[i] for row in rows]) for i in (1, 2, 3))
        samples = after_switch & np.isin(start, self.samples)
        index = np.array([where[time] for time in self.times])
        number, place = (repeated(x, rounded_up(len(index))) for x in index.T)
        return Plan(Windows(padded, count, start, after_switch, until, samples), number, place)


def rounded_up(count: int) -> int:
    """The next number that is a multiple of eight and has at most five binary digits before its
    zeros: at most seven, or a sixteenth, larger."""
    step = max(8, 2 ** (count.bit_length() - 5))
    return -(-count // step) * step


def repeated(values: np.ndarray, count: int) -> np.ndarray:
    """`count` values, of which the last ones repeat the last one given."""
    return np.append(values, np.repeat(values[-1:], count - len(values), 0), 0)
