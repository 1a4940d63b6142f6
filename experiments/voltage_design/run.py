"""Designs voltages for the baseline sail and checks them on a finer mesh.

    python experiments/voltage_design/run.py [torque] [switch-on] [--check]    # some minutes each

Writes results.csv, <design>.png and <design>.toml; --check only measures the designs in <design>.toml
again. Each design is compared with a known control that is not optimised: the first harmonic of the
published planar-cone law, and a smooth step as long as the designed one.
"""

import csv
import sys
import time
from pathlib import Path

import jax
import numpy as np

import esail_jax as esail
from esail_jax.design import Design, Variable, objectives
from esail_jax.environment.solar_wind import SteadyWind
from esail_jax.numerics import smooth_step as steps
from esail_jax.plotting.design import design_figure
from esail_jax.scenes.toml_text import to_toml

HERE = Path(__file__).parent
TURN = 2.0 * np.pi / 4e-3  # s, one spin period
FINER = 2
"""Factor of the number of elements in the check; the tolerance is a hundredth, which halves the step."""

COARSE = 1e-7
"""Tolerance of the runs of a design."""

TORQUE = {
    "integrator.t_end": TURN, "output.interval": TURN / 100, "integrator.tolerance": COARSE,
    "voltage.law": "harmonic", "voltage.cosine": [0.0, 0.0], "voltage.sine": [0.0, 0.0],
    "voltage.maximum": 40e3,
}  # fmt: skip
WAVES = {f"voltage.{name}": Variable([0.0, 0.0], 0.1) for name in ("cosine", "sine")}
"""Variables of `torque`, one turn at 10 deg: the amplitudes of two harmonics of the spin phase."""


def torque() -> Design:
    """The problem: no mean torque across the spin axis at 10 deg, without loss of thrust."""
    return Design(esail.load_scene("baseline", TORQUE), {"mean-torque": 1.0, "thrust": 1.0}, WAVES)


def planar_cone_harmonic(scene: esail.Scene) -> dict[str, list[float]]:
    """The first harmonic of the published planar-cone law, sigma = sigma_bar (1 - x cos phi)^-3.

    The cone is that of rigid tethers at V_0:

    a_1 = 3 x (V_0 - V_1) / V_0,  x = tan alpha tan Lambda,
    sin Lambda = sigma_bar L^2 cos alpha / (2 I omega_0^2).
    """
    tethers, wind, volts = scene.tethers, scene.solar_wind, scene.voltage.value
    thrust = SteadyWind(wind.speed, wind.number_density, wind.cutoff_voltage, np.zeros(3))
    load = float(wind.speed * thrust.thrust_per_speed(volts))
    length, alpha = tethers.length, np.deg2rad(scene.initial.sailing_angle_deg)
    mass = tethers.density * tethers.area * length
    inertia = (scene.remote_units.mass + mass / 3.0) * length**2
    sine = load * length**2 * np.cos(alpha) / (2.0 * inertia * scene.initial.spin_rate**2)
    first = 3.0 * np.tan(alpha) * np.tan(np.arcsin(sine)) * (1.0 - wind.cutoff_voltage / volts)
    return {"voltage.cosine": [float(first), 0.0], "voltage.sine": [0.0, 0.0]}


def smooth_step(scene: esail.Scene) -> dict[str, list[float]]:
    """The table of a switch-on without optimisation: a smooth step over the same time."""
    time = np.asarray(scene.voltage.time)
    return {"voltage.table": np.asarray(steps.smooth_step(time / time[-1])).tolist()}


def switch_on() -> Design:
    """The problem: switch on, facing the Sun, without variations of lagging, spin rate and
    coning."""
    knots = np.linspace(0.0, TURN / 2, 17)
    overrides = {
        "integrator.t_end": TURN, "output.interval": TURN / 100, "integrator.tolerance": COARSE,
        "voltage.law": "piecewise-linear", "voltage.time": knots.tolist(),
        "voltage.table": [1.0] * len(knots), "voltage.maximum": 40e3,
    }  # fmt: skip
    table = {"voltage.table": Variable([1.0] * len(knots), 0.1, 0.0, 2.0)}
    scene = esail.load_scene("sun-facing", overrides)
    return Design(scene, {"lagging": 1.0, "spin": 1.0, "coning": 1.0, "thrust": 1.0}, table)


DESIGNS = {"torque": (torque, 6, planar_cone_harmonic), "switch-on": (switch_on, 30, smooth_step)}
"""Problem, largest number of iterations, and known control of every design."""

NUMBERS = {"torque": ("mean-torque", "thrust"), "switch-on": ("lagging", "spin", "coning", "thrust")}
"""Objectives that are measured for every design."""


def finer(scene: esail.Scene) -> esail.Scene:
    """The scene with a finer mesh and shorter steps."""
    elements = FINER * scene.tethers.elements
    return scene.replace({"tethers.elements": elements, "integrator.tolerance": COARSE / 100})


def plain(scene: esail.Scene) -> esail.Scene:
    """The scene with constant voltage."""
    law = {f"voltage.{x}": None for x in vars(scene.voltage) if x not in ("value", "law")}
    return scene.replace(law | {"voltage.law": "constant"})


def designed(name: str) -> None:
    """Solves a design problem; writes the scene and the figure."""
    make, count, _ = DESIGNS[name]
    problem, began = make(), time.perf_counter()
    states = []
    for state in problem.optimise(count):
        states.append(state)
        print(state.iteration, state.value, flush=True)
    print(f"{name}: {time.perf_counter() - began:.0f} s", flush=True)
    best = problem.scene_at(states[-1].x[states[-1].best])
    (HERE / f"{name}.toml").write_text(to_toml(best))
    history = np.stack([np.asarray(state.value) for state in states])
    design_figure(problem.reference_run, esail.simulate(best), history).savefig(
        HERE / f"{name}.png", dpi=110
    )
    jax.clear_caches()


def checked(name: str) -> list[tuple]:
    """Rows of results.csv: constant voltage, the known control, the design, and both on a finer
    mesh."""
    best = esail.load_scene(HERE / f"{name}.toml")
    known = best.replace(DESIGNS[name][2](best))
    found = [measured(scene) for scene in (plain(best), known, best)]
    found += [measured(finer(scene)) for scene in (plain(best), best)]
    return [(name, kind, *(f"{numbers[kind]:.4g}" for numbers in found)) for kind in NUMBERS[name]]


def measured(scene: esail.Scene) -> dict[str, float]:
    """Simulates a scene and returns all objectives of NUMBERS."""
    run = esail.simulate(scene)
    kinds = {kind for several in NUMBERS.values() for kind in several}
    return {name: float(x) for name, x in objectives.values(run, tuple(kinds)).items()}


def main(names: list[str]) -> None:
    """Solves the named designs (not with --check), checks them, writes results.csv. The rows of other
    designs stay."""
    only_check, rows = "--check" in names, []
    chosen = [name for name in names if name != "--check"] or list(DESIGNS)
    with open(HERE / "results.csv", newline="") as file:
        kept = [row for row in list(csv.reader(file))[1:] if row[0] not in chosen]
    for name in chosen:
        if not only_check:
            designed(name)
        rows += checked(name)
    rows = sorted(rows + kept, key=lambda row: list(DESIGNS).index(row[0]))
    with open(HERE / "results.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow("design number constant undesigned designed constant_finer designed_finer".split())
        table.writerows(rows)
    for row in rows:
        print(*row)


if __name__ == "__main__":
    main(sys.argv[1:])
