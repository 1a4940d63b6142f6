"""Statistics of the steps, put together for every saved instant."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from esail_jax.steppers.stepper import Log, Statistic

COUNTS = {"steps": "-", "rejected_steps": "-", "last_step": "s"}
"""Names and units of what every method reports for a saved instant: the steps that ended since the instant
before, those rejected meanwhile, and the size of the step in which the instant lies."""


class Pending(NamedTuple):
    """Attempted steps that belong to no saved instant yet: columns end [s], taken, rejected, size [s], and
    one for each statistic (row, column)."""

    table: np.ndarray

    @classmethod
    def empty(cls, statistics: Mapping[str, Statistic]) -> "Pending":
        """No steps."""
        return cls(np.zeros((0, 4 + len(statistics))))

    def with_steps(self, log: Log, statistics: Mapping[str, Statistic]) -> "Pending":
        """These steps, and those of a log."""
        columns = [log.end, log.taken, ~log.taken, log.size, *(log.statistics[name] for name in statistics)]
        new = np.stack([np.asarray(x, float)[log.tried] for x in columns], axis=1)
        return Pending(np.concatenate([self.table, new]))

    def merged(self, until: float, statistics: Mapping[str, Statistic]) -> "Pending":
        """The same with the steps that end at `until` [s] or before in one row, to keep the table short."""
        old = (self.table[:, 0] <= until).cumprod().astype(bool)
        if old.sum() < 2:
            return self
        return Pending(
            np.concatenate([self._together(self.table[old], statistics)[None], self.table[~old]])
        )

    def values(
        self, times: np.ndarray, statistics: Mapping[str, Statistic]
    ) -> tuple[dict[str, np.ndarray], "Pending"]:
        """The statistics for saved instants [s], and the steps that are left. A step belongs to the first
        instant after its end, a rejected one to the instant of the step taken after it."""
        table = self.table
        # The ends of taken steps increase; a rejected attempt goes with the next step that was taken.
        taken = np.where(table[:, 1] > 0, table[:, 0], np.inf)
        ends = np.minimum.accumulate(taken[::-1])[::-1] if len(table) else taken
        cuts = np.searchsorted(ends, times, side="right")
        # An instant at the end of a step lies in that step: the next one may not have been taken yet.
        reaching = np.searchsorted(ends, times, side="left")
        rows, before = [], 0
        for cut, reached in zip(cuts, reaching, strict=True):
            part = table[before:cut]
            following = table[reached:][table[reached:, 1] > 0, 3]
            size = following[0] if len(following) else (table[-1, 3] if len(table) else np.nan)
            rows.append([*self._numbers(part, statistics), size])
            before = max(before, cut)
        names = ["steps", "rejected_steps", *statistics, "last_step"]
        found = np.array(rows, float).reshape(len(times), len(names))
        columns = dict(zip(names, found.T, strict=True)) if len(times) else {n: np.zeros(0) for n in names}
        return {name: columns[name] for name in (*COUNTS, *statistics)}, Pending(table[before:])

    def _together(self, part: np.ndarray, statistics: Mapping[str, Statistic]) -> np.ndarray:
        """Several rows as one, sums in place of means."""
        over = [statistic.over for statistic in statistics.values()]
        ways = {"mean": np.sum, "largest": np.max, "last": lambda x: x[-1]}
        parts = [ways[way](part[:, 4 + i]) for i, way in enumerate(over)]
        return np.array([part[-1, 0], part[:, 1].sum(), part[:, 2].sum(), part[-1, 3], *parts])

    def _numbers(self, part: np.ndarray, statistics: Mapping[str, Statistic]) -> list[float]:
        """Steps, rejected steps and statistics of some rows."""
        if not len(part):
            return [0.0, 0.0, *[0.0] * len(statistics)]
        row = self._together(part, statistics)
        count = max(row[1], 1.0)
        values = zip(row[4:], statistics.values(), strict=True)
        return [row[1], row[2], *[x / count if how.over == "mean" else x for x, how in values]]
