"""What measurements say of parameters: covariance, correlations, and the combination that is known least.

The Fisher information of independent normal noise is F = J^T J, with J in units of the noise, and the
covariance of the estimate is its inverse. Normalised by the lengths of the columns of J it is a matrix C
with ones on its diagonal; where C has an eigenvalue that is zero but for rounding, the measurements do not
tell the parameters of its eigenvector apart.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from esail_jax.array_types import Bool, Float

BLIND = 1e-13
"""Eigenvalue of the normalised information below which a combination is not seen: derivatives of a run are
right to about 1e-8 of their size, and an eigenvalue is a square."""

SHOWN = 0.1
"""Least weight with which a parameter is named in a combination."""


class Weakest(NamedTuple):
    """The combination of parameters that is known least, sum of w_i dp_i / |p_i|, as relative changes (of a
    parameter that is zero within its error: in units of the deviation that it would have if all others were
    known). sd: its standard deviation, infinite if it is not seen at all; words: what that means."""

    parameters: tuple[str, ...]
    weights: tuple[float, ...]
    sd: float
    words: str


class Uncertainty(NamedTuple):
    """covariance: of the parameters, in their units, infinite on the diagonal of those that are not seen;
    sd: their standard deviations; correlation: between -1 and 1."""

    covariance: Float[np.ndarray, "parameter parameter"]
    sd: Float[np.ndarray, " parameter"]
    correlation: Float[np.ndarray, "parameter parameter"]
    weakest: Weakest


def uncertainty_of(
    names: Sequence[str],
    values: Float[np.ndarray, " parameter"],
    jacobian: Float[np.ndarray, "cell parameter"],
) -> Uncertainty:
    """The uncertainty of an estimate. jacobian: of the residuals in units of their noise."""
    length = np.linalg.norm(jacobian, axis=0)
    scale = np.where(length > 0.0, length, 1.0)
    information = (jacobian / scale).T @ (jacobian / scale)
    eigenvalues, vectors = np.linalg.eigh(information)
    seen = eigenvalues > BLIND
    inverse = (vectors[:, seen] / eigenvalues[seen]) @ vectors[:, seen].T
    blind = (np.abs(vectors[:, ~seen]) > SHOWN).any(axis=1)
    covariance = inverse / np.outer(scale, scale)
    covariance[blind, blind] = np.inf
    sd = np.sqrt(np.diag(covariance))
    known = np.isfinite(sd)
    correlation = np.eye(len(sd))
    both = np.ix_(known, known)
    correlation[both] = covariance[both] / np.outer(sd[known], sd[known])
    return Uncertainty(covariance, sd, correlation, weakest_of(names, values, jacobian, length))


def weakest_of(
    names: Sequence[str],
    values: Float[np.ndarray, " parameter"],
    jacobian: Float[np.ndarray, "cell parameter"],
    length: Float[np.ndarray, " parameter"],
) -> Weakest:
    """The combination that is known least."""
    relative = np.abs(values) * length > 1.0
    scale = np.where(length > 0.0, length, 1.0)
    unit = np.where(relative, np.abs(values), 1.0 / scale)
    eigenvalues, vectors = np.linalg.eigh((jacobian / scale).T @ (jacobian / scale))
    if eigenvalues[0] <= BLIND:  # of normalised columns: units of parameters must not decide on this
        least, sd = vectors[:, 0] / scale / unit, np.inf
    else:
        _, singular, rows = np.linalg.svd(jacobian * unit, full_matrices=False)
        least, sd = rows[-1], float(1.0 / singular[-1])
    weights = least * np.sign(least[np.argmax(np.abs(least))]) / np.linalg.norm(least)
    signed = weights * np.where(relative, np.sign(values), 1.0)
    return Weakest(tuple(names), tuple(weights.tolist()), sd, in_words(names, relative, signed, sd))


def power(name: str, exponent: float) -> str:
    """A name with an exponent of two digits."""
    return name if abs(exponent - 1.0) < 0.005 else f"{name}^{exponent:.2g}"


def in_words(
    names: Sequence[str],
    relative: Bool[np.ndarray, " parameter"],
    weights: Float[np.ndarray, " parameter"],
    sd: float,
) -> str:
    """What the combination that is known least means. relative: whether a weight is that of d ln |p_i|; the
    others are those of parameters that are zero within their errors."""
    order = np.argsort(-np.abs(weights))
    chosen = [k for k in order if abs(weights[k]) >= SHOWN]
    shown = [names[k] for k in chosen]
    how = "not at all" if not np.isfinite(sd) else f"to {100.0 * sd:.2g} %"
    if len(chosen) == 1:
        if np.isfinite(sd) and not relative[chosen[0]]:
            how = "it is zero within its error"
        return f"{shown[0]} is known least: {how}"
    if len(chosen) == 2 and relative[chosen].all():
        # What changes least along d ln p = (a, b) is p_1^b p_2^-a.
        first, second = -weights[chosen[1]] / weights[chosen[0]], 1.0
        what = "product" if first > 0.0 else "quotient"
        pair = f"{power(shown[0], first)} {power(shown[1], second)}"
        if not np.isfinite(sd):
            return f"{shown[0]} and {shown[1]} can be told apart only by their {what} {pair}"
        return f"{shown[0]} and {shown[1]} are known least, but for their {what} {pair}: {how}"
    parts = " ".join(f"{weights[k]:+.2f} {names[k]}" for k in chosen)
    return f"the combination {parts} (relative changes) is known least: {how}"
