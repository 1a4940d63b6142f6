"""The modes of a sail as lines in the spectra of a run.

The angles and the length of a tether are measured in the frame B of the hub, in which `esail_jax.modes`
gives its frequencies. A vibration exp(s t) rings at the frequency Im s / (2 pi), and this is where its line
is drawn."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

HIGHEST_NODES = 3
"""Largest number of nodes along the tether of the modes that are drawn."""

COLOURS = ("tab:red", "tab:green", "tab:purple", "tab:brown")
"""Colours of the lines, by the number of nodes."""

SAME = 0.03
"""Largest relative difference of the frequencies of modes that share one name in a spectrum."""


class ModalLine(NamedTuple):
    """A mode in a spectrum. frequency: of its ringing [Hz]; name: what moves; nodes: along the tether."""

    frequency: float
    name: str
    nodes: int


def modal_lines(table: Any, kind: str) -> list[ModalLine]:
    """Returns the modes with the lowest orders of a kind of motion, in the order of their frequencies.

    table: an `esail_jax.ModeTable`, or None for no lines; kind: "in-plane" (lagging), "out-of-plane"
    (coning) or "axial" (length). Overdamped motions do not ring. The precession of the spin axis is left
    out: its line is that of the spin."""
    found = []
    for k in range(0 if table is None else len(table.name)):
        ringing = float(table.eigenvalue[k].imag) / (2.0 * np.pi)
        name = table.name[k].partition(",")[0]
        lowest = table.kind[k] == kind and table.nodes[k] <= HIGHEST_NODES
        if lowest and ringing > 0.0 and not name.startswith("spin-axis precession"):
            found.append(ModalLine(ringing, name, int(table.nodes[k])))
    return sorted(found)


def draw_modal_lines(ax: Axes, lines: Sequence[ModalLine], lowest: float, highest: float) -> None:
    """Draws the lines between two frequencies [Hz], with the name beside the first of those that lie
    together."""
    named: dict[str, float] = {}
    for line in lines:
        if not lowest <= line.frequency <= highest:
            continue
        colour = COLOURS[line.nodes]
        ax.axvline(line.frequency, color=colour, linestyle=":", linewidth=0.7)
        if abs(line.frequency - named.get(line.name, np.inf)) > SAME * line.frequency:
            place = {"rotation": 90, "ha": "right", "va": "bottom", "fontsize": 5.5, "color": colour}
            ax.text(line.frequency, 0.03, line.name, transform=ax.get_xaxis_transform(), **place)
        named[line.name] = line.frequency
