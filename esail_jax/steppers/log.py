"""The log of the steps of a run in numbers: which steps were taken, how long they were, and what the method
reports about them."""

from collections.abc import Iterable
from typing import Literal, NamedTuple

import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Bool, Float


class Statistic(NamedTuple):
    """A number that is saved for every instant beside the observables (`numerics`).

    unit: its unit, "-" for none; over: how the values of the steps since the previous instant are combined:
    their mean, the largest, or the last."""

    unit: str
    over: Literal["mean", "largest", "last"]


class Log(NamedTuple):
    """The attempted steps of a block in numbers, in the order of time. The first axis is `attempt`.

    tried: false for places after the block's last attempt; taken: false for a rejected step; end, size:
    time at the end of the step and its length [s]; statistics: the method's other numbers, by the names
    in `AbstractStepper.statistics` (and more, which `failure` may use)."""

    tried: Bool[Array, "*attempt"]
    taken: Bool[Array, "*attempt"]
    end: Float[Array, "*attempt"]
    size: Float[Array, "*attempt"]
    statistics: dict[str, Float[Array, "*attempt"]]

    def table(self) -> Float[Array, "*attempt column"]:
        """The log as one array, which a loop stores faster than many. Columns: end, size, and the
        statistics in alphabetical order. A rejected step has a negative size, an unused place the size
        0."""
        size = jnp.where(self.taken, self.size, jnp.where(self.tried, -self.size, 0.0))
        columns = [self.end, size, *(self.statistics[name] for name in sorted(self.statistics))]
        return jnp.stack(columns, axis=-1)

    @classmethod
    def from_table(cls, table: Float[np.ndarray, "*attempt column"], names: Iterable[str]) -> "Log":
        """The log that `table` has written, as NumPy arrays. names: names of the statistics."""
        end, size, *others = np.moveaxis(table, -1, 0)
        statistics = dict(zip(sorted(names), others, strict=True))
        return cls(size != 0.0, size > 0.0, end, np.abs(size), statistics)
