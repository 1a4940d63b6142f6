"""Statistics of the steps, collected for every saved instant (the `numerics` of a run)."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from esail_jax.steppers.stepper import Log, Statistic

COUNTS = {"steps": "-", "rejected_steps": "-", "last_step": "s"}
"""Names and units of what every method reports for a saved instant: the steps that ended since the instant
before, those rejected meanwhile, and the size of the step in which the instant lies (the step that ends
there where two meet, 0 at the start of the run)."""


class Pending(NamedTuple):
    """Attempted steps that belong to no saved instant yet.

    table: one row per step, with the columns end [s], taken, rejected, size [s], and one per statistic."""

    table: np.ndarray

    @classmethod
    def empty(cls, statistics: Mapping[str, Statistic]) -> "Pending":
        """Returns a table without steps."""
        return cls(np.zeros((0, 4 + len(statistics))))

    def with_steps(self, log: Log, statistics: Mapping[str, Statistic]) -> "Pending":
        """These steps, and those of a log."""
        columns = [log.end, log.taken, ~log.taken, log.size, *(log.statistics[name] for name in statistics)]
        new = np.stack([np.asarray(x, float)[log.tried] for x in columns], axis=1)
        return Pending(np.concatenate([self.table, new]))

    def merged(self, until: float, statistics: Mapping[str, Statistic]) -> "Pending":
        """Returns the table with all steps that end at `until` [s] or before in one row, to keep it
        short."""
        old = (self.table[:, 0] <= until).cumprod().astype(bool)
        if old.sum() < 2:
            return self
        return Pending(
            np.concatenate([self._together(self.table[old], statistics)[None], self.table[~old]])
        )

    def values(
        self, times: np.ndarray, begin: float, statistics: Mapping[str, Statistic]
    ) -> tuple[dict[str, np.ndarray], "Pending"]:
        """The statistics for saved instants [s], and the steps that are left. A step belongs to the first
        instant after its end, a rejected one to the instant of the step taken after it. begin: the start of
        the run [s].

        The numbers do not depend on which later steps are known, so that they are the same however the run
        is divided into calls."""
        table = self.table
        # The ends of taken steps increase; a rejected attempt goes with the next step that was taken.
        taken = np.where(table[:, 1] > 0, table[:, 0], np.inf)
        ends = np.minimum.accumulate(taken[::-1])[::-1] if len(table) else taken
        cuts = np.searchsorted(ends, times, side="right")
        # All steps that reach an instant are known when it is passed, but not always the next one.
        first = np.searchsorted(ends, times, side="left")
        rows, before = [], 0
        for time, cut, reaches in zip(times, cuts, first, strict=True):
            around = table[reaches:][table[reaches:, 1] > 0]
            size = around[0, 3] if time > begin else 0.0
            rows.append([*self._numbers(table[before:cut], statistics), size])
            before = max(before, cut)
        names = ["steps", "rejected_steps", *statistics, "last_step"]
        found = np.array(rows, float).reshape(len(times), len(names))
        columns = dict(zip(names, found.T, strict=True)) if len(times) else {n: np.zeros(0) for n in names}
        return {name: columns[name] for name in (*COUNTS, *statistics)}, Pending(table[before:])

    def _together(self, part: np.ndarray, statistics: Mapping[str, Statistic]) -> np.ndarray:
        """Combines several rows in one, with sums instead of means."""
        over = [statistic.over for statistic in statistics.values()]
        ways: dict[str, Callable] = {"mean": np.sum, "largest": np.max, "last": lambda x: x[-1]}
        parts = [ways[way](part[:, 4 + i]) for i, way in enumerate(over)]
        return np.array([part[-1, 0], part[:, 1].sum(), part[:, 2].sum(), part[-1, 3], *parts])

    def _numbers(self, part: np.ndarray, statistics: Mapping[str, Statistic]) -> list[float]:
        """Returns the numbers of steps and rejected steps and the statistics of some rows."""
        if not len(part):
            return [0.0, 0.0, *[0.0] * len(statistics)]
        row = self._together(part, statistics)
        count = max(row[1], 1.0)
        values = zip(row[4:], statistics.values(), strict=True)
        return [row[1], row[2], *[x / count if how.over == "mean" else x for x, how in values]]
