"""What GNSS positions tell of the plasma about a plasma brake: its density, within half an orbit.

python experiments/first_flight/brake.py    # writes brake.csv
"""

import csv
from pathlib import Path

import numpy as np

import esail_jax as esail
from esail_jax.identification import fit

NOISE = {"joint_position[1,1]": 1.0, "joint_position[1,2]": 1.0}
"""Position of the satellite, the first joint, along the vertical and along the orbit [m]."""
FREE = ["plasma_brake.number_density", "bias.joint_position[1,1]", "bias.joint_position[1,2]"]
ENDS = (600.0, 1500.0, 3000.0)


def main():
    random, rows = np.random.default_rng(4), []
    for end in ENDS:
        scene = esail.load_scene("plasma-brake", {"integrator.t_end": end})
        times = np.arange(20.0, end + 1.0, 20.0)
        position = np.asarray(esail.simulate(scene, times=times.tolist())["joint_position"])[:, 0]
        data = {"time": times}
        for k, (name, sd) in enumerate(NOISE.items()):
            data[name] = position[:, k] + sd * random.normal(size=len(times))
        found = fit(scene, data, FREE, NOISE)
        print(found, flush=True)
        truth = found.problem.parameters[0].start
        rows.append({
            "minutes": f"{end / 60.0:.0f}", "density [1/m^3]": f"{found.values[0]:.3g}",
            "sd [%]": f"{100.0 * found.sd[0] / truth:.2g}",
            "estimate less truth, in sd": f"{(found.values[0] - truth) / found.sd[0]:.2f}",
        })  # fmt: skip
    with (Path(__file__).parent / "brake.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


if __name__ == "__main__":
    main()
