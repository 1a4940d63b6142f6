"""Figures laid out as those of [PGV]: a grid of panels with the paper's letters, curves of several runs."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure
from PIL import Image

BLUE, VERMILION, GREEN, PURPLE, SKY, BLACK, GREY = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#000000", "#808080",
)  # fmt: skip
"""Colours that stay apart for colour-blind readers (Okabe and Ito)."""

DOTS_PER_INCH = 88
LARGEST_FILE = 150_000
"""Largest size of a figure in the repository [bytes]."""


class Line(NamedTuple):
    """One curve of a panel, with its legend's label."""

    x: Any
    y: Any
    label: str
    colour: str
    dashes: str = "-"
    width: float = 1.0
    marker: str = ""


class Panel(NamedTuple):
    """One panel: the paper's letter, what the vertical axis shows, and the curves."""

    letter: str
    ylabel: str
    lines: Sequence[Line]
    xlabel: str = "$t/T_s$ [-]"
    log: str = ""
    marks: Sequence[tuple[float, str, str, str]] = ()
    """Vertical lines: (place, label, colour, dashes)."""


def draw(
    title: str, rows: Sequence[Sequence[Panel | None]], width: float = 4.0, height: float = 1.8
) -> Figure:
    """A figure with rows of panels, which may have different lengths. The legend below the panels
    names every label once. width, height: size of the panels of the longest row [inch]."""
    longest, columns = max(map(len, rows)), math.lcm(*map(len, rows))
    figure = Figure(figsize=(width * longest, height * len(rows) + 0.8), layout="constrained")
    grid = figure.add_gridspec(len(rows), columns)
    known: dict[str, Any] = {}
    for i, row in enumerate(rows):
        share = columns // len(row)
        for k, panel in enumerate(row):
            if panel is not None:
                fill(figure.add_subplot(grid[i, k * share : (k + 1) * share]), panel, known)
    figure.suptitle(title, fontsize="medium")
    figure.legend(
        known.values(),
        known.keys(),
        loc="outside lower center",
        ncols=min(len(known), 5),
        fontsize="small",
        frameon=False,
    )
    figure.align_ylabels()
    return figure


def fill(ax: Any, panel: Panel, known: dict[str, Any]) -> None:
    """Draws one panel and adds its new labels to the known ones."""
    for line in panel.lines:
        drawn = ax.plot(
            line.x, line.y, line.dashes, color=line.colour, lw=line.width, marker=line.marker, ms=4.0
        )
        known.setdefault(line.label, drawn[0])
    for place, label, colour, dashes in panel.marks:
        known.setdefault(label, ax.axvline(place, color=colour, ls=dashes, lw=0.9))
    if "x" in panel.log:
        ax.set_xscale("log")
    if "y" in panel.log:
        ax.set_yscale("log")
    else:
        ax.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
    if panel.letter:
        ax.set_title(f"({panel.letter})", loc="left", fontsize="small", pad=3.0)
    ax.set_ylabel(panel.ylabel)
    ax.set_xlabel(panel.xlabel, labelpad=1.0, fontsize="small")
    ax.grid(alpha=0.3)


def save(figure: Figure, path: Path) -> None:
    """Writes a figure as a PNG of 128 colours. Raises ValueError if it is too large for the repository."""
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, dpi=DOTS_PER_INCH)
    with Image.open(path) as image:
        image.convert("RGB").quantize(128, Image.Quantize.MAXCOVERAGE).save(path, optimize=True)
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise ValueError(f"{path} must have at most {LARGEST_FILE} bytes, but has {size}")
    print(f"wrote {path}, {size // 1000} kB")
