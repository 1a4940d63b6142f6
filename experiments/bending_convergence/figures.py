"""Draws the figures of the study."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import modes
import numpy as np
from analysis import SIGNALS, Study, errors
from models import TIMES, Lane

FOLDER = Path(__file__).parent / "figures"
DOTS_PER_INCH = 90
STYLE = {
    "truss": {"color": "tab:red", "marker": "s", "label": "truss"},
    "none": {"color": "tab:blue", "marker": "o", "label": "cable, no bending", "mfc": "none", "ms": 9},
    "linear": {
        "color": "tab:green",
        "marker": "x",
        "ls": "none",
        "label": "cable, linear curvature",
        "ms": 8,
    },
    "nonlinear": {"color": "k", "marker": ".", "ls": ":", "label": "cable, nonlinear bending"},
}


def save(figure, name: str) -> None:
    """Writes a figure."""
    figure.tight_layout()
    FOLDER.mkdir(exist_ok=True)
    figure.savefig(FOLDER / f"{name}.png", dpi=DOTS_PER_INCH)
    plt.close(figure)


def convergence(study: Study) -> None:
    """Draws the errors of every variant over the number of elements."""
    figure, axes = plt.subplots(3, 4, figsize=(15, 10), sharex=True)
    for axis, (key, title) in zip(axes.flat, SIGNALS.items(), strict=True):
        for variant, style in STYLE.items():
            axis.loglog(*study.curve(variant, key), **style)
        change = [
            errors(study.get("nonlinear", n), study.get("none", n))[key][1] for n in study.meshes("linear")
        ]
        axis.loglog(study.meshes("linear"), change, color="0.6", label="nonlinear bending - none")
        axis.set_title(title)
        axis.grid(alpha=0.3)
    axes[0, 0].legend(fontsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("elements")
    for axis in axes[:, 0]:
        axis.set_ylabel("rms error / range")
    save(figure, "convergence")


def coordinates(study: Study) -> None:
    """Draws the errors over the number of coordinates."""
    figure, axes = plt.subplots(1, 4, figsize=(15, 4.5))
    for axis, key in zip(axes, ("coning", "root coning", "reaction", "strain"), strict=True):
        for variant, per_node in (("truss", 3), ("none", 6)):
            meshes, error = study.curve(variant, key)
            unknowns = [per_node * (n + 1) for n in meshes]
            axis.loglog(unknowns, error, **STYLE[variant])
            for n, x, y in zip(meshes, unknowns, error, strict=True):
                if n in (1, 5, 9, 11, 20, 80):
                    axis.annotate(str(n), (x, y), (4, 4), textcoords="offset points", fontsize=8)
        axis.set_title(SIGNALS[key])
        axis.set_xlabel("coordinates")
        axis.grid(alpha=0.3)
    axes[0].legend()
    axes[0].set_ylabel("rms error / range")
    save(figure, "coordinates")


def stiffness(study: Study, powers: tuple[int, ...], fine: int) -> None:
    """Draws the effect of EI on the signals, and on the error of a mesh."""
    figure, axes = plt.subplots(1, 2, figsize=(13, 5.5))
    base = study.get("nonlinear", fine)
    factors = [10.0**k for k in powers]
    layers = np.array([modes.boundary_layer(f) for f in factors])
    keys = ("coning", "root coning", "chord coning", "strain", "reaction", "spin")
    changes = [errors(study.get("nonlinear", fine, Lane(f)), base) for f in factors]
    for key in keys:
        axes[0].loglog(layers / modes.LENGTH, [c[key][1] for c in changes], marker="o", label=SIGNALS[key])
    x = np.array([1e-7, 3e-2])
    axes[0].loglog(x, 0.5 * (np.pi * x) ** 2, "k--", lw=1, label=r"$(\pi\ell_b/L)^2/2$: shift of mode 1")
    axes[0].axvline(modes.boundary_layer() / modes.LENGTH, color="0.5")
    axes[0].annotate("the scene's EI", (modes.boundary_layer() / modes.LENGTH * 1.3, 1e-2), color="0.4")
    axes[0].set_xlabel(r"$\ell_b/L = \sqrt{EI/T}/L$")
    axes[0].set_ylabel("rms change / range")
    axes[0].set_ylim(1e-12, 1)
    axes[0].set_title(f"effect of EI on the signals ({fine} cables)")
    axes[0].legend(fontsize=8)
    for n, style in ((5, "o-"), (20, "s--")):
        for key, color in (("coning", "tab:blue"), ("root coning", "tab:orange"), ("strain", "tab:red")):
            own = [study.errors("nonlinear", n, Lane(f))[key][1] for f in factors]
            without = study.errors("none", n)[key][1]
            label = f"{SIGNALS[key]}, {n} cables"
            axes[1].loglog(
                layers * n / modes.LENGTH, np.array(own) / without, style, color=color, label=label
            )
    axes[1].axhline(1.0, color="0.5", lw=1)
    axes[1].set_xlabel(r"$\ell_b/l$, element length $l = L/n$")
    axes[1].set_ylabel("error with this EI / error without bending")
    axes[1].set_title("effect of EI on the error of a mesh")
    axes[1].legend(fontsize=8)
    for axis in axes:
        axis.grid(alpha=0.3)
    save(figure, "stiffness")


def frequencies(table: list[dict]) -> None:
    """Draws the errors of frequencies of every interpolation."""
    figure, axes = plt.subplots(1, 3, figsize=(14, 4.8), sharey=True)
    for axis, mode in zip(axes, (1, 2, 3), strict=True):
        for name, marker in zip(modes.INTERPOLATIONS, "svDo", strict=True):
            rows = [row for row in table if row["interpolation"] == name and row["mode"] == mode]
            xy = [(row["unknowns"], row["error"]) for row in rows if row["error"] > 1e-11]
            axis.loglog(*zip(*xy, strict=True), marker=marker, label=name)
        axis.set_title(f"transverse mode {mode}")
        axis.set_xlabel("unknowns of one direction")
        axis.set_xlim(1.0, 200.0)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("relative error of the frequency")
    axes[0].legend()
    save(figure, "frequencies")


def sail_spin(sail: Study) -> None:
    """Draws the spin rate of the sail's hub for cables without bending and trusses."""
    figure, axes = plt.subplots(2, 1, figsize=(12, 8), sharex=True)
    window = TIMES > TIMES[-1] * 2.5 / 3.0
    for axis, variant in zip(axes, ("none", "truss"), strict=True):
        best = sail.reference()
        spin = best.seen["angular_velocity_B"][window, 0] * 1e3
        axis.plot(TIMES[window], spin, "k", lw=3, alpha=0.3, label=f"{best.elements} cables, no bending")
        for n in sail.meshes(variant):
            if n != best.elements:
                spin = sail.get(variant, n).seen["angular_velocity_B"][window, 0] * 1e3
                axis.plot(TIMES[window], spin, lw=1.3, label=f"{n}")
        axis.set_title(f"{STYLE[variant]['label']}, elements per tether:")
        axis.set_ylabel("spin of the hub [mrad/s]")
        axis.legend(ncols=6, loc="upper left", fontsize=8)
        axis.grid(alpha=0.3)
    axes[1].set_xlabel("time [s]")
    save(figure, "sail_spin")
