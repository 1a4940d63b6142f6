"""The table of modes as text."""

import textwrap
from typing import Any

import numpy as np

ROWS = 40
"""Number of lines of the lowest frequencies that are shown in any case."""

RESOLVED = 1e-2
"""Above them a line is shown if twice as many elements change it by at most this."""

SAME = 1e-7
"""Largest relative difference of eigenvalues in one line of the table."""

WIDTH = 108
"""Width of the notes."""


def table_text(table: Any) -> str:
    """Notes and table of a `ModeTable`; modes with equal frequency and motion share a line."""
    lines = [line for note in table.notes for line in textwrap.wrap(note, WIDTH)]
    orbit = table.floquet
    multipliers = "|mu| - 1    orbit - mean  " if orbit is not None else ""
    lines += ["", f"  frequency [Hz]   per spin   damping ratio   change    {multipliers}modes  motion"]
    rows = rows_of(table)
    hidden = 0
    for k, (first, members) in enumerate(rows):
        change = table.relative_change[members]
        if k >= ROWS and not (change <= RESOLVED).any():
            hidden += 1
            continue
        shown = f"{np.nanmax(change):.1e}" if np.isfinite(change).any() else "-"
        per_spin = table.frequency_hz[first] * 2.0 * np.pi / abs(table.spin_rate)
        lines.append(
            f"  {table.frequency_hz[first]:<15.8g}  {per_spin:<9.6g}  {table.damping_ratio[first]:<14.4e}"
            f"  {shown:<9} {of_orbit(table, members)}{len(members):<5}  {row_name(table, first, members)}"
        )
    if hidden:
        lines.append(f"  ... and {hidden} more lines that these elements do not resolve to 1 %")
    legend = (
        "frequency: |s| / (2 pi) in the rotating frame B; damping ratio: -Re s / |s|; change: that of s "
        "over |s| with twice as many elements (-: not found there, or not computed); modes: number of "
        "modes in the line. The JSON file has all modes, one by one."
    )
    if orbit is not None:
        legend += (
            " |mu| - 1: relative growth in a turn, of the modes of the line the largest; orbit - mean: "
            "largest change of s from the mean load to the periodic orbit, over |s|."
        )
    lines += ["", *textwrap.wrap(legend, WIDTH)]
    return "\n".join(lines)


def of_orbit(table: Any, members: list[int]) -> str:
    """The columns of the multipliers of a line; nothing if they were not asked for."""
    orbit = table.floquet
    if orbit is None:
        return ""
    growth = orbit.growth[members]
    if not np.isfinite(growth).any():
        return f"{'-':<11} {'-':<13} "
    rate = table.eigenvalue[members]
    moved = np.abs(orbit.exponent[members] - rate) / np.abs(rate)
    return f"{np.nanmax(growth) - 1.0:<11.2e} {np.nanmax(moved):<13.1e} "


def rows_of(table: Any) -> list[tuple[int, list[int]]]:
    """The lines: the first mode of each and all its modes."""
    rows: list[tuple[int, list[int]]] = []
    for k, value in enumerate(table.eigenvalue):
        for first, members in reversed(rows[-16:]):
            same = abs(table.eigenvalue[first] - value) <= SAME * abs(value)
            if same and motion_of(table.name[first]) == motion_of(table.name[k]):
                members.append(k)
                break
        else:
            rows.append((k, [k]))
    return rows


def motion_of(name: str) -> str:
    """The part of a name before the form around the circle."""
    return name.partition(", ")[0]


def row_name(table: Any, first: int, members: list[int]) -> str:
    """The name of a line."""
    if len(members) == 1 or table.wave_number[first] < 0:
        return table.name[first]
    numbers = sorted({int(table.wave_number[k]) for k in members})
    listed = ", ".join(map(str, numbers))
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        listed = f"{numbers[0]} to {numbers[-1]}"
    span = f"n = {listed}"
    tail = ", overdamped" if table.name[first].endswith("overdamped") else ""
    return f"{motion_of(table.name[first])}, {span} around the circle{tail}"
