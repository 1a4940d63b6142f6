"""Statistics of the steps, collected for every saved instant (the `numerics` of a run)."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from esail_jax.steppers.log import Log, Statistic

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
        """A table without steps."""
        return cls(np.zeros((0, 4 + len(statistics))))

    def with_steps(self, log: Log, statistics: Mapping[str, Statistic]) -> "Pending":
        """These steps, and those of a log."""
        columns = [log.end, log.taken, ~log.taken, log.size, *(log.statistics[name] for name in statistics)]
        new = np.stack([np.asarray(x, float)[log.tried] for x in columns], axis=1)
        return Pending(np.concatenate([self.table, new]))

    def merged(self, until: float, statistics: Mapping[str, Statistic]) -> "Pending":
        """The table with all steps that end at `until` [s] or before in one row, to keep it
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
        table, empty = self.table, np.zeros(len(times))
        taken = table[:, 1] > 0
        # The ends of taken steps increase; a rejected attempt goes with the next step that was taken.
        ends = np.minimum.accumulate(np.where(taken, table[:, 0], np.inf)[::-1])[::-1]
        cuts = np.searchsorted(ends, times, side="right")
        begins = np.append(0, cuts)[:-1]
        none = begins == cuts
        rows = np.append(table, np.zeros((1, table.shape[1])), axis=0)

        def over(combine: np.ufunc, column: int) -> np.ndarray:
            """Combines the rows from `begins` to `cuts` for every instant; 0 where there are none."""
            pairs = np.stack([begins, cuts], axis=1).ravel()
            return (
                np.where(none, 0.0, combine.reduceat(rows[:, column], pairs)[::2]) if len(times) else empty
            )

        values = {"steps": over(np.add, 1), "rejected_steps": over(np.add, 2)}
        # When an instant is passed, the step in which it lies is known, but not always the next step.
        accepted = np.flatnonzero(taken)
        within = np.searchsorted(accepted, np.searchsorted(ends, times, side="left"))
        values["last_step"] = empty
        later = times > begin
        values["last_step"][later] = table[accepted[within[later]], 3]
        for column, (name, how) in enumerate(statistics.items(), start=4):
            if how.over == "last":
                values[name] = np.where(none, 0.0, rows[cuts - 1, column])
            elif how.over == "largest":
                values[name] = over(np.maximum, column)
            else:
                values[name] = over(np.add, column) / np.maximum(values["steps"], 1.0)
        return values, Pending(table[cuts[-1] if len(times) else 0 :])

    def _together(self, part: np.ndarray, statistics: Mapping[str, Statistic]) -> np.ndarray:
        """Combines several rows in one, with sums instead of means."""
        over = [statistic.over for statistic in statistics.values()]
        ways: dict[str, Callable] = {"mean": np.sum, "largest": np.max, "last": lambda x: x[-1]}
        parts = [ways[way](part[:, 4 + i]) for i, way in enumerate(over)]
        return np.array([part[-1, 0], part[:, 1].sum(), part[:, 2].sum(), part[-1, 3], *parts])
