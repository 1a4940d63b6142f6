"""What is known of parameters before anything is measured: normal distributions."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from esail_jax.scenes.rules import SceneError

PRIORS = "priors"
"""The argument with priors, in messages."""

NORMAL = re.compile(r"normal:(?P<mean>[^:]+):(?P<sd>[^:]+)")


class Prior(NamedTuple):
    """A normal distribution of a parameter."""

    mean: float
    sd: float


def priors_of(priors: Mapping[str, Any] | None, names: Sequence[str]) -> dict[int, Prior]:
    """Priors by the index of a parameter. names: of all parameters. Raises SceneError."""
    known = {}
    for name, prior in (priors or {}).items():
        if name not in names:
            raise SceneError(PRIORS, f"be of free parameters ({', '.join(names)})", f"has {name!r}")
        known[names.index(name)] = as_prior(name, prior)
    return known


def as_prior(name: str, prior: Any) -> Prior:
    """A prior from `Prior(mean, sd)`, a pair, or a text "normal:MEAN:SD". Raises SceneError."""
    pair = prior
    if isinstance(prior, str):
        parts = NORMAL.fullmatch(prior.strip())
        pair = None if parts is None else (parts["mean"], parts["sd"])
    try:
        mean, sd = (float(x) for x in pair)
    except (TypeError, ValueError):
        must = "be normal:MEAN:SD, or a pair of numbers"
        raise SceneError(f"{PRIORS}[{name}]", must, f"is {prior!r}") from None
    if not (np.isfinite(mean) and 0.0 < sd < np.inf):
        raise SceneError(
            f"{PRIORS}[{name}]", "have a finite mean and a positive deviation", f"is {prior!r}"
        )
    return Prior(mean, sd)
