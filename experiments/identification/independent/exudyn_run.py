"""Telemetry of a small sail by Exudyn: what a gyro and a camera of the tips would show, without noise.

pip install '.[peers]'
python experiments/identification/independent/exudyn_run.py    # writes telemetry.csv

The two codes share the numbers of `sail.toml` and the initial state. Elements, hub, joints and integrator
are Exudyn's; the thrust is that of `experiments/peer_exudyn/sail.py`.
"""

import csv
import sys
from pathlib import Path

import numpy as np

import esail_jax as esail

HERE = Path(__file__).parent
PEER = HERE.parents[1] / "peer_exudyn"
STEPS = (0.004, 0.002)
"""Steps [s] of two runs of generalized-alpha. The error is that of the second order, and the table has the
extrapolation of both to a step of zero."""
INTERVAL, END = 1.5, 150.0


def shown(step):
    """Gyro [rad/s] (time, xyz) and directions of the tips (time, tether, xyz) in B, every 1.5 s."""
    sys.path.insert(0, str(PEER))
    import sail
    from inputs import sail_of

    given = sail_of(esail.load_scene(str(HERE / "sail.toml")))
    run = sail.simulate(given, step, round(END / step), round(INTERVAL / step), tolerance=1e-10)
    lines = (run.position[:, :, -1, 0] - run.hub_position[:, None]) @ run.hub_rotation
    print(f"Exudyn: {round(END / step)} steps in {run.seconds:.0f} s")
    return run.time, run.hub_spin_B, lines / np.linalg.norm(lines, axis=-1, keepdims=True)


def main():
    (time, *coarse), (_, *fine) = map(shown, STEPS)
    for name, a, b in zip(("gyro", "tips"), coarse, fine, strict=True):
        print(f"{name}: largest difference of the two runs {abs(a - b).max():.2e}")
    gyro, tips = ((4.0 * b - a) / 3.0 for a, b in zip(coarse, fine, strict=True))
    names = [f"angular_velocity_B[{i}] [rad/s]" for i in (1, 2, 3)]
    names += [f"tip_direction_B[{k},{i}] [-]" for k in (1, 2, 3) for i in (1, 2, 3)]
    with (HERE / "telemetry.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time [s]", *names])
        for row in np.column_stack([time, gyro, tips.reshape(len(time), -1)])[1:]:
            writer.writerow([f"{x:.10g}" for x in row])


if __name__ == "__main__":
    main()
