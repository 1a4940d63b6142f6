"""Files of a fit: fit.json, the result, and progress.json, the best point so far of a fit that has not
ended."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from esail_jax.atomic_file import atomic_file
from esail_jax.files.opening import ArgumentError, RunFileError
from esail_jax.identification.fit import Best, Fit

RESULT, PROGRESS = "fit.json", "progress.json"


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Writes a file as a whole. Numbers that are not finite are null."""
    with atomic_file(path) as part:
        part.write_text(json.dumps(plain(content), indent=1, allow_nan=False) + "\n", encoding="utf-8")


def plain(value: Any) -> Any:
    """A value of lists, numbers and texts for JSON."""
    if isinstance(value, Mapping):
        return {key: plain(x) for key, x in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(x) for x in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value


def result_of(fit: Fit, profiles: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
    """The result of a fit for its file. profiles: intervals by parameter."""
    weakest = fit.weakest
    return {
        "parameters": list(fit.parameters),
        "units": list(fit.units),
        "values": fit.values,
        "sd": fit.sd,
        "covariance": fit.covariance,
        "correlation": fit.correlation,
        "chi_squared": fit.chi_squared,
        "degrees_of_freedom": fit.degrees_of_freedom,
        "probability": fit.probability,
        "weakest": {
            "parameters": list(weakest.parameters), "weights": list(weakest.weights), "sd": weakest.sd,
            "words": weakest.words,
        },
        "profile": {name: list(ends) for name, ends in profiles.items()},
        "warnings": list(fit.warnings),
        "evaluations": fit.evaluations,
    }  # fmt: skip


def write_progress(path: Path, best: Best, identity: Mapping[str, Any]) -> None:
    """Writes the best point so far. identity: what tells the fit from others."""
    content = {"values": best.values, "cost": best.cost, "evaluations": best.evaluations}
    write_json(path, {**content, **identity})


def read_progress(path: Path, identity: Mapping[str, Any]) -> Sequence[float]:
    """The best point of a fit that has not ended. Raises RunFileError for a file that is none, and
    ArgumentError for that of another fit."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        values = [float(x) for x in content["values"]]
    except (ValueError, KeyError, TypeError) as error:
        raise RunFileError(f"`{path}` must be the progress of a fit, but cannot be read") from error
    for name, own in plain(identity).items():
        if content.get(name) != own:
            raise ArgumentError("task", f"go on with the same {name}", f"{path} is of another")
    return values
