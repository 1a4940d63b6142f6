"""Times of a run: saved instants, segments between switch times, and windows of instants; and the
statistics of the steps by saved instant.

The tests are pure Python over many random schedules; nothing is compiled.
"""

import itertools

import numpy as np
import pytest

from esail_jax.scenes.loading import load_scene
from esail_jax.simulation.schedule import (
    SNAP,
    Schedule,
    Windows,
    is_multiple,
    rounded_up,
    save_times,
    segments,
    switch_times,
)
from esail_jax.simulation.statistics import COUNTS, Pending
from esail_jax.steppers.log import Log, Statistic

RNG = np.random.default_rng(7)


def random_cases(count):
    """Yields (t_end, interval) with decimal and irregular ratios, for short and long runs."""
    for _ in range(count):
        interval = float(RNG.choice([0.1, 0.05, 0.02, 0.3, 1.0, 0.07, RNG.uniform(0.01, 2.0)]))
        ratio = RNG.choice([1, 2, 5, 50, 2.5, 0.5, 1 / 3, RNG.uniform(0.3, 60.0), RNG.integers(1, 500)])
        t_end = float(ratio * interval)
        yield float(RNG.choice([t_end, round(t_end, 2) or interval])), interval


CASES = list(random_cases(250))


def random_schedules():
    """Yields schedules, some with switch times on saved instants, between them, or outside the run."""
    for t_end, interval in CASES:
        times = save_times(t_end, interval)
        inside = RNG.uniform(0.0, t_end, size=RNG.integers(0, 4))
        switches = {
            *inside,
            *RNG.choice(times, size=RNG.integers(0, 3)),
            *RNG.choice([t_end, 2.0 * t_end], 1),
        }
        begin = float(RNG.choice([0.0, 0.0, times[len(times) // 2]]))
        saved = tuple(float(time) for time in times if time >= begin)
        ordered = tuple(sorted(float(time) for time in switches if time > 0.0))
        yield Schedule(saved, ordered, begin, int(RNG.choice([1, 4, 64])), int(RNG.choice([1, 3, 16, 50])))


SCHEDULES = list(random_schedules())


def used(schedule):
    """The windows of a schedule without those that follow its end, and the places of its times."""
    windows, number, place = schedule.plan()
    ends = windows.times[np.arange(len(windows.count)), windows.count - 1]
    count = np.argmax(ends == schedule.times[-1]) + 1
    return Windows(*(x[:count] for x in windows)), *(x[: len(schedule.times)] for x in (number, place))


PLANS = [(schedule, *used(schedule)) for schedule in SCHEDULES]


def instants_of(windows):
    """The instants of each window that matter."""
    return [row[:count] for row, count in zip(windows.times, windows.count, strict=True)]


# ---- saved instants and segments ----------------------------------------------------------------


def test_save_times_are_zero_the_multiples_of_the_interval_and_the_end():
    assert save_times(1.0, 0.25).tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert save_times(1.1, 0.25).tolist() == [0.0, 0.25, 0.5, 0.75, 1.0, 1.1]
    assert save_times(0.2, 0.25).tolist() == [0.0, 0.2]
    for t_end, interval in CASES:
        times = save_times(t_end, interval)
        assert times[0] == 0.0 and times[-1] == t_end
        assert (np.diff(times) > 0.5 * SNAP * interval).all()
        assert times[:-1].tolist() == [k * interval for k in range(len(times) - 1)]
        assert (len(times) - 1) * interval >= t_end * (1.0 - 2 * SNAP), "a multiple is missing"


def test_three_tenths_is_three_times_a_tenth():
    """The end of a run that differs from a multiple of the interval by rounding is saved once."""
    assert save_times(0.3, 0.1).tolist() == [0.0, 0.1, 0.2, 0.3]
    assert save_times(3 * 0.1, 0.1).tolist() == [0.0, 0.1, 0.2, 3 * 0.1]
    assert is_multiple(0.3, 0.1) and is_multiple(3 * 0.1, 0.1) and is_multiple(0.0, 0.1)
    assert not is_multiple(0.35, 0.1)


def test_a_longer_run_saves_the_same_instants():
    """All instants of a shorter run but its end are those of a longer one, bit for bit. The end is saved by
    longer runs if it is a multiple of the interval."""
    for t_end, interval in CASES:
        short, long = save_times(t_end, interval), save_times(1.7 * t_end + interval, interval)
        assert short[:-1].tolist() == long[: len(short) - 1].tolist()
        assert is_multiple(t_end, interval) == bool(
            np.isclose(long, t_end, rtol=0, atol=1e-7 * interval).any()
        )


def test_switch_times_are_events_edges_of_the_voltage_and_kinks_of_the_temperature():
    """Times in order, each once, without those at the start."""
    settings = {"event.time": [30.0, 10.0], "event.release": [2, 1], "tethers.count": 3}
    settings |= {"voltage.law": "on-off", "voltage.on": 0.0, "voltage.off": 10.0, "voltage.rise_time": 1.0}
    scene = load_scene("baseline", settings)
    assert switch_times(scene) == (10.0, 30.0)
    assert switch_times(scene.replace({"event": None})) == (10.0,)
    assert switch_times(load_scene("baseline")) == ()
    thrust = {"tip_thrust.force": 1e-3, "tip_thrust.on": 10.0, "tip_thrust.off": 50.0}
    scene = scene.replace(thrust | {"tip_thrust.rise_time": 5.0})
    assert switch_times(scene) == (10.0, 30.0, 50.0)
    heat = {"thermal.expansion": 2e-5, "thermal.reference_temperature": 300.0}
    heat |= {"thermal.time": [0.0, 20.0], "thermal.temperature": [300.0, 200.0]}
    assert switch_times(scene.replace(heat)) == (10.0, 20.0, 30.0, 50.0)


def test_segments_follow_each_other_from_switch_to_switch():
    """Segments cover the run without a gap; each knows the next switch time, also beyond the run."""
    for schedule in SCHEDULES:
        begin, end, switches = schedule.start, schedule.times[-1], schedule.switches
        found = segments(begin, end, switches)
        assert found[0].start == begin and found[-1].stop == end
        assert all(one.stop == after.start for one, after in itertools.pairwise(found))
        assert [part.start for part in found[1:]] == [time for time in switches if begin < time < end]
        assert [part.last for part in found] == [False] * (len(found) - 1) + [True]
        for part in found:
            assert part.until == min((time for time in switches if time > part.start), default=np.inf)
    (only,) = segments(0.0, 5.0, (5.0, 8.0))
    assert (only.start, only.stop, only.until, only.last) == (0.0, 5.0, 5.0, True)


# ---- windows of a traced run --------------------------------------------------------------------


def test_every_saved_time_stands_in_one_place():
    """The window and the place of every saved time hold that time, bit for bit, and differ from all
    others."""
    for schedule, windows, number, place in PLANS:
        assert (place < windows.count[number]).all()
        assert windows.times[number, place].tolist() == list(schedule.times)
        assert len(set(zip(number.tolist(), place.tolist(), strict=True))) == len(schedule.times)
        assert sorted(zip(number, place, strict=True)) == list(zip(number, place, strict=True))


def test_instants_increase_through_all_windows():
    """Each instant occurs once, in order, from the start to the end of the run; the room that is left in a
    window repeats its last instant."""
    for schedule, windows, *_ in PLANS:
        rows = instants_of(windows)
        instants = np.concatenate(rows)
        assert (np.diff(instants) > 0.0).all()
        assert instants[0] >= schedule.start and instants[-1] == schedule.times[-1]
        assert windows.times.shape == (len(rows), schedule.size)
        assert all(1 <= len(row) <= schedule.size for row in rows)
        for row, count in zip(windows.times, windows.count, strict=True):
            assert (row[count:] == row[count - 1]).all()


def test_windows_never_cross_a_switch_time():
    """Every switch time within the run ends a window; the next one begins there, and knows the next switch
    time."""
    for schedule, windows, *_ in PLANS:
        inner = [time for time in schedule.switches if schedule.start < time < schedule.times[-1]]
        rows, before = instants_of(windows), schedule.start
        for number, row in enumerate(rows):
            assert not [time for time in inner if before < time < row[-1]], "crosses a switch time"
            latest = max((time for time in inner if time <= before), default=schedule.start)
            assert windows.start[number] == latest
            later = [time for time in schedule.switches if time > latest]
            assert windows.until[number] == min(later, default=np.inf)
            before = row[-1]


def test_a_stepper_begins_afresh_after_events_only():
    """`begins` is true for the first window after each switch time, and for no other."""
    for schedule, windows, *_ in PLANS:
        rows = instants_of(windows)
        inner = [time for time in schedule.switches if schedule.start < time < schedule.times[-1]]
        expected = [False, *(row[-1] in inner for row in rows[:-1])]
        assert windows.after_switch.tolist() == expected
        assert windows.after_switch.sum() == len(inner)


def test_there_are_enough_windows_for_a_derivative():
    """At least `least` windows; between two of them lies at most a part 1/least of the run."""
    for schedule, windows, *_ in PLANS:
        length = schedule.times[-1] - schedule.start
        if length > 0.0:
            assert len(windows.times) >= schedule.least
            ends = [schedule.start, *(row[-1] for row in instants_of(windows))]
            assert np.diff(ends).max() <= length / schedule.least * (1.0 + 1e-12)


def test_numbers_are_rounded_up_to_five_binary_digits():
    """Rounded numbers stay as they are; others become at most a sixteenth, or seven, larger."""
    counts = np.arange(1, 5000)
    rounded = np.array([rounded_up(int(x)) for x in counts])
    assert (rounded >= counts).all() and (rounded - counts <= np.maximum(7, counts / 16)).all()
    assert all(rounded_up(int(x)) == x for x in set(rounded))
    assert len(set(rounded[500:])) < 60


def test_nothing_happens_in_the_windows_behind_the_end():
    """They hold the end of the run once more. Runs of nearly equal length have plans of equal shape."""
    for schedule in SCHEDULES:
        (windows, number, place), (inner, *_) = schedule.plan(), used(schedule)
        count = len(inner.count)
        assert len(windows.count) == rounded_up(count) and len(number) == rounded_up(len(schedule.times))
        assert (windows.times[count:] == schedule.times[-1]).all() and (windows.count[count:] == 1).all()
        assert not windows.after_switch[count:].any() and not windows.samples[count:].any()
        for x in (windows.start, windows.until):
            assert (x[count:] == x[count - 1]).all()
        for x in (number, place):
            assert (x[len(schedule.times) :] == x[len(schedule.times) - 1]).all()
    shapes = {
        tuple(np.shape(x) for x in (*plan.windows, plan.number))
        for plan in (
            Schedule(tuple((np.arange(n) * 10.0).tolist()), (), 0.0, 64, 16).plan() for n in (20, 21, 24)
        )
    }
    assert len(shapes) == 1


def test_a_run_of_one_instant_has_one_window():
    """A run that ends where it begins, for which only its start is saved."""
    windows, number, place = used(Schedule((3.0,), (), 3.0, 4, 16))
    assert instants_of(windows)[0].tolist() == [3.0] and len(windows.times) == 1
    assert (number.tolist(), place.tolist()) == ([0], [0])


# ---- statistics ---------------------------------------------------------------------------------

KINDS = {
    "iterations": Statistic("-", "mean"),
    "increment": Statistic("m", "largest"),
    "tip_error": Statistic("-", "last"),
}


def random_log(count):
    """Attempted steps in order, of which some are rejected and tried again with half the length,
    and some were not tried."""
    rows, time, size = [], 0.0, 0.5
    while len(rows) < count:
        good = bool(RNG.random() < 0.8) or len(rows) == count - 1
        rows.append((True, good, time + size, size))
        time, size = (time + size, 0.5) if good else (time, 0.5 * size)
        if RNG.random() < 0.1:
            rows.append((False, False, 0.0, 0.0))
    tried, taken, end, length = (np.array(x) for x in zip(*rows, strict=True))
    return Log(tried, taken, end, length, {name: RNG.random(len(rows)) for name in KINDS})


def part_of(log, begin, stop):
    """The attempts from `begin` to `stop` as a log of their own."""
    statistics = {name: x[begin:stop] for name, x in log.statistics.items()}
    return Log(*(x[begin:stop] for x in log[:4]), statistics)


def expected_of(log, times):
    """The statistics for every instant, from their definition and one loop over the steps."""
    found, before = [], -np.inf
    for time in times:
        attempts, rejected, sums, largest, last = 0, 0, 0.0, 0.0, 0.0
        waiting = []
        for row in np.flatnonzero(log.tried):
            waiting.append(row)
            if log.taken[row]:
                if before < log.end[row] <= time:
                    values = {name: x[waiting] for name, x in log.statistics.items()}
                    attempts, rejected = attempts + 1, rejected + len(waiting) - 1
                    sums += values["iterations"].sum()
                    largest, last = max(largest, values["increment"].max()), values["tip_error"][-1]
                waiting = []
        size = [
            s for t, s, end in zip(log.taken, log.size, log.end, strict=True) if t and end - s < time <= end
        ]
        found.append([attempts, rejected, size[0] if size else 0.0, sums / max(attempts, 1), largest, last])
        before = time
    return dict(zip([*COUNTS, *KINDS], np.array(found).T, strict=True))


def cut_into_calls(log, times, instants, blocks):
    """The statistics of a run that is made of calls, as `HostRun` makes them: each takes blocks of
    steps until its instants are passed."""
    pending, found, row, done, reached = Pending.empty(KINDS), [], 0, 0, 0.0
    while row < len(times):
        due = times[row : row + instants]
        begin, count = done, 0
        while reached < due[-1] and count < blocks:
            done, count = done + 4, count + 1
            ends = log.end[:done][log.taken[:done]]
            reached = ends[-1] if len(ends) else 0.0
        pending = pending.with_steps(part_of(log, begin, done), KINDS)
        passed = due[due <= reached]
        if len(passed):
            values, pending = pending.values(passed, 0.0, KINDS)
            found.append(values)
        if len(passed) < len(due):
            pending = pending.merged(reached, KINDS)
        row += len(passed)
    return {name: np.concatenate([values[name] for values in found]) for name in found[0]}


@pytest.mark.parametrize(("instants", "blocks"), [(1, 1), (1, 50), (3, 2), (7, 1), (1000, 1000), (5, 3)])
def test_statistics_of_an_instant_do_not_depend_on_the_calls(instants, blocks):
    """The statistics of every instant follow from their definition, however the run is cut into calls.

    Instants lie at the start, at ends of steps, within steps, and several in one step. Sums of up to
    some hundred numbers are exact to 1e-12.
    """
    for _ in range(10):
        log = random_log(300)
        end = log.end[log.taken][-1]
        ends = RNG.choice(log.end[log.taken], 20)
        times = np.unique(np.concatenate([[0.0], ends, RNG.uniform(0.0, end, 40)]))
        found, expected = cut_into_calls(log, times, instants, blocks), expected_of(log, times)
        assert list(found) == list(expected)
        for name, values in expected.items():
            np.testing.assert_allclose(found[name], values, rtol=1e-12, atol=0, err_msg=name)


def test_every_step_is_counted_once():
    """The counts of all instants add up to all steps that ended by the last of them."""
    log = random_log(200)
    times = np.linspace(0.0, log.end[log.taken][-1], 33)
    values, left = Pending.empty(KINDS).with_steps(log, KINDS).values(times, 0.0, KINDS)
    assert values["steps"].sum() == log.taken.sum()
    assert values["rejected_steps"].sum() == (log.tried & ~log.taken).sum()
    assert len(left.table) == 0
