"""Convergence of cables and trusses: Fig. 4 and 5 of [PGV].

    python experiments/pgv_convergence/run.py
    python experiments/pgv_convergence/run.py --timing    # measures the run times again, on a quiet machine

Runs the baseline at 10 deg over three spin periods with 1 to 9 elements per tether and three models of a
tether, and writes convergence.csv and figures/*.png beside this file. Run times are those of run_times.csv.
"""

import csv
import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "pgv_common"))

from kept_runs import ELEMENTS, MODELS, PAPERS_METHOD, model_run
from layout import BLACK, BLUE, GREEN, SKY, VERMILION, Line, Panel, draw, save
from signals import DEGREES, norm, peak_frequency, turns

import esail_jax as esail

STYLES = {
    "cable": (BLUE, "-", "o"),
    "cable, no bending": (SKY, "--", "x"),
    "truss": (VERMILION, "-", "s"),
}
"""Colour, dashes and marker of the models."""

SHOWN = {1: (BLACK, ":"), 3: (GREEN, "-"), 5: (VERMILION, "-"), 7: (SKY, "-"), 9: (BLUE, "--")}
"""Numbers of elements whose histories are drawn, with their colours and dashes."""

FINEST = max(ELEMENTS)

REPETITIONS = 3
"""Timed runs of each kind, after one that loads or compiles its programs. The shortest counts."""

TIMES = HERE / "run_times.csv"


def measure_times() -> None:
    """Measures the processor time [s] of every kind of run, and writes it."""
    rows = []
    for model in MODELS:
        for n in ELEMENTS:
            overrides = PAPERS_METHOD | MODELS[model] | {"tethers.elements": n}
            seconds = []
            for _ in range(REPETITIONS + 1):
                begin = time.process_time()
                esail.simulate("baseline", overrides)
                seconds.append(time.process_time() - begin)
            rows.append({"model": model, "elements": n, "seconds": f"{min(seconds[1:]):.3f}"})
            print(rows[-1], flush=True)
    write(TIMES, rows)


def write(path: Path, rows: list[dict]) -> None:
    """Writes a table."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()})


def measures(runs: dict) -> list[dict]:
    """One row per model and number of elements: the quantities of Fig. 4, and the errors relative
    to nine cables."""
    reference, rows = runs["cable", FINEST], []
    with open(TIMES, encoding="utf-8") as file:
        times = {
            (row["model"], int(row["elements"])): float(row["seconds"]) for row in csv.DictReader(file)
        }
    for (model, n), run in runs.items():
        rows.append(
            {
                "model": model,
                "elements": n,
                "thrust_N": norm(run["thrust_O"]).mean(),
                "thrust_angle_deg": DEGREES * run["thrust_angle"].mean(),
                "max_strain": run["max_axial_strain"][:, 0].max(),
                "run_time_s": times[model, n],
                "spin_range_rad_s": np.ptp(run["angular_velocity_B"][:, 0]),
                "spin_line_hz": peak_frequency(run, run["angular_velocity_B"][:, 0], 2e-3, 0.02),
                **{f"error_omega_{k + 1}": error(run, reference, k) for k in range(3)},
            }
        )
    return rows


def error(run, reference, component: int) -> float:
    """The rms difference of an angular rate from the reference, relative to its range."""
    mine, true = (r["angular_velocity_B"][:, component] for r in (run, reference))
    return float(np.sqrt(np.mean((mine - true) ** 2)) / np.ptp(true))


def normalised(rows: list[dict]):
    """The figure after Fig. 4: quantities over the number of elements, relative to one cable."""
    first = next(row for row in rows if row["model"] == "cable" and row["elements"] == 1)
    threshold = model_run("cable", 1).scene.integrator.t_end / first["run_time_s"]

    def panel(letter: str, key: str, ylabel: str, **extra) -> Panel:
        lines = []
        for model, (colour, dashes, marker) in STYLES.items():
            part = [row for row in rows if row["model"] == model]
            lines.append(
                Line(
                    [row["elements"] for row in part],
                    [row[key] / first[key] for row in part],
                    model,
                    colour,
                    dashes,
                    marker=marker,
                )
            )
        return Panel(letter, ylabel, lines + extra.pop("more", []), "elements per tether $n$ [-]", **extra)

    limit = Line(ELEMENTS, [threshold] * len(ELEMENTS), "real-time threshold (RTCT)", BLACK, ":")
    return draw(
        "[PGV] Fig. 4: quantities relative to those of one cable per tether, 10 deg",
        [
            [
                panel("a", "thrust_N", r"mean $\|F_c\|_n / \|F_c\|_1$ [-]"),
                panel("b", "thrust_angle_deg", r"mean $\Gamma_{c,n} / \Gamma_{c,1}$ [-]"),
            ],
            [
                panel("c", "max_strain", r"$\epsilon_{max,n} / \epsilon_{max,1}$ [-]"),
                panel("d", "run_time_s", "run time, $t_n / t_1$ [-]", log="y", more=[limit]),
            ],
        ],
        width=4.6,
        height=2.5,
    )


def rates(runs: dict):
    """The figure after Fig. 5: angular rates of cables (a, b) and trusses (c, d)."""

    def row(letter: str, model: str, detail: bool) -> list[Panel]:
        panels = []
        for k in range(3):
            lines = []
            for n, (colour, dashes) in SHOWN.items():
                run = runs[model, n]
                part = turns(run) >= (2.5 if detail else 0.0)
                rate = run["angular_velocity_B"][part, k]
                lines.append(Line(turns(run)[part], 1e3 * rate, f"$n = {n}$", colour, dashes, 0.8))
            panels.append(Panel(f"{letter}{k + 1}, {model}", rf"$\omega_{k + 1}^B$ [mrad/s]", lines))
        return panels

    rows = [
        row("a", "cable", False),
        row("b", "cable", True),
        row("c", "truss", False),
        row("d", "truss", True),
    ]
    return draw(
        "[PGV] Fig. 5: angular rates of the hub for n elements per tether, 10 deg", rows, height=1.9
    )


def main() -> None:
    """Runs everything, writes the tables and the figures, prints the table."""
    if "--timing" in sys.argv[1:]:
        measure_times()
    runs = {(model, n): model_run(model, n) for model in MODELS for n in ELEMENTS}
    rows = measures(runs)
    write(HERE / "convergence.csv", rows)
    save(normalised(rows), HERE / "figures" / "fig-04.png")
    save(rates(runs), HERE / "figures" / "fig-05.png")
    for row in rows:
        print("  ".join(f"{v:.5g}" if isinstance(v, float) else str(v) for v in row.values()))


if __name__ == "__main__":
    main()
