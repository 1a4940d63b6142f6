"""`esail info` of an ensemble."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from esail_jax.commands.reports import heading, size_of
from esail_jax.ensembles.ensemble import Ensemble
from esail_jax.ensembles.ensemble_file import load_ensemble, unfinished
from esail_jax.ensembles.joining import join
from esail_jax.ensembles.merging import outcome_counts
from esail_jax.ensembles.statistics import MEMBERS_PER_COLUMN, OUTCOMES, outcomes_of, sensitivities
from esail_jax.files.locks import in_use
from esail_jax.files.opening import WHOLE, files_of, intact, open_run, to_python
from esail_jax.scenes.loading import parse
from esail_jax.scenes.rules import count_of

LEAST_SHARE = 0.05
"""Least share of an outcome's variance for which an input is named."""


def describe_ensemble(path: Path) -> str:
    """A few lines on an ensemble: model, method, members, speed, and the distributions of its outcomes.
    Raises RunFileError."""
    ensemble = load_ensemble(path, [outcome.observable for outcome in OUTCOMES])
    with open_run(path) as file, intact(path):
        a = {name: to_python(value) for name, value in file.attrs.items()}
        terms = ", ".join(file["numerics"].attrs["terms"])
        # One number after the other: those of a million members need not be in memory together.
        shown = distributions(dataclasses.replace(ensemble, reduced=file.get("reduced", {})))
    done = int(np.isfinite(ensemble.steps).sum())
    wall = max(a["wall_time"], 1e-9)
    vary = a["vary"].replace("\n", ", ") or "nothing"
    lines = [
        *heading(path, a, ensemble.scene, terms),
        f"  members    {len(ensemble)}, seed {a['seed']}, {a['sampling']}; varied: {vary}",
        f"  time       to {ensemble.time[-1]:g} s, {len(ensemble.time)} saved instants",
        f"  speed      {done / wall:.3g} members or {a['steps'] / wall:.0f} steps a second in each process",
        f"  spent      {wall:.2f} s on {a['steps']} steps and {a['compile_time']:.2f} s on preparing "
        "programs, summed over processes that work side by side",
        f"  device     {a['device']}, jax {a['version_jax']}, esail_jax {a['version_esail_jax']}",
    ]
    return "\n".join([line for line in lines if line] + shown)


def describe_joined(paths: Sequence[Path]) -> str:
    """The distributions of the outcomes of several ensembles as one sample, after a line for each. Raises
    RunFileError, and InputError for ensembles that do not fit together."""
    parts = [load_ensemble(path, [outcome.observable for outcome in OUTCOMES]) for path in paths]
    whole = join(parts)
    width = max(len(str(path)) for path in paths)
    lines = [
        f"{path!s:{width}s}  {len(part)} members, {int(part.complete.sum())} complete"
        for path, part in zip(paths, parts, strict=True)
    ]
    lines.append(f"One sample of {len(whole)} members, {int(whole.complete.sum())} complete:")
    return "\n".join(lines + distributions(whole))


def describe_folder(folder: Path) -> str:
    """The description of the ensemble in a folder, or its progress if it is not finished. Raises
    RunFileError."""
    try:
        about = unfinished(folder)
        if about is not None:
            return progress_of(folder, about)
    except FileNotFoundError:  # the pieces have just been put together
        pass
    (path,) = files_of([folder])
    return describe_ensemble(path)


def progress_of(folder: Path, about: Mapping[str, Any]) -> str:
    """A few lines on an ensemble of which some members are still in pieces. about: what the pieces say of
    it. Raises FileNotFoundError if they are put together in the meantime."""
    done, failed, warned = outcome_counts(folder)
    counts = ((failed, "failed"), (warned, "have a warning"))
    more = "".join(f", {count} of them {what}" for count, what in counts if count)
    running = in_use(folder)
    varied = about["vary"].replace("\n", ", ") or "nothing"
    lines = [
        f"{folder}: " + ("running" if running else "interrupted, and not put together yet"),
        f"  model      {size_of(parse(about['scene'], str(folder)))}",
        f"  members    {done} of {about['count']} computed{more}",
        f"  varied     {varied}; seed {about['seed']}, {about['sampling']}",
    ]
    if not running:
        lines.append(f"  `esail ensemble` with --resume computes the others and writes {folder / WHOLE}")
    return "\n".join(lines)


def distributions(ensemble: Ensemble) -> list[str]:
    """A line for every outcome: mean, deviation, 5 % and 95 % quantiles, extremes, and its most important
    inputs. A last line if there are too few members to name inputs."""
    outcomes = outcomes_of(ensemble)
    if not outcomes:
        return []
    columns = "".join(f"{name:>11s}" for name in ("mean", "deviation", "5 %", "95 %", "least", "most"))
    numbers_drawn = sum(x[0].size for x in ensemble.inputs.values())
    needed = MEMBERS_PER_COLUMN * numbers_drawn
    enough = numbers_drawn and int(ensemble.complete.sum()) >= needed
    lines = [f"  {'':32s}{columns}" + ("  driven by" if enough else "")]
    for outcome in outcomes:
        y = outcome.of(ensemble)
        known = y[np.isfinite(y)]
        low, high = np.quantile(known, (0.05, 0.95))
        numbers = (known.mean(), known.std(), low, high, known.min(), known.max())
        share = sensitivities(ensemble.inputs, y).share
        names = sorted((key for key in share if share[key] > LEAST_SHARE), key=lambda key: -share[key])
        by = ", ".join(f"{key} {100 * share[key]:.0f} %" for key in names)
        row = "".join(f"{x:11.4g}" for x in numbers)
        lines.append(f"  {f'{outcome.label} [{outcome.unit}]':32s}{row}  {by}".rstrip())
    if numbers_drawn and not enough:
        drawn = count_of(numbers_drawn, "varied number")
        lines.append(
            f"  What drives the outcomes is not shown: with {drawn} and less than {needed} complete "
            "members, chance would explain too much."
        )
    return lines
