"""Draws the figures of run.py and acceleration.py."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from common import DEFAULT, relative_error, tip
from common import energies as parts_of

FOLDER = Path(__file__).parent / "figures"
DOTS_PER_INCH = 120
COLOURS = {
    "tsit5": "tab:green",
    "dopri5": "tab:blue",
    "dopri8": "tab:red",
    "dopri5, fixed step": "tab:cyan",
    "generalized-alpha": "tab:purple",
}


def save(figure, name: str) -> None:
    """Writes a figure."""
    figure.tight_layout()
    FOLDER.mkdir(exist_ok=True)
    figure.savefig(FOLDER / f"{name}.png", dpi=DOTS_PER_INCH)
    plt.close(figure)


def six():
    """A figure with axes for the six directions."""
    figure, axes = plt.subplots(2, 3, figsize=(10, 5.6), sharex=True)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    return figure, axes


def energies(runs: dict) -> None:
    """Draws Fig. 2 of the paper for every direction of gravity."""
    figure, axes = six()
    styles = {"kinetic": "tab:blue", "elastic": "tab:green", "potential": "tab:orange", "total": "k"}
    for axis, (direction, run) in zip(axes.T.flat, runs.items(), strict=True):
        for name, values in parts_of(run).items():
            axis.plot(run.time, values, color=styles[name], lw=1.2, label=name)
        axis.set_title(f"gravity {direction}", fontsize=10)
        axis.grid(alpha=0.3)
    for axis in axes[:, 0]:
        axis.set_ylabel("energy [J]")
    axes[0, 0].legend(fontsize=8)
    save(figure, "fig2_energies")


def energy_errors(runs: dict, bound: float) -> None:
    """Draws Fig. 3 of the paper, absolute values, for every direction and method."""
    figure, axes = six()
    directions = list(dict.fromkeys(direction for direction, _ in runs))
    for axis, direction in zip(axes.T.flat, directions, strict=True):
        for (d, name), run in runs.items():
            if d == direction:
                off = np.maximum(np.abs(relative_error(run)), 1e-16)
                style = {"color": "tab:red"} if name == DEFAULT else {}
                axis.semilogy(run.time[1:], off[1:], lw=0.9, label=name, **style)
        axis.axhline(bound, color="k", ls="--", lw=0.8, label="paper: less than 6e-6")
        axis.set_title(f"gravity {direction}", fontsize=10)
        axis.set_ylim(1e-16, 1e-1)
        axis.grid(alpha=0.3)
    for axis in axes[:, 0]:
        axis.set_ylabel("|E - E(0)| / |E(0)|")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, fontsize=8, ncols=5, loc="lower center", bbox_to_anchor=(0.5, -0.04))
    figure.tight_layout()
    FOLDER.mkdir(exist_ok=True)
    figure.savefig(FOLDER / "fig3_energy_errors.png", dpi=DOTS_PER_INCH, bbox_inches="tight")
    plt.close(figure)


def tips(away: dict, spread: np.ndarray) -> None:
    """Draws the distance of the tip from the references over time, and the spread of nearby starts."""
    figure, axis = plt.subplots(figsize=(7, 4.4))
    for direction, (times, off) in away.items():
        style = ":" if direction == "-Z" else "-"
        axis.semilogy(times[1:], np.maximum(off[1:], 1e-17), style, marker=".", ms=3, lw=1, label=direction)
    axis.semilogy(
        spread[1:, 0],
        spread[1:, 1],
        "k--",
        lw=1,
        label="-X: spread of starts\nmoved by 1e-12 m (reference)",
    )
    axis.set_xlabel("time [s]")
    axis.set_ylabel("tip, package - reference [m]")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8, title="gravity", title_fontsize=8)
    save(figure, "tips")


def path(run, reference: np.ndarray) -> None:
    """Draws Fig. 4 of the paper: coordinates of the tip over time, and its path."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4))
    place = tip(run)
    for k, name in enumerate("xyz"):
        (line,) = left.plot(run.time, place[:, k], lw=1.2, label=name)
        left.plot(reference[::8, 0], reference[::8, k + 1], "o", ms=3, mfc="none", color=line.get_color())
    left.set_xlabel("time [s]")
    left.set_ylabel("coordinate of the tip [m]")
    left.legend(fontsize=8, title="lines: package\ncircles: reference", title_fontsize=7)
    right.plot(place[:, 0], place[:, 1], lw=1.2)
    right.plot(0.0, 0.0, "k^")
    right.set_xlabel("x [m]")
    right.set_ylabel("y [m]")
    right.set_aspect("equal", adjustable="datalim")
    for axis in (left, right):
        axis.grid(alpha=0.3)
    save(figure, "fig4_tip_path")


def tip_distance(times: np.ndarray, off: dict, bound: float) -> None:
    """Draws Fig. 5 of the paper, with other codes and models in place of ADAMS."""
    figure, axis = plt.subplots(figsize=(7, 4.2))
    for name, values in off.items():
        every = (len(times) - 1) // (len(values) - 1)
        style = {"lw": 2.4, "color": "0.6"} if name == "exudyn rigid" else {"lw": 1.1}
        axis.semilogy(times[::every][1:], np.maximum(values[1:], 1e-16), label=name, **style)
    axis.axhline(bound, color="k", ls="--", lw=0.8, label="paper: less than 8e-3 m")
    axis.set_xlabel("time [s]")
    axis.set_ylabel("tip, package - other [m]")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    save(figure, "fig5_tip_distance")


def work_precision(rows: list[dict], cases: list[str]) -> None:
    """Draws the error of every method over its run time, one panel per case."""
    figure, axes = plt.subplots(1, len(cases), figsize=(13, 5), sharey=True)
    for axis, case in zip(axes, cases, strict=True):
        for name in dict.fromkeys(row["method"] for row in rows if row["case"] == case):
            points = [r for r in rows if (r["case"], r["method"]) == (case, name) and r["error_m"] != ""]
            seconds = [float(r["run_s"]) for r in points]
            off = [float(r["error_m"]) for r in points]
            if name.startswith("exudyn"):
                style = {"ls": "none", "marker": markers(name), "ms": 5, "mfc": "none", "color": "0.4"}
            else:
                style = {"marker": ".", "lw": 1.2, "color": COLOURS[name]}
            axis.loglog(seconds, off, label=name, **style)
        axis.set_title(case, fontsize=10)
        axis.set_xlabel("run time, compiled [s]")
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("largest error of the tip [m]")
    axes[0].legend(fontsize=8)
    axes[-1].legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    save(figure, "work_precision")


def markers(name: str) -> str:
    """The marker of a model and an integrator of Exudyn."""
    _, model, method = name.split()
    shapes = {"rigid": "sD", "tree": "^v<>", "elastic": "o*hp"}[model]
    order = ["GeneralizedAlpha", "TrapezoidalIndex2", "RK44", "RK67", "DOPRI5"]
    return shapes[order.index(method) % len(shapes)]


def acceleration(rows: list[dict]) -> None:
    """Draws the time per acceleration and per rod over the number of rods."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.4))
    curves = {
        "call_us": ("o-", "one call from Python"),
        "loop_us": ("s-", "inside a compiled loop"),
        "dense_us": ("^-", "dense solve in every call (in a loop)"),
    }
    for key, (style, label) in curves.items():
        points = [(int(r["rods"]), float(r[key])) for r in rows if r[key] != ""]
        rods, micros = np.array(points).T
        left.loglog(rods, micros, style, ms=4, lw=1.2, label=label)
        if key != "dense_us":
            right.loglog(rods, 1e3 * micros / rods, style, ms=4, lw=1.2, label=label)
    moved = [(int(r["rods"]), float(r["copy_ns_per_rod"])) for r in rows if r["copy_ns_per_rod"] != ""]
    right.loglog(*np.array(moved).T, "k--", lw=1, label="copying the bytes XLA counts")
    least = [(int(r["rods"]), float(r["least_ns_per_rod"])) for r in rows if r["least_ns_per_rod"] != ""]
    right.loglog(*np.array(least).T, "k:", lw=1, label="copying 64 bytes per rod")
    left.set_ylabel("time per acceleration [us]")
    right.set_ylabel("time per rod [ns]")
    for axis in (left, right):
        axis.set_xlabel("rods")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    save(figure, "acceleration")
