"""256 members against 256 single runs: over the first hundred steps, and over three spin periods.

python experiments/ensembles/equality.py      # equality.csv; five minutes on one core
"""

import csv
from pathlib import Path

import numpy as np

import esail_jax as esail
from esail_jax.ensemble import simulate_members
from esail_jax.sampling import draw, of_members, parse_variation

HERE = Path(__file__).parent
MEMBERS = 256
STEPS = 100
SIGNALS = (
    "tip_position_I", "hub_position_I", "coning_angle", "lagging_angle", "root_coning_angle",
    "angular_velocity_B", "sailing_angle", "thrust_O", "reaction_O", "max_axial_strain",
    "kinetic_energy", "elastic_energy",
)  # fmt: skip
VARY = (
    "tethers.length[*]=normal:10e3:10",
    "remote_units.mass[*]=normal:1.5:0.015",
    "voltage.value[*]=normal:20e3:200",
    "initial.spin_rate=normal:4e-3:4e-5",
)


def main() -> None:
    """Compare and write."""
    scene = esail.load_scene("baseline", {"output.interval": 30.0})
    inputs = draw(scene, [parse_variation(text) for text in VARY], MEMBERS, 1)
    ensemble = simulate_members(scene, inputs, SIGNALS)
    early, late = dict.fromkeys(SIGNALS, 0.0), dict.fromkeys(SIGNALS, 0.0)
    same_steps = 0
    for member in range(MEMBERS):
        run = esail.simulate(scene, of_members(inputs, member))
        same_steps += run.steps == ensemble.steps[member]
        first = np.cumsum(run.numerics["steps"]) <= STEPS
        for name in SIGNALS:
            exact, found = np.asarray(run[name]), ensemble[name][member]
            size, width = np.abs(exact).max(), np.ptp(exact)
            gap = np.abs(exact - found)
            early[name] = max(early[name], gap[first].max() / size)
            late[name] = max(late[name], gap.max() / max(width, 1e-3 * size))
    print(f"{ensemble.complete.sum()} complete, as many steps in {same_steps} of {MEMBERS}")
    with open(HERE / "equality.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("signal", "first_100_steps_over_size", "three_periods_over_range"))
        for name in SIGNALS:
            table.writerow((name, f"{early[name]:.2g}", f"{late[name]:.2g}"))
            print(f"{name:22s} {early[name]:.2g} {late[name]:.2g}")


if __name__ == "__main__":
    main()
