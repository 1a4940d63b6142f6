"""Statistics of an ensemble: the spread over its members at every instant, one outcome per member, and the
sensitivity of outcomes to the inputs. Members that did not reach their end are left out."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from esail_jax.array_types import Float
from esail_jax.ensembles.ensemble import Ensemble
from esail_jax.ensembles.sampling import Inputs
from esail_jax.observables import described

PROBABILITIES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Probabilities of the quantiles in `Spread`."""

MEMBERS_PER_COLUMN = 10
"""Least number of members per varied number for shares of variance. With fewer members, chance correlations
let the linear model explain more than a tenth of what it cannot explain."""


class Spread(NamedTuple):
    """Spread of an observable over the members, time first. In `quantiles` the probability comes before
    time."""

    mean: Float[np.ndarray, "time *some"]
    deviation: Float[np.ndarray, "time *some"]
    minimum: Float[np.ndarray, "time *some"]
    maximum: Float[np.ndarray, "time *some"]
    quantiles: Float[np.ndarray, "probability time *some"]


def spread(ensemble: Ensemble, name: str, probabilities: tuple[float, ...] = PROBABILITIES) -> Spread:
    """Mean, standard deviation, extremes and quantiles of an observable over the complete members; NaN if
    no member is complete."""
    rows = ensemble[name][ensemble.complete]
    if not len(rows):
        nothing = np.full(ensemble[name].shape[1:], np.nan)
        return Spread(nothing, nothing, nothing, nothing, np.stack([nothing] * len(probabilities)))
    quantiles = np.quantile(rows, probabilities, axis=0)
    return Spread(rows.mean(0), rows.std(0), rows.min(0), rows.max(0), quantiles)


@dataclasses.dataclass(frozen=True)
class Outcome:
    """One number per member, made of an observable.

    of_rows: function of the observable's rows, (member, time, ...); factor: from SI units to `unit`."""

    label: str
    unit: str
    observable: str
    of_rows: Callable[[Float[np.ndarray, "member time *some"]], Float[np.ndarray, " member"]]
    factor: float = 1.0

    def of(self, ensemble: Ensemble) -> Float[np.ndarray, " member"]:
        """The outcome of every member, in `unit`; NaN for members that did not reach their end."""
        values = self.factor * self.of_rows(ensemble[self.observable])
        return np.where(ensemble.complete, values, np.nan)


def largest(rows: Float[np.ndarray, "member *some"]) -> Float[np.ndarray, " member"]:
    """Largest magnitude over time and components."""
    return np.abs(rows).reshape(len(rows), -1).max(1)


def smallest(rows: Float[np.ndarray, "member *some"]) -> Float[np.ndarray, " member"]:
    """Smallest value over time and components."""
    return rows.reshape(len(rows), -1).min(1)


def final(rows: Float[np.ndarray, "member time"]) -> Float[np.ndarray, " member"]:
    """Value at the last saved instant."""
    return rows[:, -1]


def largest_norm(rows: Float[np.ndarray, "member time 3"]) -> Float[np.ndarray, " member"]:
    """Largest length of a vector over time."""
    return np.linalg.norm(rows, axis=2).max(1)


def mean_norm(rows: Float[np.ndarray, "member time 3"]) -> Float[np.ndarray, " member"]:
    """Mean length of a vector over the saved instants."""
    return np.linalg.norm(rows, axis=2).mean(1)


DEGREES = 180.0 / np.pi
"""Degrees per radian."""

OUTCOMES = (
    Outcome("largest coning angle", "deg", "coning_angle", largest, DEGREES),
    Outcome("largest lagging angle", "deg", "lagging_angle", largest, DEGREES),
    Outcome("sailing angle at the end", "deg", "sailing_angle", final, DEGREES),
    Outcome("mean thrust", "mN", "thrust_O", mean_norm, 1e3),
    Outcome("largest reaction moment", "N m", "reaction_moment_O", largest_norm),
    Outcome("largest axial strain", "1e-6", "max_axial_strain", largest, 1e6),
    Outcome("smallest tether distance", "m", "smallest_tether_distance", smallest),
    Outcome("largest tension", "N", "tension", largest),
)
"""Outcomes that are reported for every ensemble that has the observable."""


def outcomes_of(ensemble: Ensemble) -> list[Outcome]:
    """The outcomes whose observable the ensemble has, and those of the numbers that stand for histories,
    with a finite value for at least one member."""
    reduced = [outcome_of_reduced(ensemble, name) for name in ensemble.reduced]
    known = [x for x in OUTCOMES if x.observable in ensemble.observables]
    return [x for x in (*known, *reduced) if np.isfinite(x.of(ensemble)).any()]


def outcome_of_reduced(ensemble: Ensemble, name: str) -> Outcome:
    """The outcome of a reduced observable: its component of largest magnitude, if it has several, or of
    smallest value after `min`."""
    observable, _, reduction = name.partition(".")
    unit = described(observable, ensemble.scene.chain is not None).unit
    if ensemble.reduced[name].ndim == 1:
        return Outcome(name, unit, name, lambda rows: rows)
    which = "smallest" if reduction == "min" else "largest"
    of_rows = smallest if reduction == "min" else largest
    return Outcome(f"{name}, {which}", unit, name, of_rows)


class Sensitivities(NamedTuple):
    """Sensitivities of an outcome to the inputs of an ensemble, by scene key, from a linear regression.

    share: part of the outcome's variance that belongs to an input, the sum over its columns of the
    standardised regression coefficient times the correlation with the outcome (for independent inputs the
    squared coefficient). The shares sum to `explained`, but that of an input without influence, which may
    come out slightly below zero by chance, is set to zero; correlation: Pearson's coefficient with the
    input, or with its sum over the tethers if it has one value per tether; explained: part of the variance
    that the linear model explains (R^2). Shares are NaN if there are fewer than MEMBERS_PER_COLUMN members
    per varied number: the linear model would then explain chance."""

    share: dict[str, float]
    correlation: dict[str, float]
    explained: float


def sensitivities(inputs: Inputs, outcome: Float[np.ndarray, " member"]) -> Sensitivities:
    """Sensitivities of an outcome to the inputs, by linear regression over the members whose outcome is
    finite. NaN if there are too few members, or if the outcome does not vary."""
    known = np.isfinite(outcome)
    y = outcome[known] - outcome[known].mean() if known.any() else outcome[known]
    columns = {key: x.reshape(len(x), -1)[known] for key, x in inputs.items()}
    columns = {key: x - x.mean(0) for key, x in columns.items()}
    matrix = np.concatenate([*columns.values()], axis=1) if columns else np.empty((len(y), 0))
    correlation = {key: pearson(x.sum(1), y) for key, x in columns.items()}
    if len(y) < MEMBERS_PER_COLUMN * matrix.shape[1] or not y.any() or not columns:
        return Sensitivities(dict.fromkeys(columns, np.nan), correlation, np.nan)
    scale = np.where(matrix.std(0) > 0.0, matrix.std(0), 1.0)
    matrix = matrix / scale
    slopes, *_ = np.linalg.lstsq(matrix, y, rcond=None)
    ends = np.cumsum([x.shape[1] for x in columns.values()])[:-1]
    products = np.split(slopes * (matrix.T @ y) / (y @ y), ends)
    share = {key: max(0.0, float(part.sum())) for key, part in zip(columns, products, strict=True)}
    residual = y - matrix @ slopes
    return Sensitivities(share, correlation, float(1.0 - residual.var() / y.var()))


def pearson(x: Float[np.ndarray, " member"], y: Float[np.ndarray, " member"]) -> float:
    """Pearson's correlation coefficient; NaN if one of the two does not vary."""
    if len(y) < 2 or not np.ptp(x) or not np.ptp(y):
        return float("nan")
    return float(np.corrcoef(x, y)[0, 1])
