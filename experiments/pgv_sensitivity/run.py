"""Sensitivity of the baseline's motion to spin rate, tether length and remote-unit mass.

    python experiments/pgv_sensitivity/run.py              # sensitivity.csv, sweep.csv and sweep.png
    python experiments/pgv_sensitivity/run.py --torque     # torque.csv: the derivative that differs

Writes the files beside this one and prints the tables. Some minutes, most of them for compiling the
derivative; half a minute with --torque.
"""

import csv
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "pgv_common"))

from layout import BLACK, BLUE, VERMILION, Line, Panel, draw, save

import esail_jax as esail

TURNS, INSTANTS = 3, 600
"""Spin periods, and saved intervals in them (an even number: Simpson's rule)."""

SPIN, LENGTH, MASS = 4e-3, 10e3, 1.5
"""Spin rate [rad/s], tether length [m] and mass of a remote unit [kg] of the baseline."""

NUMBERS = ("spin rate", "tether length", "remote-unit mass")

ANGLES = (10.0, 0.0)
"""Sailing angles [deg]."""

STEP = 1e-3
"""Relative step of the differences, which are of fourth order."""

FACTORS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.4, 1.6, 1.8, 2.0)
"""Factors of a number in the sweep."""

MEASURES = {
    "coning, mean": ("coning_angle", "deg", 180.0 / np.pi, False),
    "lagging, rms": ("lagging_angle", "deg", 180.0 / np.pi, True),
    "spin oscillation, rms": ("angular_velocity_B", "1e-3 of the spin", 1e3, True),
    "spin drift, mean": ("angular_velocity_B", "1e-3 of the spin", 1e3, False),
    "torque on the hub, rms": ("reaction_moment_O", "mN m", 1e3, True),
    "moment of the thrust, rms": ("thrust_moment_O", "N m", 1.0, True),
}
"""Observable, unit, factor, and whether the root of the mean square is taken."""

SAVED = ("coning_angle", "lagging_angle", "angular_velocity_B", "reaction_moment_O", "thrust_moment_O")


def overrides(factors, angle, turn: float) -> dict:
    """The overrides for factors of the three numbers. turn: spin period that sets the end [s]."""
    return {
        "initial.spin_rate": SPIN * factors[0],
        "tethers.length": LENGTH * factors[1],
        "remote_units.mass": MASS * factors[2],
        "initial.sailing_angle_deg": angle,
        "integrator.t_end": TURNS * turn,
        "output.interval": TURNS * turn / INSTANTS,
    }


def histories(run, spin_rate):
    """The quantities whose means over time are the measures, (time, measure)."""
    rows = {name: jnp.asarray(run[name]) for name in SAVED}
    change = rows["angular_velocity_B"][:, 0] / spin_rate - 1.0
    return jnp.stack(
        [
            rows["coning_angle"].mean(1),
            (rows["lagging_angle"] ** 2).mean(1),
            change**2,
            change,
            (rows["reaction_moment_O"] ** 2).sum(1),
            (rows["thrust_moment_O"] ** 2).sum(1),
        ],
        axis=1,
    )


def time_mean(values):
    """The mean over time by Simpson's rule, (measure)."""
    inner = 4.0 * values[1:-1:2].sum(0) + 2.0 * values[2:-2:2].sum(0)
    return (values[0] + inner + values[-1]) / (3.0 * (len(values) - 1))


def means_and_ends(factors, angle):
    """The means over three baseline spin periods, and the last values."""
    turn = 2.0 * np.pi / SPIN
    run = esail.simulate("baseline", overrides(factors, angle, turn), save=SAVED)
    found = histories(run, SPIN * factors[0])
    return time_mean(found), found[-1]


def measured(factors, angle: float) -> np.ndarray:
    """The measures of a run over three of its own spin periods."""
    turn = 2.0 * np.pi / (SPIN * factors[0])
    run = esail.simulate("baseline", overrides([float(x) for x in factors], angle, turn), save=SAVED)
    return final(np.asarray(time_mean(histories(run, SPIN * factors[0]))))


def final(means: np.ndarray) -> np.ndarray:
    """The measures in their units from the means."""
    rows = [
        factor * (np.sqrt(mean) if rms else mean)
        for mean, (_, _, factor, rms) in zip(means, MEASURES.values(), strict=True)
    ]
    return np.array(rows)


def derivatives(jacobian, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """The measures, and their derivatives by the logarithms of the three numbers (measure, number).

    With the spin rate the end of the run changes, too: the derivative of a mean over [0, T], T proportional
    to 1 / spin rate, has the additional part mean - last value.
    """
    ones = jnp.ones(3)
    (slopes, _), (means, ends) = jacobian(ones, angle)
    slopes, means, ends = (np.array(x) for x in (slopes, means, ends))
    slopes[:, 0] += means - ends
    values = final(means)
    for row, (value, (_, _, factor, rms)) in enumerate(zip(values, MEASURES.values(), strict=True)):
        slopes[row] *= factor**2 / (2.0 * value) if rms else factor
    return values, slopes


def differences(angle: float) -> np.ndarray:
    """The same derivatives by differences of runs, of fourth order (measure, number)."""
    columns = []
    for k in range(3):
        ends = [measured(1.0 + step * STEP * np.eye(3)[k], angle) for step in (-2, -1, 1, 2)]
        columns.append((8.0 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12.0 * STEP))
    return np.stack(columns, axis=1)


def sweep(angle: float) -> list[dict]:
    """The measures for every factor of every number."""
    rows = []
    for k, number in enumerate(NUMBERS):
        for factor in FACTORS:
            factors = np.where(np.arange(3) == k, factor, 1.0)
            values = dict(zip(MEASURES, measured(factors, angle), strict=True))
            rows.append({"sailing_deg": angle, "number": number, "factor": factor} | values)
    return rows


def picture(rows: list[dict], found: dict):
    """The figure of the sweep, with the tangents of forward mode."""
    grid = []
    for m, (measure, (_, unit, _, _)) in enumerate(MEASURES.items()):
        panels = []
        for k, number in enumerate(NUMBERS):
            lines = []
            for angle, colour in zip(ANGLES, (VERMILION, BLUE), strict=True):
                part = [row for row in rows if row["number"] == number and row["sailing_deg"] == angle]
                x = np.array([row["factor"] for row in part])
                lines.append(
                    Line(x, [row[measure] for row in part], f"{angle:g} deg", colour, "-", 1.0, "o")
                )
                values, slopes, _ = found[angle]
                near = np.array([0.9, 1.1])
                tangent = values[m] + slopes[m, k] * (near - 1.0)
                lines.append(Line(near, tangent, "tangent (forward mode)", BLACK, "-", 1.8))
            panels.append(
                Panel("", f"{measure}\n[{unit}]".replace(", ", "\n"), lines, f"{number} / baseline")
            )
        grid.append(panels)
    return draw(
        "Three spin periods: effect of spin rate, tether length and remote-unit mass", grid, height=1.7
    )


def write(name: str, rows: list[dict]) -> None:
    """Writes a table beside this file."""
    with open(HERE / name, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.5g}" if isinstance(v, float) else v for k, v in row.items()})


REFINEMENTS = ((600, 1e-3), (1200, 1e-3), (1200, 5e-4))
"""Saved intervals, and relative steps of the differences, with which the torque is looked at again."""


def torque() -> None:
    """Writes torque.csv: the derivative of the mean square of the hub's torque at 10 deg by the logarithm
    of the spin rate, by differences of runs over their own spin periods, and by differences of runs of one
    duration with the part of the moving end, mean minus last value."""
    place, rows = list(MEASURES).index("torque on the hub, rms"), []
    for instants, step in REFINEMENTS:

        def history(factor, turn, instants=instants):
            settings = overrides((float(factor), 1.0, 1.0), 10.0, turn)
            settings["output.interval"] = TURNS * turn / instants
            run = esail.simulate("baseline", settings, save=SAVED)
            return np.asarray(histories(run, SPIN * factor))[:, place]

        turn, found = 2.0 * np.pi / SPIN, []
        for own in (True, False):
            factors = [1.0 + k * step for k in (-2, -1, 1, 2)]
            ends = [time_mean(history(f, turn / f if own else turn)) for f in factors]
            found.append((8.0 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12.0 * step))
        middle = history(1.0, turn)
        found[1] += time_mean(middle) - middle[-1]
        row = {"intervals": instants, "step": step, "own spin periods [N^2 m^2]": float(found[0])}
        row |= {"one duration, mean minus last value": float(found[1])}
        rows.append(row | {"difference": float(abs(found[1] / found[0] - 1.0))})
        print(" | ".join(f"{v:.5g}" for v in rows[-1].values()), flush=True)
    write("torque.csv", rows)


def main() -> None:
    """Computes, checks, sweeps, writes."""
    began = time.perf_counter()

    def both(factors, angle):
        return jax.jacfwd(means_and_ends)(factors, angle), means_and_ends(factors, angle)

    jacobian = esail.jit(both)
    found, rows = {}, []
    for angle in ANGLES:
        values, slopes = derivatives(jacobian, jnp.asarray(angle))
        print(f"forward mode, {angle:g} deg: {time.perf_counter() - began:.0f} s", flush=True)
        checks = differences(angle)
        found[angle] = values, slopes, checks
        for m, (measure, (_, unit, _, _)) in enumerate(MEASURES.items()):
            row = {"sailing_deg": angle, "measure": measure, "unit": unit, "value": float(values[m])}
            for k, number in enumerate(NUMBERS):
                row[f"d/dlog {number}"] = float(slopes[m, k])
                row[f"power of {number}"] = float(slopes[m, k] / values[m])
            row["largest difference"] = float(np.abs(checks[m] - slopes[m]).max() / np.abs(checks[m]).max())
            rows.append(row)
    write("sensitivity.csv", rows)
    for row in rows:
        print(" | ".join(f"{v:.4g}" if isinstance(v, float) else str(v) for v in row.values()))
    swept = [row for angle in ANGLES for row in sweep(angle)]
    write("sweep.csv", swept)
    save(picture(swept, found), HERE / "sweep.png")
    print(f"{time.perf_counter() - began:.0f} s")


if __name__ == "__main__":
    torque() if "--torque" in sys.argv else main()
