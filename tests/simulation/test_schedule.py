"""The plan of a run with fixed steps: saved instants, steps and compiled calls.

The tests are pure Python over many random schedules; nothing is compiled.
"""

import itertools

import numpy as np
import pytest

from esail_jax.simulation.schedule import SNAP, beginning, plan, save_times, steps_per_entry

RNG = np.random.default_rng(7)


def random_cases(count):
    """Yields (t_end, step, interval, unknowns, block) with decimal and irregular ratios, for short and
    long runs."""
    for _ in range(count):
        step = float(RNG.choice([0.1, 0.05, 0.02, 0.3, 1.0, 0.07, RNG.uniform(0.01, 2.0)]))
        ratio = RNG.choice([1, 2, 5, 50, 2.5, 0.5, 1 / 3, RNG.uniform(0.3, 60.0)])
        interval = float(ratio * step)
        steps = RNG.choice([1, 3, 20, 400, 401, 1200, int(RNG.integers(1, 2000))])
        t_end = float(steps * step + RNG.choice([0.0, 0.0, 0.5 * step, RNG.uniform(0.0, step)]))
        t_end = float(RNG.choice([t_end, round(t_end, 2) or step, 0.3 * step]))
        yield t_end, step, interval, int(RNG.choice([36, 432, 5000, 20000])), int(RNG.choice([1, 8, 20]))


CASES = list(random_cases(250))
PLANS = [(case, plan(*case)) for case in CASES]


def rows_of(layout):
    """Returns all saved rows, each with its entry."""
    return [(entry, row) for entry in layout.entries for row in entry.rows]


def full(entry, step):
    """Tells whether any longer run has this entry, too."""
    return entry.kind == "march" and entry.step == step and not entry.hand_over


def test_save_times_are_zero_the_multiples_of_the_interval_and_the_end():
    assert save_times(1.0, 0.25).tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert save_times(1.1, 0.25).tolist() == [0.0, 0.25, 0.5, 0.75, 1.0, 1.1]
    assert save_times(0.2, 0.25).tolist() == [0.0, 0.2]
    for t_end, _, interval, *_ in CASES:
        times = save_times(t_end, interval)
        assert times[0] == 0.0 and times[-1] == t_end
        assert (np.diff(times) > 0.5 * SNAP * interval).all()
        assert times[:-1].tolist() == [k * interval for k in range(len(times) - 1)]
        assert (len(times) - 1) * interval >= t_end * (1.0 - 2 * SNAP), "a multiple is missing"


def test_three_tenths_is_three_times_a_tenth():
    """A saved time that differs from the end of a step by rounding is saved once, as that end."""
    layout = plan(0.9, 0.1, 0.3, 432, 20)
    assert not layout.between
    assert [(round(time, 12), k, theta) for _, (time, k, theta) in rows_of(layout)] == [
        (0.0, 0, 0.0), (0.3, 2, 1.0), (0.6, 5, 1.0), (0.9, 8, 1.0),
    ]  # fmt: skip
    assert [entry.kind for entry in layout.entries] == ["begin", "trial", "trial", "march"]


def test_every_saved_time_appears_exactly_once_and_in_order():
    for case, layout in PLANS:
        assert [row[0] for _, row in rows_of(layout)] == save_times(case[0], case[2]).tolist(), case


def test_step_index_and_part_of_the_step_give_the_saved_time_again():
    for case, layout in PLANS:
        for entry, (time, k, theta) in rows_of(layout):
            if entry.kind == "begin":
                assert (time, k, theta) == (0.0, 0, 0.0)
                continue
            assert 0 <= k < entry.take and 0.0 < theta <= 1.0
            assert time == pytest.approx(
                entry.start + (k + theta) * entry.step, rel=1e-12, abs=1e-8 * case[1]
            )


def test_times_between_steps_are_announced():
    """`between` is false only if no saved instant needs interpolation, because the program then has
    none."""
    for case, layout in PLANS:
        if not layout.between:
            assert {theta for _, (_, _, theta) in rows_of(layout)} <= {0.0, 1.0}, case
    assert plan(10.0, 0.1, 0.25, 36, 20).between
    assert not plan(10.0, 0.1, 0.7, 36, 20).between


def test_steps_add_up_to_the_whole_run():
    """Entries that integrate follow each other without a gap; all have `step`, but the last may be
    shorter."""
    for case, layout in PLANS:
        t_end, step, *_ = case
        marches = [entry for entry in layout.entries if entry.kind == "march"]
        short = [entry for entry in marches if entry.step != step]
        whole = sum(entry.take for entry in marches if entry.step == step)
        assert len(short) <= 1 and all(entry.take == 1 and 0 < entry.step < step for entry in short)
        assert short == marches[-1:] or not short
        total = whole * step + sum(entry.step for entry in short)
        assert total == pytest.approx(t_end, rel=1e-12, abs=2 * SNAP * step)
        assert whole == int(np.floor(t_end / step * (1 + SNAP) + SNAP))
        assert marches[0].start == 0.0
        for one, next_one in itertools.pairwise(marches):
            assert next_one.start == pytest.approx(one.end, rel=1e-12)


def test_entries_fit_the_program_they_share():
    """No entry takes more steps or saves more instants than its program can hold.

    One row is reserved for the state that is passed on.
    """
    for case, layout in PLANS:
        assert layout.steps_per_entry % case[4] == 0
        for entry in layout.entries:
            assert 0 <= entry.take <= layout.steps_per_entry
            assert len(entry.rows) < layout.rows_per_entry


def test_every_stretch_begins_afresh_and_hands_over_before_the_next():
    """A run, and a shorter last step, start with the entries begin, trial, trial.

    The entry before such a start passes on its state.
    """
    for _, layout in PLANS:
        entries = layout.entries
        starts = [i for i, entry in enumerate(entries) if entry.kind == "begin"]
        assert starts[0] == 0
        for i in starts:
            assert [entry.kind for entry in entries[i : i + 3]] == ["begin", "trial", "trial"]
            assert i == 0 or entries[i - 1].hand_over or entries[i - 1].kind == "trial"
        for i, entry in enumerate(entries):
            if entry.kind == "march" and entry.take < layout.steps_per_entry:
                assert entry.hand_over, "an unfinished block cannot be continued"
                assert i == len(entries) - 1 or entries[i + 1].kind == "begin"


def test_a_longer_run_starts_with_the_entries_of_a_shorter_one():
    """Full entries of a shorter run have the same place and rows in the plan of a longer run.

    There a run can be continued bit for bit. Only the row at the shorter run's t_end differs.
    """
    compared = 0
    for case, short in PLANS:
        t_end, step, interval, unknowns, block = case
        for longer in (t_end + 0.4 * step, 1.7 * t_end, t_end + 3 * interval):
            long = plan(longer, step, interval, unknowns, block)
            assert (long.steps_per_entry, long.rows_per_entry) == (
                short.steps_per_entry,
                short.rows_per_entry,
            )
            for i, entry in enumerate(short.entries):
                if entry.start + entry.take * entry.step > t_end * (1 - SNAP):
                    continue  # this entry ends at t_end, which only this plan saves
                if full(entry, step) or i < 3:
                    assert long.entries[i] == entry, (case, longer, i)
                    compared += 1
    assert compared > 500


def test_length_of_entries_does_not_depend_on_the_end():
    """The length of entries does not depend on t_end, so that all runs share one program.

    An entry has at most about a hundred saved instants.
    """
    for _, step, interval, unknowns, block in CASES:
        steps = steps_per_entry(unknowns, step, interval, block)
        assert steps >= block and steps % block == 0
        assert steps == block or steps * step <= 100.0001 * interval


def test_a_beginning_saves_its_start_only_when_asked():
    assert [len(entry.rows) for entry in beginning(1.0, 0.1, True)] == [1, 0, 0]
    assert [len(entry.rows) for entry in beginning(1.0, 0.1, False)] == [0, 0, 0]
