"""`esail info` of an ensemble."""

from pathlib import Path

import numpy as np

from esail_jax.commands.description import heading
from esail_jax.ensembles.ensemble import Ensemble
from esail_jax.ensembles.ensemble_file import load_ensemble
from esail_jax.ensembles.statistics import OUTCOMES, outcomes_of, sensitivities
from esail_jax.files.opening import intact, open_run, to_python

LEAST_SHARE = 0.05
"""Least share of an outcome's variance for which an input is named."""


def describe_ensemble(path: Path) -> str:
    """A few lines on an ensemble: model, method, members, speed, and the distributions of its outcomes."""
    with open_run(path) as file, intact(path):
        a = {name: to_python(value) for name, value in file.attrs.items()}
        terms = ", ".join(file["numerics"].attrs["terms"])
    ensemble = load_ensemble(path, [outcome.observable for outcome in OUTCOMES])
    done = int(np.isfinite(ensemble.steps).sum())
    wall = max(a["wall_time"], 1e-9)
    vary = a["vary"].replace("\n", ", ") or "nothing"
    lines = [
        *heading(path, a, ensemble.scene, terms),
        f"  members    {len(ensemble)}, seed {a['seed']}, {a['sampling']}; varied: {vary}",
        f"  time       to {ensemble.time[-1]:g} s, {len(ensemble.time)} saved instants",
        f"  speed      {a['steps']} steps in {wall:.2f} s of a core ({done / wall:.3g} members and "
        f"{a['steps'] / wall:.0f} steps a second), compiling {a['compile_time']:.2f} s",
        f"  device     {a['device']}, jax {a['version_jax']}, esail_jax {a['version_esail_jax']}",
    ]
    return "\n".join([line for line in lines if line] + distributions(ensemble))


def distributions(ensemble: Ensemble) -> list[str]:
    """A line for every outcome: mean, deviation, 5 % and 95 % quantiles, extremes, and its most important
    inputs."""
    found = outcomes_of(ensemble)
    if not found:
        return []
    columns = "".join(f"{name:>11s}" for name in ("mean", "deviation", "5 %", "95 %", "least", "most"))
    lines = [f"  {'':32s}{columns}  driven by"]
    for outcome in found:
        y = outcome.of(ensemble)
        known = y[np.isfinite(y)]
        low, high = np.quantile(known, (0.05, 0.95))
        numbers = (known.mean(), known.std(), low, high, known.min(), known.max())
        share = sensitivities(ensemble.inputs, y).share
        names = sorted((key for key in share if share[key] > LEAST_SHARE), key=lambda key: -share[key])
        by = ", ".join(f"{key} {100 * share[key]:.0f} %" for key in names)
        row = "".join(f"{x:11.4g}" for x in numbers)
        lines.append(f"  {f'{outcome.label} [{outcome.unit}]':32s}{row}  {by}".rstrip())
    return lines
