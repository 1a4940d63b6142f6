"""Measures the throughput of one core: single runs, an ensemble, members in lockstep; and their memory.

taskset -c 0 python experiments/ensembles/throughput.py     # throughput.csv; ten minutes on one core
"""

import csv
import statistics
import time
from pathlib import Path

import numpy as np

import esail_jax as esail
from esail_jax.ensembles import Ensemble, Inputs, MemberRunner, draw, parse_variation, select_members

HERE = Path(__file__).parent
VARY = (
    "tethers.length[*]=normal:10e3:10",
    "remote_units.mass[*]=normal:1.5:0.015",
    "voltage.value[*]=normal:20e3:200",
    "initial.spin_rate=normal:4e-3:4e-5",
)
SCENES = {
    "baseline, 3 periods, 943 instants": {},
    "baseline, 3 periods, 80 instants": {"output.interval": 60.0},
    "3 tethers x 2, 3 periods, 80 instants": {
        "tethers.count": 3, "tethers.elements": 2, "output.interval": 60.0,
    },
}  # fmt: skip
THREE = ("coning_angle", "lagging_angle", "smallest_tether_distance")
MEMBERS = 8
REPEATS = 3
LOCKSTEP = (1, 4, 16)
SHORT = {"integrator.t_end": 400.0, "output.interval": 60.0}
"""Overrides of the lockstep runs; a rate of steps needs no longer run."""


def timed(call) -> float:
    """The median processor time [s] of REPEATS calls."""
    times = []
    for _ in range(REPEATS):
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    return statistics.median(times)


def on(runner: MemberRunner, inputs: Inputs, members: np.ndarray) -> Ensemble:
    """The results of some of the members."""
    return runner(members, select_members(inputs, members))


def one_by_one(name: str, scene: esail.Scene) -> list[tuple]:
    """Times single runs, and members of an ensemble one after the other."""
    inputs = draw(scene, [parse_variation(text) for text in VARY], MEMBERS, 1)
    three = MemberRunner(scene, inputs, THREE, one_core=True)
    everything, members = MemberRunner(scene, inputs, one_core=True), np.arange(MEMBERS)
    steps = on(three, inputs, members).steps.sum()
    on(everything, inputs, members[:1])
    esail.simulate(scene, select_members(inputs, 0))
    ways = {
        "single runs": lambda: [esail.simulate(scene, select_members(inputs, m)) for m in members],
        "ensemble, all observables": lambda: on(everything, inputs, members),
        "ensemble, three observables": lambda: on(three, inputs, members),
    }
    times = {way: timed(call) for way, call in ways.items()}
    rows = [
        (name, way, MEMBERS / seconds, steps / seconds, times["single runs"] / seconds, "")
        for way, seconds in times.items()
    ]
    print(*rows, sep="\n", flush=True)
    return rows


def main() -> None:
    """Measures all scenes and batches, writes throughput.csv."""
    rows = []
    for name, overrides in SCENES.items():
        rows += one_by_one(name, esail.load_scene("baseline", overrides))
    scene = esail.load_scene("baseline", SHORT)
    inputs = draw(scene, [parse_variation(text) for text in VARY], max(LOCKSTEP), 1)
    names = ("coning_angle",)
    single = MemberRunner(scene, inputs, names, one_core=True)
    on(single, inputs, np.arange(1))
    for count in LOCKSTEP:
        members = np.arange(count)
        side = MemberRunner(scene, inputs, names, batch=count, lockstep=True)
        steps = on(side, inputs, members).steps.sum()
        alone, together = (
            timed(lambda m=members: on(single, inputs, m)),
            timed(lambda s=side, m=members: on(s, inputs, m)),
        )
        used = side.lower(count).compile().memory_analysis()
        memory = (used.temp_size_in_bytes + used.output_size_in_bytes) / count / 2**20
        name = f"baseline, {SHORT['integrator.t_end']:g} s"
        ratio = alone / together
        rows.append(
            (name, f"lockstep of {count}", count / together, steps / together, ratio, f"{memory:.2f}")
        )
        print(rows[-1], flush=True)
    with open(HERE / "throughput.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(
            ("scene", "way", "members_per_s", "steps_per_s", "times_one_by_one", "MiB_per_member")
        )
        table.writerows((*row[:2], *(f"{x:.4g}" for x in row[2:5]), row[5]) for row in rows)


if __name__ == "__main__":
    main()
