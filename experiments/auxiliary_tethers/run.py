"""What a ring of auxiliary tethers does to the baseline with unequal voltages and lengths.

python experiments/auxiliary_tethers/run.py    # minutes; writes table.csv, lagging.png
python experiments/auxiliary_tethers/run.py --times    # time per step by number of tethers: times.csv
"""

import csv
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import esail_jax as esail

HERE = Path(__file__).parent
TETHERS, LENGTH, TURN = 12, 10e3, 2.0 * np.pi / 4e-3
TURNS = 20
CHORD = 2.0 * (LENGTH + 1.0) * np.sin(np.pi / TETHERS)
"""Distance [m] of neighbouring tips of the baseline: roots at 1 m."""

RING = {
    "auxiliary_tethers.area": 3e-9,
    "auxiliary_tethers.density": 1400.0,
    "auxiliary_tethers.youngs_modulus": 5e9,
    "auxiliary_tethers.axial_damping_time": 0.5,
    "auxiliary_tethers.slack_strain": 1e-4,
}
"""A tape of Kapton that cannot push: EA = 15 N, 22 g per segment."""

RINGS = {
    "none": None,
    "taut (0.2 % short)": 0.998 * CHORD,
    "just closed": CHORD,
    "slack (2 % long)": 1.02 * CHORD,
}

PATTERN = np.random.default_rng(1).uniform(-1.0, 1.0, TETHERS)
CASES = {
    "equal": {},
    "voltages +-1 %": {"voltage.value": (20e3 * (1.0 + 0.01 * PATTERN)).tolist()},
    "voltages +-10 %": {"voltage.value": (20e3 * (1.0 + 0.1 * PATTERN)).tolist()},
    "lengths +-0.1 %": {"tethers.length": (LENGTH * (1.0 + 1e-3 * PATTERN)).tolist()},
    "one tether off": {"voltage.value": [0.0] + [20e3] * (TETHERS - 1)},
    "sailing angle 35 deg": {"initial.sailing_angle_deg": 35.0},
}
SAVED = (
    "coning_angle",
    "lagging_angle",
    "angular_velocity_B",
    "sailing_angle",
    "smallest_tether_distance",
    "auxiliary_tension",
)


def simulated(case, length):
    """The run of a case with segments of a length, or without a ring."""
    ring = {} if length is None else RING | {"auxiliary_tethers.length": length}
    end = {"integrator.t_end": TURNS * TURN, "output.interval": TURN / 100.0}
    names = SAVED if ring else SAVED[:-1]
    return esail.simulate("baseline", CASES[case] | ring | end, save=names)


def measures(run):
    """Spreads over the tethers (largest over time, in degrees), hub motion, distance and tension."""
    coning, lagging = (np.rad2deg(np.asarray(run[name])) for name in SAVED[:2])
    omega = np.asarray(run["angular_velocity_B"])
    row = {
        "coning spread [deg]": np.ptp(coning, axis=1).max(),
        "lagging spread [deg]": np.ptp(lagging, axis=1).max(),
        "largest lagging [deg]": np.abs(lagging).max(),
        "wobble of the hub [rad/s]": np.linalg.norm(omega[:, 1:], axis=1).max(),
        "change of spin [%]": 100.0 * np.abs(omega[:, 0] / omega[0, 0] - 1.0).max(),
        "change of sailing angle [deg]": np.rad2deg(np.ptp(np.asarray(run["sailing_angle"]))),
        "smallest distance [m]": np.asarray(run["smallest_tether_distance"]).min(),
        "smallest tension [mN]": float("nan"),
        "largest tension [mN]": float("nan"),
    }
    if "auxiliary_tension" in run.observables:
        tension = 1e3 * np.asarray(run["auxiliary_tension"])
        row |= {"smallest tension [mN]": tension.min(), "largest tension [mN]": tension.max()}
    return row


def study():
    """Writes the table and the figure."""
    rows, curves = [], {}
    for case in CASES:
        for ring, length in RINGS.items():
            run = simulated(case, length)
            rows.append({"case": case, "ring": ring} | measures(run))
            curves[case, ring] = np.asarray(run.time) / TURN, np.rad2deg(np.asarray(run["lagging_angle"]))
            print(
                {k: v if isinstance(v, str) else float(f"{v:.4g}") for k, v in rows[-1].items()}, flush=True
            )
    write("table.csv", rows)
    figure = Figure((9.0, 6.0), layout="constrained")
    shown = ("voltages +-10 %", "sailing angle 35 deg"), ("none", "just closed")
    for axes, key in zip(
        figure.subplots(2, 2, sharex=True).flat, [(a, b) for a in shown[0] for b in shown[1]], strict=True
    ):
        axes.plot(*curves[key], linewidth=0.8)
        axes.set(title=f"{key[0]}, ring: {key[1]}", xlabel="turns", ylabel="lagging angle [deg]")
    figure.savefig(HERE / "lagging.png", dpi=60)


def times():
    """Writes the time per step with and without a ring, by method and number of tethers."""
    rows = []
    for method, step in (("collocation", 2.0), ("generalized-alpha", 0.1), ("energy-momentum", 0.1)):
        for count in (12, 50, 200):
            settings = {"integrator.method": method, "integrator.step": step, "integrator.t_end": 40.0}
            settings |= {"output.interval": 40.0, "tethers.count": count}
            chord = 2.0 * (LENGTH + 1.0) * np.sin(np.pi / count)
            ring = settings | RING | {"auxiliary_tethers.length": 0.9995 * chord}
            best = [np.inf, np.inf]
            for _ in range(5):
                for k, scene in enumerate((settings, ring)):
                    stats = esail.simulate("baseline", scene, save=("sailing_angle",)).stats
                    best[k] = min(best[k], 1e6 * stats["wall_time"] / stats["steps"])
            rows.append({"method": method, "tethers": count, "without ring [us]": best[0],
                         "with ring [us]": best[1], "ratio": best[1] / best[0]})  # fmt: skip
            print(rows[-1], flush=True)
    write("times.csv", rows)


def write(name, rows):
    """Writes rows to a table."""
    with (HERE / name).open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        for row in rows:
            table.writerow({k: v if isinstance(v, (str, int)) else f"{v:.4g}" for k, v in row.items()})


if __name__ == "__main__":
    times() if "--times" in sys.argv else study()
