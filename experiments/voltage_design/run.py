"""Voltage designs on the baseline sail, each checked on a finer one.

    python experiments/voltage_design/run.py [torque] [switch-on]    # some minutes each

Writes results.csv, <design>.png and <design>.toml.
"""

import csv
import sys
import time
from pathlib import Path

import jax
import numpy as np

import esail_jax as esail
from esail_jax import objectives
from esail_jax.design import Design, Variable
from esail_jax.plotting.design import design_figure
from esail_jax.scenes.scene import to_toml

HERE = Path(__file__).parent
TURN = 2.0 * np.pi / 4e-3  # s, one spin period
FINER = 2
"""Times the elements, with a hundredth of the tolerance: half the step."""

COARSE = 1e-7
"""Tolerance while designing."""


def torque() -> Design:
    """No mean torque across the spin axis at 10 deg, with the thrust kept."""
    overrides = {
        "integrator.t_end": TURN, "output.interval": TURN / 100, "integrator.tolerance": COARSE,
        "voltage.law": "harmonic", "voltage.cosine": [0.0, 0.0], "voltage.sine": [0.0, 0.0],
        "voltage.maximum": 40e3,
    }  # fmt: skip
    waves = {f"voltage.{name}": Variable([0.0, 0.0], 0.1) for name in ("cosine", "sine")}
    scene = esail.load_scene("baseline", overrides)
    return Design(scene, {"mean-torque": 1.0, "thrust": 1.0}, waves)


def switch_on() -> Design:
    """No lagging and no swing of the spin rate after switching on towards the Sun."""
    knots = np.linspace(0.0, TURN / 2, 17)
    overrides = {
        "integrator.t_end": TURN, "output.interval": TURN / 100, "integrator.tolerance": COARSE,
        "voltage.law": "piecewise-linear", "voltage.time": knots.tolist(),
        "voltage.table": [1.0] * len(knots), "voltage.maximum": 40e3,
    }  # fmt: skip
    table = {"voltage.table": Variable([1.0] * len(knots), 0.1, 0.0, 2.0)}
    scene = esail.load_scene("sun-facing", overrides)
    return Design(scene, {"lagging": 1.0, "spin": 1.0, "coning": 1.0, "thrust": 1.0}, table)


DESIGNS = {"torque": (torque, 6), "switch-on": (switch_on, 30)}
"""Problems, and iterations at most."""


def finer(scene: esail.Scene) -> esail.Scene:
    """The scene with a finer mesh and shorter steps."""
    elements = FINER * scene.tethers.elements
    return scene.replace({"tethers.elements": elements, "integrator.tolerance": COARSE / 100})


def plain(scene: esail.Scene) -> esail.Scene:
    """With constant voltage."""
    law = {f"voltage.{x}": None for x in vars(scene.voltage) if x not in ("value", "law")}
    return scene.replace(law | {"voltage.law": "constant"})


def main(names: list[str]) -> None:
    """Design, check, write."""
    rows = []
    for name in names:
        make, count = DESIGNS[name]
        problem, began = make(), time.perf_counter()
        states = problem.run(count, each=lambda state: print(state.iteration, state.value, flush=True))
        seconds = time.perf_counter() - began
        best = problem.designed(states[-1].x[states[-1].best])
        (HERE / f"{name}.toml").write_text(to_toml(best))
        before, after = problem.plain, esail.simulate(best)
        history = np.stack([np.asarray(state.value) for state in states])
        design_figure(before, after, history).savefig(HERE / f"{name}.png", dpi=110)
        kinds = tuple(problem.weights)
        fine = [objectives.values(esail.simulate(finer(x)), kinds) for x in (plain(best), best)]
        ended = objectives.values(after, kinds)
        for kind in kinds:
            numbers = (problem.before[kind], ended[kind], fine[0][kind], fine[1][kind])
            rows.append(
                (name, kind, *(f"{float(x):.4g}" for x in numbers), len(states) - 1, f"{seconds:.0f}")
            )
            print(rows[-1], flush=True)
        jax.clear_caches()
    with open(HERE / "results.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(
            ("design", "number", "before", "after", "before_finer", "after_finer", "iterations", "seconds")
        )
        table.writerows(rows)


if __name__ == "__main__":
    main(sys.argv[1:] or list(DESIGNS))
