"""What an ensemble says: spread over its members at every instant, one number of every member, and which
input drives it. Members that did not reach their end are kept out."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from esail_jax.array_types import Float
from esail_jax.ensembles.members import Ensemble
from esail_jax.ensembles.sampling import Inputs

PROBABILITIES = (0.05, 0.25, 0.5, 0.75, 0.95)

PER_COLUMN = 10
"""Members that shares of variance need for every number that is varied: what chance adds to all of them
together is then a tenth of what is left unexplained, or less."""


class Spread(NamedTuple):
    """Of an observable over the members, time first; quantiles: probability before time."""

    mean: Float[np.ndarray, "time *some"]
    deviation: Float[np.ndarray, "time *some"]
    minimum: Float[np.ndarray, "time *some"]
    maximum: Float[np.ndarray, "time *some"]
    quantiles: Float[np.ndarray, "probability time *some"]


def spread(ensemble: Ensemble, name: str, probabilities: tuple[float, ...] = PROBABILITIES) -> Spread:
    """Mean, standard deviation, extremes and quantiles of an observable over the complete members."""
    rows = ensemble[name][ensemble.complete]
    if not len(rows):
        nothing = np.full(ensemble[name].shape[1:], np.nan)
        return Spread(*[nothing] * 4, np.stack([nothing] * len(probabilities)))
    quantiles = np.quantile(rows, probabilities, axis=0)
    return Spread(rows.mean(0), rows.std(0), rows.min(0), rows.max(0), quantiles)


@dataclasses.dataclass(frozen=True)
class Outcome:
    """One number of a member. of_rows: from an observable, (member, time, ...); factor: to `unit`."""

    label: str
    unit: str
    observable: str
    of_rows: Callable[[Float[np.ndarray, "member time *some"]], Float[np.ndarray, " member"]]
    factor: float = 1.0

    def of(self, ensemble: Ensemble) -> Float[np.ndarray, " member"]:
        """Of every member, NaN for those that did not reach their end."""
        values = self.factor * self.of_rows(ensemble[self.observable])
        return np.where(ensemble.complete, values, np.nan)


def largest(rows: Float[np.ndarray, "member time *some"]) -> Float[np.ndarray, " member"]:
    """Largest magnitude over time and components."""
    return np.abs(rows).reshape(len(rows), -1).max(1)


def smallest(rows: Float[np.ndarray, "member time *some"]) -> Float[np.ndarray, " member"]:
    return rows.reshape(len(rows), -1).min(1)


def last(rows: Float[np.ndarray, "member time"]) -> Float[np.ndarray, " member"]:
    return rows[:, -1]


def largest_length(rows: Float[np.ndarray, "member time 3"]) -> Float[np.ndarray, " member"]:
    """Of a vector, over time."""
    return np.linalg.norm(rows, axis=2).max(1)


def mean_length(rows: Float[np.ndarray, "member time 3"]) -> Float[np.ndarray, " member"]:
    return np.linalg.norm(rows, axis=2).mean(1)


DEGREES = 180.0 / np.pi

OUTCOMES = (
    Outcome("largest coning angle", "deg", "coning_angle", largest, DEGREES),
    Outcome("largest lagging angle", "deg", "lagging_angle", largest, DEGREES),
    Outcome("sailing angle at the end", "deg", "sailing_angle", last, DEGREES),
    Outcome("mean thrust", "mN", "thrust_O", mean_length, 1e3),
    Outcome("largest reaction moment", "N m", "reaction_moment_O", largest_length),
    Outcome("largest axial strain", "1e-6", "max_axial_strain", largest, 1e6),
    Outcome("smallest tether distance", "m", "smallest_tether_distance", smallest),
    Outcome("largest tension", "N", "tension", largest),
)
"""What is reported of every ensemble that has the observable."""


def outcomes_of(ensemble: Ensemble) -> list[Outcome]:
    """Those that an ensemble has the observable for, with numbers that differ."""
    return [x for x in OUTCOMES if x.observable in ensemble.rows and np.isfinite(x.of(ensemble)).any()]


class Drivers(NamedTuple):
    """By input. share: of the outcome's variance, in the best linear account of it (sum of squared
    standardised coefficients over the input's columns); correlation: with the input, with its sum over
    tethers where it has one per tether. explained: part of the variance that the linear account gives.
    Shares are NaN where there are fewer than PER_COLUMN members for each number that is varied: columns of
    few members are correlated by chance, and shares add up to more than there is."""

    share: dict[str, float]
    correlation: dict[str, float]
    explained: float


def drivers(inputs: Inputs, outcome: Float[np.ndarray, " member"]) -> Drivers:
    """Which inputs drive an outcome, by linear regression on members where it is known. NaN where there
    are too few, or nothing varies."""
    known = np.isfinite(outcome)
    y = outcome[known] - outcome[known].mean() if known.any() else outcome[known]
    columns = {key: x.reshape(len(x), -1)[known] for key, x in inputs.items()}
    columns = {key: x - x.mean(0) for key, x in columns.items()}
    together = np.concatenate([*columns.values()], axis=1) if columns else np.empty((len(y), 0))
    correlation = {key: correlated(x.sum(1), y) for key, x in columns.items()}
    if len(y) < PER_COLUMN * together.shape[1] or not y.any() or not columns:
        return Drivers(dict.fromkeys(columns, np.nan), correlation, np.nan)
    scale = np.where(together.std(0) > 0.0, together.std(0), 1.0)
    slopes, *_ = np.linalg.lstsq(together / scale, y, rcond=None)
    ends = np.cumsum([x.shape[1] for x in columns.values()])[:-1]
    squares = np.split((slopes / y.std()) ** 2, ends)
    share = {key: float(part.sum()) for key, part in zip(columns, squares, strict=True)}
    left = y - together / scale @ slopes
    return Drivers(share, correlation, float(1.0 - left.var() / y.var()))


def correlated(x: Float[np.ndarray, " member"], y: Float[np.ndarray, " member"]) -> float:
    """Pearson's coefficient; NaN where one of them does not vary."""
    if len(y) < 2 or not np.ptp(x) or not np.ptp(y):
        return float("nan")
    return float(np.corrcoef(x, y)[0, 1])
