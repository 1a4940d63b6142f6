"""The table of modes as text."""

import textwrap
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from esail_jax.modal.table import ModeTable

ROWS = 40
"""Largest number of lines of the table."""

SAME = 1e-7
"""Largest relative difference of eigenvalues in one line of the table."""

WIDTH = 108
"""Width of the notes."""


def table_text(table: "ModeTable") -> str:
    """Returns notes and table; modes with equal frequency and motion share a line."""
    lines = [line for note in table.notes for line in textwrap.wrap(note, WIDTH)]
    lines += ["", "  frequency [Hz]   per spin   damping ratio   change    modes  motion"]
    rows = rows_of(table)
    for first, members in rows[:ROWS]:
        change = table.relative_change[members]
        shown = f"{np.nanmax(change):.1e}" if np.isfinite(change).any() else "-"
        per_spin = table.frequency_hz[first] * 2.0 * np.pi / abs(table.spin_rate)
        lines.append(
            f"  {table.frequency_hz[first]:<15.8g}  {per_spin:<9.6g}  {table.damping_ratio[first]:<14.4e}"
            f"  {shown:<9} {len(members):<5}  {row_name(table, first, members)}"
        )
    if len(rows) > ROWS:
        lines.append(f"  ... and {len(rows) - ROWS} more lines of higher frequency")
    lines += [
        "",
        "frequency: |s| / (2 pi) in the rotating frame B; damping ratio: -Re s / |s|; change: |change of s| /"
        " |s|",
        "with twice as many elements (- : not found there, or not computed); modes: number of modes in the line",
    ]
    return "\n".join(lines)


def rows_of(table: "ModeTable") -> list[tuple[int, list[int]]]:
    """Returns the lines: the first mode of each and all its modes."""
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
    """Returns the part of a name before the form around the circle."""
    return name.partition(", ")[0]


def row_name(table: "ModeTable", first: int, members: list[int]) -> str:
    """Returns the name of a line."""
    if len(members) == 1 or table.wave_number[first] < 0:
        return table.name[first]
    numbers = sorted({int(table.wave_number[k]) for k in members})
    span = f"n = {numbers[0]}" if len(numbers) == 1 else f"n = {numbers[0]} to {numbers[-1]}"
    tail = ", overdamped" if table.name[first].endswith("overdamped") else ""
    return f"{motion_of(table.name[first])}, {span} around the circle{tail}"
