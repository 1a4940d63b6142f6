"""Designs the torque problem for gusts and uncertain tether lengths, and checks it on other draws.

python experiments/voltage_design/robust.py    # after run.py torque

Writes robust.csv, robust.toml and robust.png.
"""

import csv
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from run import TORQUE, TURN, WAVES, finer, plain, planar_cone_harmonic

import esail_jax as esail
from esail_jax.design import Design, objectives
from esail_jax.environment.gusts import gusty_wind
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.toml_text import to_toml

HERE = Path(__file__).parent
TETHERS, LENGTH = 12, 10e3
LENGTH_ERROR = 0.005
"""Standard deviation of a tether's length, relative to the length: 50 m."""

SEEN, HELD_OUT = 12, 16
"""Number of draws of the design, and of the check."""

ITERATIONS = 6
NUMBERS = ("mean-torque", "thrust")
WIND = ("speed", "number_density")


def draws(first: int, count: int) -> dict[str, np.ndarray]:
    """Time series of the wind and tether lengths for `count` seeds from `first`.

    The logarithms of speed (5 %) and number density (30 %) are Ornstein-Uhlenbeck processes, correlated
    over 600 s; the errors of lengths are normal."""
    seeds = range(first, first + count)
    winds = [gusty_wind(seed, TURN) for seed in seeds]
    errors = np.stack([np.random.default_rng((seed, 1)).normal(size=TETHERS) for seed in seeds])
    series = {f"solar_wind.{key}": np.stack([wind[key] for wind in winds]) for key in WIND}
    return series | {"tethers.length": LENGTH * (1.0 + LENGTH_ERROR * errors)}


def sail() -> Scene:
    """The scene of `torque` in a constant wind that is given at the instants of the gusts."""
    steady = esail.load_scene("baseline", TORQUE)
    instants = gusty_wind(0, TURN)["time"]
    series = {f"solar_wind.{key}": [getattr(steady.solar_wind, key)] * len(instants) for key in WIND}
    return steady.replace({"solar_wind.time": instants.tolist(), **series})


def measured(scene: Scene, circumstances: dict[str, np.ndarray]) -> np.ndarray:
    """Simulates the scene in every circumstance and returns NUMBERS (draw, number)."""
    rows = []
    for i in range(len(circumstances["tethers.length"])):
        run = esail.simulate(scene, {key: x[i].tolist() for key, x in circumstances.items()})
        rows.append([float(x) for x in objectives.values(run, NUMBERS).values()])
    return np.array(rows)


def summary(name: str, mesh: str, found: np.ndarray, constant: np.ndarray) -> tuple:
    """A row of robust.csv: mean and largest squared torque, reduction of the mean relative to
    constant voltage, and the least thrust relative to constant voltage in the same wind."""
    torque, before = found[:, 0], constant[:, 0]
    kept = (found[:, 1] / constant[:, 1]).min()
    return (name, mesh, torque.mean(), torque.max(), before.mean() / torque.mean(), kept)


def draw(found: dict[str, np.ndarray]) -> Figure:
    """Draws the mean torque of every draw of the check."""
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axis = figure.subplots()
    order = np.argsort(found["constant"][:, 0])
    for name, values in found.items():
        axis.semilogy(
            1 + np.arange(len(order)), np.sqrt(values[order, 0]), "o-", ms=4.0, lw=0.8, label=name
        )
    axis.set_xlabel("held-out draw, by torque at constant voltage")
    axis.set_ylabel("mean torque across the spin axis [N m]")
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)
    return figure


def main() -> None:
    """Designs, checks, writes."""
    began = time.perf_counter()
    scene = sail()
    weights = {"mean-torque": 1.0, "thrust": 1.0}
    problem = Design(scene, weights, WAVES, circumstances=draws(0, SEEN))
    states = []
    for state in problem.optimise(ITERATIONS):
        states.append(state)
        print(state.iteration, state.value, flush=True)
    best = problem.scene_at(states[-1].x[states[-1].best])
    (HERE / "robust.toml").write_text(to_toml(best))
    print(f"designed in {time.perf_counter() - began:.0f} s", best.voltage.cosine, best.voltage.sine)
    calm = esail.load_scene(HERE / "torque.toml").voltage
    waves = {"voltage.cosine": list(calm.cosine), "voltage.sine": list(calm.sine)}
    laws = {
        "constant": plain(scene),
        "planar cone, first harmonic": scene.replace(planar_cone_harmonic(scene_in_calm())),
        "designed in calm": scene.replace(waves),
        "designed robust": best,
    }
    unseen, rows, found = draws(1000, HELD_OUT), [], {}
    for mesh in ("5 elements", "10 elements"):
        for name, law in laws.items():
            numbers = measured(law if mesh == "5 elements" else finer(law), unseen)
            if name == "constant":
                constant = numbers
            if mesh == "5 elements":
                found[name] = numbers
            rows.append(summary(name, mesh, numbers, constant))
            print(rows[-1], flush=True)
    draw(found).savefig(HERE / "robust.png", dpi=110)
    with open(HERE / "robust.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(
            "law mesh torque_squared_mean torque_squared_largest times_less least_thrust".split()
        )
        table.writerows([tuple(f"{x:.4g}" if isinstance(x, float) else x for x in row) for row in rows])
    print(f"{time.perf_counter() - began:.0f} s")


def scene_in_calm() -> Scene:
    """The sail of `torque` in the mean wind."""
    return esail.load_scene("baseline", TORQUE)


if __name__ == "__main__":
    main()
