"""Compares 256 ensemble members with 256 single runs, over the first hundred steps and three spin periods.

Also measures how much each signal changes when positions and velocities change by one rounding error.

python experiments/ensembles/equality.py      # equality.csv; five minutes on one core
"""

import csv
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import esail_jax as esail
from esail_jax.ensembles import draw, parse_variation, select_members, simulate_members
from esail_jax.simulation.host import compile_scene
from esail_jax.simulation.look import look

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

DRAWS = 32
"""Number of random roundings of a state; the largest change of each signal counts."""


def rounding_sensitivity(scene: esail.Scene) -> dict[str, float]:
    """The largest change of every signal, relative to its size, when every number of a state (after
    400 s) is rounded up or down to the next number in double precision."""
    point = esail.simulate(scene, {"integrator.t_end": 400.0}).final_state
    # Taken as it is: a projection on the constraints would remove a part of the changes.
    point, rng = point._replace(exact=jnp.asarray(True)), np.random.default_rng(1)
    problem = compile_scene(scene).problem
    see = jax.jit(lambda point: look(problem, point, SIGNALS)[0])

    def next_to(x):
        return np.nextafter(x, np.where(rng.random(x.shape) < 0.5, -np.inf, np.inf))

    exact, most = see(point), dict.fromkeys(SIGNALS, 0.0)
    for _ in range(DRAWS):
        q, v = jax.tree.map(next_to, (point.q, point.v))
        found = see(point._replace(q=q, v=v))
        for name in SIGNALS:
            change = float(abs(found[name] - exact[name]).max() / abs(exact[name]).max())
            most[name] = max(most[name], change)
    return most


def main() -> None:
    """Compares members with single runs and writes equality.csv."""
    scene = esail.load_scene("baseline", {"output.interval": 30.0})
    inputs = draw(scene, [parse_variation(text) for text in VARY], MEMBERS, 1)
    ensemble = simulate_members(scene, inputs, SIGNALS)
    early, late = dict.fromkeys(SIGNALS, 0.0), dict.fromkeys(SIGNALS, 0.0)
    same_steps = 0
    for member in range(MEMBERS):
        run = esail.simulate(scene, select_members(inputs, member))
        same_steps += run.steps == ensemble.steps[member]
        first = np.cumsum(run.numerics["steps"]) <= STEPS
        for name in SIGNALS:
            exact, found = np.asarray(run[name]), ensemble[name][member]
            size, width = np.abs(exact).max(), np.ptp(exact)
            gap = np.abs(exact - found)
            early[name] = max(early[name], gap[first].max() / size)
            late[name] = max(late[name], gap.max() / max(width, 1e-3 * size))
    last_place = rounding_sensitivity(scene)
    print(f"{ensemble.complete.sum()} members complete; same number of steps in {same_steps} of {MEMBERS}")
    with open(HERE / "equality.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        titles = ("first_100_steps_over_size", "three_periods_over_range", "last_place_over_size")
        table.writerow(("signal", *titles))
        for name in SIGNALS:
            numbers = [f"{x[name]:.2g}" for x in (early, late, last_place)]
            table.writerow((name, *numbers))
            print(f"{name:22s}", *numbers)


if __name__ == "__main__":
    main()
