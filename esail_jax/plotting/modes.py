"""Figures of the modes of a sail: their frequencies by motion, and their shapes along the tether."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from esail_jax.plotting.data import KILOMETRE
from esail_jax.plotting.figure_files import write_figures
from esail_jax.plotting.style import BLUE, ORANGE, PURPLE, RED, styled

COLOURS = {
    "in-plane": BLUE,
    "out-of-plane": ORANGE,
    "axial": RED,
    "hub": "black",
    "auxiliary tethers": PURPLE,
}
"""Colour of every kind of motion."""

SHOWN = 4
"""Number of shapes of each kind."""

RESOLVED = 1e-2
"""A mode is drawn if twice as many elements change it by at most this, or if that was not computed."""


def mode_frequencies(table: Any) -> Figure:
    """The figure of all resolved modes: frequency against damping ratio, and against the number of
    waves around the circle. table: an `esail_jax.ModeTable`."""
    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    drawn = ~(table.relative_change > RESOLVED)
    kinds = np.array(table.kind)
    for kind, colour in COLOURS.items():
        chosen = drawn & (kinds == kind)
        if not chosen.any():
            continue
        frequency = table.frequency_hz[chosen]
        left.plot(np.maximum(table.damping_ratio[chosen], 1e-12), frequency, ".", color=colour, label=kind)
        right.plot(table.wave_number[chosen], frequency, "_", color=colour, markersize=9)
    for ax in (left, right):
        ax.axhline(abs(table.spin_rate) / (2.0 * np.pi), color="black", linestyle="--", linewidth=0.8)
        ax.grid(alpha=0.3)
    left.loglog()
    left.set_xlabel(r"damping ratio $\zeta$ [-] (at least $10^{-12}$)")
    left.set_ylabel("frequency in B [Hz] (dashed: spin)")
    left.legend(frameon=False, fontsize="small")
    right.set_xlabel("waves around the circle $n$ [-] (-1: unequal tethers)")
    figure.suptitle("Modes about the spinning equilibrium", fontsize="medium")
    return figure


@styled
def mode_shapes(table: Any) -> Figure:
    """The figure of the shapes along the tether that moves most, for the lowest orders of every
    kind; the displacement relative to its largest value at the phase at which it is largest."""
    from esail_jax.modal.names import strongest_line
    from esail_jax.modal.shapes import DIRECTIONS

    figure = Figure(figsize=(10.0, 3.6), layout="constrained")
    axes = figure.subplots(1, len(DIRECTIONS), sharex=True, sharey=True)
    for direction, (kind, ax) in enumerate(zip(DIRECTIONS, axes, strict=True)):
        for nodes in range(SHOWN):
            mode = lowest_of(table, kind, nodes)
            if mode is None:
                continue
            moving = table.shape(mode).tether[direction]
            strongest = (np.abs(moving - moving[:1]) ** 2).sum(0).argmax()
            line = strongest_line(moving[:, strongest : strongest + 1])
            line = line / line[np.abs(line).argmax()]
            distance = table.places.distance[:, strongest] / KILOMETRE
            ax.plot(distance, line, linewidth=1.2, label=f"{table.frequency_hz[mode]:.4g} Hz")
        ax.set_title(kind, fontsize="medium")
        ax.set_xlabel("distance from the root [km]")
        ax.grid(alpha=0.3)
        if ax.lines:
            ax.legend(frameon=False, fontsize="small")
    axes[0].set_ylabel("displacement [-]")
    figure.suptitle("Shapes along the tether, relative to its root", fontsize="medium")
    return figure


def mode_multipliers(table: Any) -> Figure:
    """The figure of the multipliers of the periodic orbit: in the complex plane, and their damping
    ratios against frequency beside those of the modes under the mean load. Both axes of the second picture
    are logarithmic: damping ratios that are exactly zero do not appear there."""
    orbit, kinds = table.floquet, np.array(table.kind)
    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.add_patch(Circle((0.0, 0.0), 1.0, fill=False, color="black", linestyle="--", linewidth=0.8))
    ratio = -orbit.exponent.real / np.abs(orbit.exponent)
    for kind, colour in COLOURS.items():
        chosen = (kinds == kind) & np.isfinite(orbit.multiplier)
        mu, frequency = orbit.multiplier[chosen], np.abs(orbit.exponent[chosen]) / (2.0 * np.pi)
        left.plot(mu.real, mu.imag, ".", color=colour, label=kind)
        left.plot(mu.real, -mu.imag, ".", color=colour)
        for sign, marker in ((1.0, "."), (-1.0, "x")):
            some = sign * ratio[chosen] > 0.0
            right.plot(frequency[some], sign * ratio[chosen][some], marker, color=colour)
        right.plot(
            table.frequency_hz[chosen], np.abs(table.damping_ratio[chosen]), "o", color=colour,
            markersize=8, fillstyle="none", markeredgewidth=0.6,
        )  # fmt: skip
    left.set_aspect("equal")
    left.set_xlabel(r"Re $\mu$ [-] (dashed: $|\mu| = 1$)")
    left.set_ylabel(r"Im $\mu$ [-]")
    left.legend(frameon=False, fontsize="small", loc="upper left")
    right.loglog()
    right.set_xlabel("frequency in B [Hz]")
    right.set_ylabel(r"$|\zeta|$ [-] (crosses: growing; circles: mean load)")
    for ax in (left, right):
        ax.grid(alpha=0.3)
    figure.suptitle("Floquet multipliers of the periodic orbit", fontsize="medium")
    return figure


def lowest_of(table: Any, kind: str, nodes: int) -> int | None:
    """The mode of the lowest frequency with this motion along the tether; None without one."""
    pairs = enumerate(zip(table.kind, table.nodes, strict=True))
    return next((k for k, pair in pairs if pair == (kind, nodes)), None)


def plot_modes(table: Any, directory: str | Path) -> list[Path]:
    """Writes mode_frequencies.png, mode_shapes.png and, if the multipliers were asked for,
    mode_multipliers.png to a directory, which is created; returns their paths. Raises OSError."""
    makers = (mode_frequencies, mode_shapes, *([mode_multipliers] if table.floquet is not None else []))
    return write_figures(((make.__name__, make(table)) for make in makers), directory)
