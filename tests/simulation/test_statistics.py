"""Statistics of steps: every step belongs to one saved instant, however the run is divided into calls."""

import numpy as np
import pytest

from esail_jax.simulation.statistics import Pending
from esail_jax.steppers.log import Statistic

STATISTICS = {
    "iterations": Statistic("-", "mean"),
    "increment": Statistic("m", "largest"),
    "last_ratio": Statistic("-", "last"),
}


def steps(rng, count=200):
    """Steps with sizes of 0.1 to 1 s, a fifth of them rejected, in the columns of `Pending`."""
    taken = rng.random(count) < 0.8
    taken[-1] = True
    size = rng.uniform(0.1, 1.0, count)
    start = np.concatenate([[0.0], np.cumsum(np.where(taken, size, 0.0))[:-1]])
    numbers = [rng.integers(1, 9, count), rng.random(count), rng.random(count)]
    return np.stack([start + size, taken, ~taken, size, *numbers], axis=1)


def by_definition(table, times, begin):
    """The statistics with one loop over instants and one over steps, as their definitions say."""
    found, first = [], 0
    taken = np.flatnonzero(table[:, 1])
    for time in times:
        ended = [i for i in taken if i >= first and table[i, 0] <= time]
        stop = ended[-1] + 1 if ended else first
        part, first = table[first:stop], stop
        within = next(i for i in taken if table[i, 0] >= time)
        count = part[:, 1].sum()
        found.append(
            {
                "steps": count,
                "rejected_steps": part[:, 2].sum(),
                "last_step": table[within, 3] if time > begin else 0.0,
                "iterations": part[:, 4].sum() / max(count, 1.0),
                "increment": part[:, 5].max(initial=0.0),
                "last_ratio": part[-1, 6] if len(part) else 0.0,
            }
        )
    return {name: np.array([row[name] for row in found]) for name in found[0]}


@pytest.mark.parametrize("spacing", [0.03, 0.7, 5.0, 40.0])
def test_statistics_of_saved_instants(spacing):
    """Instants closer than steps, as close as steps, and further apart: every statistic agrees with a loop
    over its definition. Sums of integers are exact; 1e-15 is the rounding of the mean."""
    table = steps(np.random.default_rng(1))
    last = table[table[:, 1] > 0, 0].max()
    times = np.append(np.arange(0.0, last, spacing), last)
    values, left = Pending(table).values(times, 0.0, STATISTICS)
    expected = by_definition(table, times, 0.0)
    assert values.keys() == expected.keys()
    for name, value in values.items():
        np.testing.assert_allclose(value, expected[name], rtol=1e-15, err_msg=name)
    assert values["steps"].sum() == table[:, 1].sum()
    assert not len(left.table)


def test_statistics_do_not_depend_on_the_calls():
    """A run in one call and the same run in many calls report the same bits."""
    table = steps(np.random.default_rng(2))
    ends = np.maximum.accumulate(np.where(table[:, 1] > 0, table[:, 0], 0.0))
    times = np.arange(0.0, ends[-1], 1.3)
    together, _ = Pending(table).values(times, 0.0, STATISTICS)
    pending, first, parts = Pending.empty(STATISTICS), 0, []
    for cut in range(10, len(table) + 10, 10):
        pending = Pending(np.concatenate([pending.table, table[cut - 10 : cut]]))
        passed = int((times <= ends[min(cut, len(table)) - 1]).sum())
        values, pending = pending.values(times[first:passed], 0.0, STATISTICS)
        first = passed
        parts.append(values)
    for name, value in together.items():
        np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), value, err_msg=name)


def test_no_instant():
    """Without instants all steps are left."""
    table = steps(np.random.default_rng(3))
    values, left = Pending(table).values(np.zeros(0), 0.0, STATISTICS)
    assert all(x.shape == (0,) for x in values.values())
    np.testing.assert_array_equal(left.table, table)
