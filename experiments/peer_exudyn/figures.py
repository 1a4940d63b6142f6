"""The figures of this comparison."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

DOTS_PER_INCH = 90

SHOWN = (
    ("coning_angle", 0, "coning [rad]"),
    ("root_coning_angle", 0, "coning at the root [rad]"),
    ("angular_velocity_B", 1, "hub rate about Y_B [rad/s]"),
    ("reaction_B", 0, "root reaction along X_B [N]"),
)
"""Signals that are drawn: name, index of tether or component, label."""


def component(run: dict, signal: str, index: int) -> np.ndarray:
    """One component (time); of tether 1 where there is one vector per tether."""
    values = run[signal]
    return values[:, 0, index] if values.ndim == 3 else values[:, index]


def draw_signals(coarse: dict, fine: dict, directory: Path) -> None:
    """Draws the signals of both codes, and their difference at two steps."""
    figure = Figure(figsize=(11, 4.8), layout="constrained")
    axes = figure.subplots(2, len(SHOWN), sharex=True)
    for (signal, index, label), (above, below) in zip(SHOWN, axes.T, strict=True):
        time = coarse["exudyn"]["time"]
        x = component(coarse["esail_jax"], signal, index)
        y = component(coarse["exudyn"], signal, index)
        above.plot(time, x, "tab:blue", lw=1.2, label="esail_jax")
        above.plot(time[::12], y[::12], "k.", ms=3, label="Exudyn")
        above.set_title(label, fontsize=9)
        for run, step, colour in ((coarse, "0.1 s", "tab:red"), (fine, "0.05 s", "tab:orange")):
            gap = component(run["esail_jax"], signal, index) - component(run["exudyn"], signal, index)
            below.plot(run["exudyn"]["time"], gap, colour, lw=0.7, label=f"step {step}")
        below.set_xlabel("time [s]")
    axes[0, 0].legend(fontsize=8)
    axes[1, 0].legend(fontsize=8)
    axes[1, 0].set_ylabel("esail_jax - Exudyn, same units", fontsize=9)
    save(figure, directory / "signals.png")


def draw_differences(found: list, directory: Path) -> None:
    """Draws the relative difference of every signal: between the codes, and of each code with half the
    step."""
    figure = Figure(figsize=(9, 4.5), layout="constrained")
    ax = figure.subplots()
    names = list(dict.fromkeys(entry.signal for entry in found))
    pairs = list(dict.fromkeys((entry.compared, entry.against) for entry in found))
    styles = iter("osD^v<>p*hX")
    for pair in pairs:
        values = [x.relative for x in found if (x.compared, x.against) == pair]
        same = pair[0].split(" ")[0] == pair[1].split(" ")[0]
        label = f"{pair[0]} against {pair[1].split(' ')[1] + ' s' if same else 'Exudyn'}"
        ax.semilogy(names, values, next(styles), ms=5, mfc="none" if same else None, alpha=0.8, label=label)
    bounds = {entry.signal: entry.bound for entry in found}
    ax.semilogy(names, list(bounds.values()), "k_", ms=16, label="bound between the codes")
    ax.tick_params("x", rotation=35, labelsize=8)
    for text in ax.get_xticklabels():
        text.set_horizontalalignment("right")
    ax.set_ylabel("largest difference / range [-]")
    ax.grid(axis="y", alpha=0.3)
    ax.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    save(figure, directory / "differences.png")


def save(figure: Figure, path: Path) -> None:
    """Writes a figure; makes its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=DOTS_PER_INCH)
