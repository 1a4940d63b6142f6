"""What files of a wind hold, in words: form, span, rows, gaps, and how speed and density are
distributed."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from esail_jax.calendar.instants import Instants
from esail_jax.wind_files.in_run import Joined, gaps_of, joined
from esail_jax.wind_files.opening import read_rows
from esail_jax.wind_files.rows import first_of

NAMES = {"speed": "m/s", "number_density": "1/m^3"}
"""Columns that are described, and their units."""


def read_wind(paths: Sequence[Path]) -> Joined:
    """The rows of one file, or of several as one wind, with the first date as that of t = 0. Raises
    SceneError."""
    parts = [read_rows(str(path), Path()) for path in paths]
    dates = [part.time for part in parts if isinstance(part.time, Instants)]
    return joined(parts, first_of(dates[0]) if dates else None)


def summary_of(wind: Joined, names: str) -> str:
    """The description of a wind. names: of its files. Statistics are those of the rows, whatever the time
    between them."""
    kept = np.flatnonzero(wind.good)
    gaps = gaps_of(wind, kept)
    first, last = float(wind.time[0]), float(wind.time[-1])
    unit = "" if wind.epoch is None else " UTC"
    lines = [
        f"{names}: wind, {', '.join(dict.fromkeys(part.form for part in wind.parts))}",
        f"span      {wind.at(first)} to {wind.at(last)}{unit} ({last - first:.12g} s)",
        f"rows      {len(wind.time)}, {len(kept)} of them with speed and density",
    ]
    if gaps:
        longest = max(gaps, key=lambda gap: gap.length)
        where = f"from {wind.at(longest.first)} to {wind.at(longest.last)}"
        lines.append(
            f"gaps      {len(gaps)}, bridged with `largest_gap = {longest.length:.12g}`; longest {where}"
        )
    else:
        lines.append("gaps      none" if len(kept) else "gaps      all of it")
    lines += [f"{name:<14}  {distribution(wind.column(name)[kept])} {unit}" for name, unit in NAMES.items()]
    return "\n  ".join(lines)


def distribution(numbers: Float[np.ndarray, " row"]) -> str:
    """Mean, median and two quantiles of numbers, in words."""
    if len(numbers) == 0:
        return "no numbers,"
    low, middle, high = np.quantile(numbers, (0.05, 0.5, 0.95))
    return f"mean {numbers.mean():.4g}, median {middle:.4g}, 5 % {low:.4g}, 95 % {high:.4g}"
