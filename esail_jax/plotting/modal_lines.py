"""The modes of a sail as lines in the spectra of a run.

The angles and the length of a tether are measured in the frame B of the hub, in which `esail_jax.modes`
gives its frequencies. A vibration exp(s t) rings at the frequency Im s / (2 pi), and this is where its line
is drawn."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from esail_jax.plotting.style import BROWN, ORANGE, PURPLE, RED

HIGHEST_NODES = 3
"""Largest number of nodes along the tether of the modes that are drawn."""

COLOURS = (RED, ORANGE, PURPLE, BROWN)
"""Colours of the lines, by the number of nodes."""


class ModalLine(NamedTuple):
    """A mode in a spectrum. frequency: of its ringing [Hz]; name: what moves; nodes: along the tether."""

    frequency: float
    name: str
    nodes: int


def modal_lines(table: Any, kind: str) -> list[ModalLine]:
    """The modes with the lowest orders of a kind of motion, in the order of their frequencies.

    table: an `esail_jax.ModeTable`, or None for no lines; kind: "in-plane" (lagging), "out-of-plane"
    (coning) or "axial" (length). Overdamped motions do not ring. The precession of the spin axis is left
    out: its line is that of the spin."""
    lines = []
    for k in range(0 if table is None else len(table.name)):
        ringing = float(table.eigenvalue[k].imag) / (2.0 * np.pi)
        name = table.name[k].partition(",")[0]
        lowest = table.kind[k] == kind and table.nodes[k] <= HIGHEST_NODES
        if lowest and ringing > 0.0 and not name.startswith("spin-axis precession"):
            lines.append(ModalLine(ringing, name, int(table.nodes[k])))
    return sorted(lines)


def draw_modal_lines(ax: Axes, lines: Sequence[ModalLine], lowest: float, highest: float) -> None:
    """Draws the lines between two frequencies [Hz]. Their labels are for a legend, which hides no curve:
    one for each name."""
    named = set()
    for line in lines:
        if lowest <= line.frequency <= highest:
            label = None if line.name in named else line.name
            ax.axvline(line.frequency, color=COLOURS[line.nodes], linestyle=":", linewidth=0.9, label=label)
            named.add(line.name)
