"""Makes table.csv, the figure and the README's tables from the lines that run.py writes.

python experiments/work_precision/tables.py
"""

import csv
import json
from pathlib import Path

import matplotlib
import numpy as np
from scenes import CASES

matplotlib.use("agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).parent

SIGNALS = (
    "tip_position_I",
    "hub_position_I",
    "coning_angle",
    "lagging_angle",
    "root_coning_angle",
    "root_lagging_angle",
    "tether_length",
    "max_axial_strain",
    "angular_velocity_B",
    "sailing_angle",
    "thrust_O",
    "reaction_B",
    "kinetic_energy",
    "elastic_energy",
)
"""The 14 signals of all codes, as in experiments/peer_exudyn: motion, forces and energies."""

TITLES = {
    "peer": "12 x 5, engineering strain",
    "baseline": "baseline, 12 x 5",
    "unequal": "7 unequal tethers x 5",
    "fine": "12 x 20",
}
BOUNDS = (1e-2, 1e-3, 1e-4)
STYLES = {
    "collocation": ("collocation", "o-", "C0"),
    "generalized-alpha": ("generalized-alpha", "o-", "C1"),
    "energy-momentum": ("energy-momentum", "o-", "C4"),
    "exudyn": ("Exudyn, generalized-alpha", "s", "C2"),
    "rk4": ("explicit Runge-Kutta 4", "^", "C3"),
}
"""Label, marker and colour of each method."""


def read(scene: str) -> list[dict]:
    """The lines of a scene, with the worst of the shared signals and the time of the whole span."""
    with open(HERE / f"{scene}.jsonl", encoding="utf-8") as file:
        entries = [json.loads(text) for text in file]
    for entry in entries:
        shared = {name: entry["errors"][name] for name in SIGNALS if name in entry["errors"]}
        entry["signal"] = max(shared, key=shared.get)
        entry["error"] = shared[entry["signal"]]
        entry["tips"] = shared["tip_position_I"]
        entry["span"] = entry.get("span", entry["t_end"])
        scale = entry["t_end"] / entry["span"]
        entry["seconds"] = scale * (entry["processor_s"] or entry["run_s"])
        entry["wall"] = scale * entry["run_s"]
    return entries


def row(entry: dict) -> dict[str, str]:
    """A row of table.csv."""
    key = "step" if "step" in entry else "tolerance"
    return {
        "scene": entry["scene"],
        "method": entry["method"],
        "setting": f"{key} {entry[key]:g}",
        "span_s": f"{entry['span']:g}",
        "steps": str(entry["steps"]),
        "processor_s": f"{entry['seconds']:.3g}" if entry["processor_s"] else "",
        "wall_s": f"{entry['wall']:.3g}",
        "compile_s": f"{entry['compile_s']:.3g}",
        "yardstick_gflops": f"{entry['yardstick_gflops']:.0f}",
        "tips": f"{entry['tips']:.1e}",
        "worst_signal": f"{entry['error']:.1e}",
        "which": entry["signal"],
        "worst_of_all": f"{entry['worst_error']:.1e}",
        "which_of_all": entry["worst_observable"],
    }


def curve(entries: list[dict], method: str) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and errors of a method's runs, coarsest first; runs over a short span are left
    out."""
    runs = [x for x in entries if x["method"] == method and x["role"] != "reference"]
    runs = [x for x in runs if x["span"] > 0.3 * x["t_end"]]
    return np.array([x["seconds"] for x in runs]), np.array([x["error"] for x in runs])


def seconds_for(entries: list[dict], method: str, bound: float) -> float:
    """The time [s] at which a method's error is `bound`, by a power law between two runs.

    The time of the fastest run if its error is already below the bound; nan if no run reaches the bound."""
    seconds, error = curve(entries, method)
    if not len(error) or error.min() > bound:
        return np.nan
    fine = int(np.argmax(error <= bound))
    if fine == 0:
        return seconds[0]
    x, y = np.log(error[[fine, fine - 1]]), np.log(seconds[[fine, fine - 1]])
    return float(np.exp(np.interp(np.log(bound), x, y)))


def at_equal_error(entries: list[dict]) -> list[str]:
    """Markdown rows: time [s] of each method at every bound, in brackets relative to
    collocation."""
    methods = [m for m in dict.fromkeys(x["method"] for x in entries) if len(curve(entries, m)[0]) > 1]
    found = [f"| worst error | {' | '.join(methods)} |", "|---" * (len(methods) + 1) + "|"]
    for bound in BOUNDS:
        best = seconds_for(entries, "collocation", bound)
        times = [seconds_for(entries, method, bound) for method in methods]
        cells = ["-" if np.isnan(x) else f"{x:.2f} s ({x / best:.1f})" for x in times]
        found.append(f"| {bound:g} | {' | '.join(cells)} |")
    return found


def draw(found: dict[str, list[dict]]) -> None:
    """Draws the worst error against run time, one line per method."""
    figure, axes = plt.subplots(
        1, len(found), figsize=(3.4 * len(found), 3.4), sharex=True, sharey=True, squeeze=False
    )
    for axis, (scene, entries) in zip(axes[0], found.items(), strict=True):
        for method in dict.fromkeys(x["method"] for x in entries):
            seconds, error = curve(entries, method)
            if not len(error):
                continue
            label, style, colour = STYLES[method]
            axis.loglog(seconds, error, style, ms=3.5, lw=1.0, color=colour, label=label)
        axis.set_title(f"{TITLES[scene]}, {entries[0]['t_end']:g} s", fontsize=9)
        axis.set_xlabel("run time, s of one core")
        axis.grid(alpha=0.3)
    axes[0, 0].set_ylabel("worst error / range")
    shown = [axis.get_legend_handles_labels() for axis in axes[0]]
    handles = {label: line for pair in shown for line, label in zip(*pair, strict=True)}
    axes[0, 0].legend(handles.values(), handles.keys(), fontsize=6)
    figure.tight_layout()
    figure.savefig(HERE / "work_precision.png", dpi=110)


def main() -> None:
    """Reads the lines, writes the table and the figure, prints the README's tables."""
    found = {scene: read(scene) for scene in CASES if (HERE / f"{scene}.jsonl").exists()}
    found = {scene: entries for scene, entries in found.items() if entries}
    rows = [row(entry) for entries in found.values() for entry in entries]
    with open(HERE / "table.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    for entry in rows:
        print("| " + " | ".join(entry.values()) + " |")
    for scene, entries in found.items():
        print(f"\n{scene}", *at_equal_error(entries), sep="\n")
    draw(found)


if __name__ == "__main__":
    main()
