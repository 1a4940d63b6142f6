"""Growth, beating or numerics? Runs of the baseline over 30, 300 and 1000 spin periods.

    python experiments/pgv_long_runs/run.py

Writes long.csv, lines.csv, variations.csv and figures/*.png beside this file and prints the tables. Runs
are kept (`pgv_common`); the first time they take a quarter of an hour, most of it with fixed steps.
"""

import csv
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "pgv_common"))

import pictures
from analysis import envelope, in_plane, lines, single_line, slow_amplitudes, slow_lines, turns, wave
from cases import LONG_CASES, VARIED, run
from layout import save
from signals import DEGREES

FIRST, LAST = slice(0, 50), slice(-50, None)
"""Spin periods that are compared for growth."""

GUESS = (7.086, 7.016)
"""Lines of the spin rate [1 / spin period] near which the fit starts."""


def spin(solution) -> np.ndarray:
    """The hub's spin rate [mrad/s]."""
    return 1e3 * np.asarray(solution["angular_velocity_B"])[:, 0]


def largest_lag(solution) -> np.ndarray:
    """The largest lagging angle of all tethers [deg], (time)."""
    return DEGREES * np.abs(np.asarray(solution["lagging_angle"])).max(1)


def growth_rows(runs: dict) -> list[dict]:
    """One row per run and signal: its largest envelope in the first and the last 50 periods."""
    rows = []
    for name, solution in runs.items():
        rates = np.asarray(solution["angular_velocity_B"])
        signals = {
            "range of the spin rate [mrad/s]": (spin(solution), np.ptp),
            "largest lagging angle [deg]": (largest_lag(solution), np.max),
            "largest of the other rates [mrad/s]": (1e3 * np.hypot(rates[:, 1], rates[:, 2]), np.max),
            "range of the sailing angle [deg]": (DEGREES * np.asarray(solution["sailing_angle"]), np.ptp),
        }
        for what, (signal, measure) in signals.items():
            sizes = envelope(turns(solution), signal, measure)
            rows.append(
                {
                    "run": name,
                    "signal": what,
                    "first 50": sizes[FIRST].max(),
                    "last 50": sizes[LAST].max(),
                    "largest": sizes.max(),
                    "at turn": int(sizes.argmax()),
                }
            )
    return rows


def line_rows(runs: dict) -> list[dict]:
    """Measured and predicted lines of the run at 10 deg, and of the Sun-facing run."""
    tilted, rows = runs["long-alpha-10"], []

    def add(what: str, measured: float, predicted: float, source: str) -> None:
        rows.append({"quantity": what, "measured": measured, "predicted": predicted, "prediction": source})

    for name in ("long-alpha-0", "long-alpha-10"):
        times = turns(runs[name])
        coning = lines(times, np.asarray(runs[name]["coning_angle"]).mean(1), (1.0, 7.086))
        upper, lower = lines(times, spin(runs[name]), GUESS).frequency
        add(
            f"{name}: upper line of the spin rate",
            upper,
            coning.frequency[1],
            "bending line of mean coning",
        )
        add(
            f"{name}: lower line of the spin rate",
            lower,
            in_plane(coning.frequency[1]),
            "sqrt(upper^2 - 1)",
        )
        tops = envelope(times, spin(runs[name]))
        quiet = [
            k
            for k in range(1, len(tops) - 1)
            if tops[k] <= min(tops[k - 1], tops[k + 1]) and tops[k] < 0.3 * tops.max()
        ]
        period = (quiet[-1] - quiet[0]) / (len(quiet) - 1)
        beat = 1.0 / (coning.frequency[1] - in_plane(coning.frequency[1]))
        add(
            f"{name}: spin periods from one minimum of the oscillation to the next",
            period,
            beat,
            "difference of both",
        )
    slow = lines(turns(tilted), wave(np.asarray(tilted["lagging_angle"]), 1), (0.042, -0.046, 1.0))
    below, above = slow_lines(tilted.scene)
    sizes = DEGREES * slow_amplitudes(tilted.scene, slow.amplitude[2])
    add("10 deg: slow line of lagging, with the spin", slow.frequency[0], above, "f^2 - eps = q (f - 1)^2")
    add(
        "10 deg: slow line of lagging, against the spin",
        slow.frequency[1],
        below,
        "f^2 - eps = q (f - 1)^2",
    )
    add("10 deg: amplitude of the first [deg]", DEGREES * slow.amplitude[0], sizes[1], "start at rest")
    add("10 deg: amplitude of the second [deg]", DEGREES * slow.amplitude[1], sizes[0], "start at rest")
    add("10 deg: part of the wave outside these lines", slow.rest, 0.0, "")
    for name in ("longest-alpha-0.01", "longest-alpha-10"):
        rates = np.asarray(runs[name]["angular_velocity_B"])
        tops = (
            envelope(turns(runs[name]), np.hypot(rates[:, 1], rates[:, 2]), np.max).reshape(-1, 50).max(1)
        )
        for first, last in ((400, 700), (700, 1000)):
            part = np.log(tops[first // 50 : last // 50])
            slope = float(np.polyfit(50.0 * np.arange(len(part)), part, 1)[0])
            add(f"{name}: growth of the other rates per spin period, {first} to {last}", slope, np.nan, "")
    add("fixed hub: line of one tether", np.nan, single_line(tilted.scene), "sqrt(eps)")
    return rows


def variation_rows(runs: dict) -> list[dict]:
    """One row per varied run of 30 periods: lines, largest motion, differences from the first."""
    reference, rows = next(iter(runs.values())), []
    base = {"spin": spin(reference), "lag": DEGREES * np.asarray(reference["lagging_angle"])}
    for name, solution in runs.items():
        upper, lower = lines(turns(solution), spin(solution), GUESS).frequency
        other = {"spin": spin(solution), "lag": DEGREES * np.asarray(solution["lagging_angle"])}
        gaps = {key: np.sqrt(np.mean((other[key] - x) ** 2)) / np.ptp(x) for key, x in base.items()}
        rows.append(
            {
                "run": VARIED[name].label,
                "upper line": upper,
                "lower line": lower,
                "beat [spin periods]": 1.0 / (upper - lower),
                "largest range of spin [mrad/s]": envelope(turns(solution), other["spin"]).max(),
                "largest lagging [deg]": np.abs(other["lag"]).max(),
                "rms difference of spin / range": gaps["spin"],
                "rms difference of lagging / range": gaps["lag"],
                "energy balance error [J]": np.abs(np.asarray(solution["energy_balance_error"])).max(),
            }
        )
    return rows


def text_of(value) -> str:
    """A number with five digits, nothing for NaN, and other values as text."""
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value:.5g}"
    return str(value)


def write(name: str, rows: list[dict]) -> None:
    """Writes a table beside this file and prints it."""
    rows = [{k: text_of(v) for k, v in row.items()} for row in rows]
    with open(HERE / name, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(f"\n{name}: {' | '.join(rows[0])}")
    for row in rows:
        print(" | ".join(map(str, row.values())))


def main() -> None:
    """Runs everything, writes the tables and the figures."""
    varied = {name: run(name, case) for name, case in VARIED.items()}
    runs = {name: run(name, case) for name, case in LONG_CASES.items()}
    write("variations.csv", variation_rows(varied))
    write("long.csv", growth_rows(runs))
    write("lines.csv", line_rows(runs))
    save(pictures.histories(runs), HERE / "figures" / "histories.png")
    save(pictures.tilt(runs), HERE / "figures" / "tilt.png")
    save(pictures.spectra(runs), HERE / "figures" / "spectra.png")
    save(pictures.variations(varied), HERE / "figures" / "variations.png")


if __name__ == "__main__":
    main()
