"""Measures what each part beyond the published model adds to the time of a step.

    taskset -c 0 python experiments/performance/parts.py     # parts.csv; ten minutes on one core

Every sail is the baseline with one part added, some minutes of motion after its start. Calls of all sails
alternate, so that each is compared with the baseline under the same load of the machine. Times are the
least of forty calls, which other programs on the machine disturb least. A part may also need shorter steps
or more iterations; both stand in the table.
"""

import csv
from pathlib import Path

import jax
import numpy as np
from run import BLOCKS, Started, seconds_of

import esail_jax as esail
from esail_jax.compilation.size import count_equations

REPEATS = 40
BEGIN = 300.0
"""Time [s] of motion before the measurement."""

METHODS = {
    "generalized-alpha": {"integrator.method": "generalized-alpha", "integrator.step": 0.1},
    "collocation": {"integrator.method": "collocation"},
}
SERIES = np.linspace(0.0, 5000.0, 201)
HEAT = {"thermal.expansion": 2.3e-5, "thermal.reference_temperature": 300.0}
RING = {
    "length": 5176.9, "area": 3e-9, "density": 1400.0, "youngs_modulus": 5e9, "axial_damping_time": 0.5,
    "slack_strain": 1e-4, "element": "truss", "elements": 1,
}  # fmt: skip
WIRES = {"tethers.wire_radius": 12.5e-6, "tethers.wires": 4}
ORBIT = {
    "orbit.position_au": [1.0, 0.0, 0.0], "orbit.velocity": [0.0, 29784.69183, 0.0],
    "initial.heliocentric_position_au": None, "solar_wind.reference_distance_au": 1.0,
}  # fmt: skip
PARTS = {
    "the sail": {},
    "relative wind": {"solar_wind.relative": True},
    "ring of trusses": {f"auxiliary_tethers.{key}": value for key, value in RING.items()},
    "temperatures, constant": HEAT | {"thermal.temperature": 330.0},
    "temperatures, series of 201 instants": HEAT | {
        "thermal.time": SERIES.tolist(), "thermal.temperature": (300 + 30 * np.sin(SERIES / 700)).tolist(),
    },
    "thrust at the tips": {"tip_thrust.force": 2e-4, "tip_thrust.direction": "tangential"},
    "thrust at the tips, switched": {
        "tip_thrust.force": 2e-4, "tip_thrust.on": 100.0, "tip_thrust.off": 4000.0,
        "tip_thrust.rise_time": 40.0,
    },
    "orbit about the Sun": ORBIT,
    "orbit and relative wind": ORBIT | {"solar_wind.relative": True},
    "thrust law debye-sheath": {
        "solar_wind.thrust_law": "debye-sheath", "solar_wind.cutoff_voltage": None,
        "solar_wind.electron_temperature_ev": 12.0, "solar_wind.tether_radius": 1e-3,
    },
    "voltage law feedback": {
        "voltage.law": "feedback", "voltage.gain": 1.0, "voltage.target_sailing_angle_deg": 10.0,
    },
    "voltage law constant-thrust": {
        "voltage.law": "constant-thrust", "voltage.thrust": 0.05, "voltage.maximum": 4e4,
        "voltage.value": None,
    },
    "current and power reported": WIRES,
    "power limit": WIRES | {"voltage.power_limit": 400.0},
}  # fmt: skip
"""Overrides of the baseline, by the name of the part."""


def equations_of(run: Started) -> int:
    """The number of traced equations of a block of steps."""

    def block(problem, state):
        return problem.stepper.block(problem.model, state)

    return count_equations(jax.make_jaxpr(block)(run.problem, run.motion.state))


def measure(method: str) -> list[tuple]:
    """The rows of the table for one method."""
    runs = {}
    for name, overrides in PARTS.items():
        runs[name] = Started(esail.load_scene("baseline", METHODS[method] | overrides), BEGIN)
        print(method, name, "started", flush=True)
    steps, spans, iterations = {}, {}, {}
    for name, run in runs.items():
        done = run.advance()
        steps[name] = float((done.counts - run.motion.counts)[0])
        spans[name] = float(done.time - run.motion.state.time)
        iterations[name] = float(np.mean(run.statistics(done)["iterations_per_step"][:BLOCKS]))
    times = {name: [] for name in runs}
    for _ in range(REPEATS):
        for name, run in runs.items():
            times[name].append(seconds_of(run.advance) / steps[name])
    rows = []
    for name, run in runs.items():
        ratio = min(times[name]) / min(times["the sail"])
        rows.append((method, name, equations_of(run), 1e6 * min(times[name]), ratio,
                     spans[name] / steps[name], iterations[name]))  # fmt: skip
    return rows


def main() -> None:
    """Measures all parts with both methods, prints and writes parts.csv."""
    with open(Path(__file__).with_name("parts.csv"), "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(
            ("method", "part", "equations", "us_per_step", "ratio", "step_s", "iterations_per_step")
        )
        for method in METHODS:
            for *names, equations, micro, ratio, step, iterations in measure(method):
                row = (
                    *names,
                    equations,
                    f"{micro:.1f}",
                    f"{ratio:.3f}",
                    f"{step:.3g}",
                    f"{iterations:.3g}",
                )
                table.writerow(row)
                print(*row, sep="  ", flush=True)


if __name__ == "__main__":
    main()
