"""Errors of the closed formulas of mission analysis against the flexible baseline.

python experiments/flat_sail/run.py    # half a minute; writes table.csv, moments.csv, errors.png
"""

import csv
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import esail_jax as esail

HERE = Path(__file__).parent
ANGLES, VOLTAGES, SPINS = (0.0, 10.0, 20.0, 35.0, 50.0), (10e3, 20e3, 40e3), (2e-3, 4e-3, 8e-3)
TURNS = 3
NAMES = ("thrust_O", "thrust_moment_O", "flat_sail_thrust_O", "axisymmetric_thrust_O",
         "axisymmetric_thrust_moment_O", "coning_angle", "sailing_angle", "tether_length")  # fmt: skip


def row(angle, voltage, spin):
    """Means over three turns, and the errors of the formulas in them."""
    turn = 2.0 * np.pi / spin
    run = esail.simulate("baseline", {
        "initial.sailing_angle_deg": angle, "voltage.value": voltage, "initial.spin_rate": spin,
        "integrator.t_end": TURNS * turn, "output.interval": turn / 50.0,
    }, save=NAMES)  # fmt: skip
    mean = {name: np.asarray(run[name]).mean(0) for name in NAMES}
    force, moment = mean["thrust_O"], mean["thrust_moment_O"]
    size = np.linalg.norm(force)

    def direction(f):
        return np.rad2deg(np.arctan2(np.hypot(f[0], f[1]), f[2]))

    def off(name, exact):
        return 100.0 * np.linalg.norm(mean[name] - exact) / np.linalg.norm(exact)

    flat = mean["flat_sail_thrust_O"]
    straight = angle == 0.0
    return {
        "sailing angle [deg]": angle, "voltage [kV]": voltage / 1e3, "spin [mrad/s]": 1e3 * spin,
        "coning angle, mean [deg]": np.rad2deg(mean["coning_angle"].mean()),
        "coning angle, largest [deg]": np.rad2deg(np.asarray(run["coning_angle"]).max()),
        "thrust [mN]": 1e3 * size,
        "flat: size of the thrust [%]": 100.0 * (np.linalg.norm(flat) / size - 1.0),
        "flat: direction of the thrust [deg]": direction(flat) - direction(force),
        "shape: thrust [%]": off("axisymmetric_thrust_O", force),
        "moment [N m]": np.linalg.norm(moment),
        "moment/(thrust L) [%]": 100.0 * np.linalg.norm(moment) / (size * 10e3),
        "shape: moment [%]": float("nan") if straight else off("axisymmetric_thrust_moment_O", moment),
    }  # fmt: skip


def moments():
    """Ratio of the formula's moment to the sail's in every one of ten turns, without and with a ring."""
    chord, turn = 2.0 * (10e3 + 1.0) * np.sin(np.pi / 12), 2.0 * np.pi / 4e-3
    ring = {"length": 0.998 * chord, "area": 3e-9, "density": 1400.0, "youngs_modulus": 5e9,
            "axial_damping_time": 0.5, "slack_strain": 1e-4}  # fmt: skip
    start = {"initial.sailing_angle_deg": 35.0, "integrator.t_end": 10 * turn, "output.interval": turn / 50}
    found = []
    for changes in ({}, {f"auxiliary_tethers.{key}": x for key, x in ring.items()}):
        run = esail.simulate("baseline", start | changes, save=NAMES)
        flexible, formula = (
            np.asarray(run[name])[:-1, 1].reshape(10, 50).mean(1)
            for name in ("thrust_moment_O", "axisymmetric_thrust_moment_O")
        )
        found.append(formula / flexible)
    rows = [
        {"turn": k + 1, "alone": a, "with a ring": b} for k, (a, b) in enumerate(zip(*found, strict=True))
    ]
    write("moments.csv", rows)


def write(name, rows):
    """Writes rows to a table."""
    with (HERE / name).open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows({k: f"{v:.4g}" for k, v in x.items()} for x in rows)


def main():
    rows = []
    for voltage in VOLTAGES:
        for spin in SPINS:
            for angle in ANGLES:
                rows.append(row(angle, voltage, spin))
                print({k: float(f"{v:.3g}") for k, v in rows[-1].items()}, flush=True)
    write("table.csv", rows)
    moments()
    draw(rows)


def draw(rows):
    """Errors against the mean coning angle."""
    figure = Figure((9.0, 3.4), layout="constrained")
    shown = ("flat: size of the thrust [%]", "flat: direction of the thrust [deg]", "shape: moment [%]")
    inclined = [x for x in rows if x["sailing angle [deg]"] > 0.0]
    for axes, name in zip(figure.subplots(1, 3), shown, strict=True):
        for angle in ANGLES[1:]:
            at = [x for x in inclined if x["sailing angle [deg]"] == angle]
            axes.plot(
                [x["coning angle, mean [deg]"] for x in at], [abs(x[name]) for x in at], "o",
                markersize=4, label=f"{angle:g} deg",
            )  # fmt: skip
        axes.set(xlabel="mean coning angle [deg]", ylabel=f"|error|, {name}", xscale="log", yscale="log")
    figure.axes[2].set(yscale="linear", ylim=(0.0, 60.0))
    figure.axes[0].legend(title="sailing angle", fontsize=7)
    figure.savefig(HERE / "errors.png", dpi=70)


if __name__ == "__main__":
    main()
