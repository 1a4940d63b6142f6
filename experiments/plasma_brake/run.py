"""Decay by the plasma brake against the published flight design, and the motion of its tether.

python experiments/plasma_brake/run.py    # a minute; writes table.csv, run.csv
"""

import csv
from pathlib import Path

import jax.numpy as jnp
import numpy as np

import esail_jax as esail
from esail_jax.loads.plasma_brake import PlasmaBrake, ions

HERE = Path(__file__).parent
MU, EARTH, MONTH = 3.986004418e14, 6371e3, 30.44 * 86400.0
MASS, LENGTH, VOLTS, RADIUS = 4.5, 300.0, -1e3, 1e-3
"""Of ESTCube-2 and FORESAIL-1 (Iakubivskyi et al., Acta Astronaut. 177 (2020) 771): 4.5 kg, 300 m, -1 kV.
Effective radius of the tether: 1 mm."""


def force(altitude, density):
    """Drag [N] of a vertical tether at an altitude [m]."""
    speed = np.sqrt(MU / (EARTH + altitude))
    numbers = (jnp.asarray(x) for x in (speed, density))
    load = PlasmaBrake(*numbers, ions(jnp.asarray(16.0)), jnp.asarray(RADIUS), jnp.asarray([VOLTS]))
    return LENGTH * float(load.drag[0])


def months(density):
    """Duration of the decay from 700 to 500 km: da/dt = -2 F a / (m v)."""
    radii = EARTH + np.linspace(500e3, 700e3, 201)
    rate = [2.0 * force(a - EARTH, density) / (MASS * np.sqrt(MU / a**3)) for a in radii]
    return np.trapezoid(1.0 / np.array(rate), radii) / MONTH


def main():
    rows = [
        {"density [1/m^3]": f"{n:.2g}", "force at 600 km [uN]": f"{1e6 * force(600e3, n):.3g}",
         "per length [nN/m]": f"{1e9 * force(600e3, n) / LENGTH:.3g}",
         "700 to 500 km [months]": f"{months(n):.3g}"}
        for n in (0.5e10, 1e10, 1.5e10, 2e10, 3e10, 5e10, 1e11)
    ]  # fmt: skip
    write("table.csv", rows)
    run = esail.simulate("plasma-brake")
    joints, period = np.asarray(run["joint_position"]), 2.0 * np.pi / 1.078e-3
    masses = np.full(7, 5.5e-4)
    masses[[0, -1]] = 4.0 + 2.75e-4, 0.5 + 2.75e-4
    centre = np.einsum("tji,j->ti", joints, masses) / masses.sum()
    chord = joints[:, -1] - joints[:, 0]
    tilt = np.rad2deg(np.arctan2(chord[:, 1], chord[:, 0]))
    tension = np.asarray(run["tension"])
    whole = [np.argmin(np.abs(run.time - k * period)) for k in (0, 1, 2)]
    lower = -np.diff(centre[whole, 0]) / np.diff(run.time[whole])
    exact = 2.0 * force(np.cbrt(MU / 1.078e-3**2) - EARTH, 3e10) / (masses.sum() * 1.078e-3)
    write("run.csv", [{
        "decay of the run [m/h]": f"{3600 * lower.mean():.4g}", "2 F/(m n) [m/h]": f"{3600 * exact:.4g}",
        "tilt, smallest [deg]": f"{tilt.min():.3g}", "tilt, largest [deg]": f"{tilt.max():.3g}",
        "tension, smallest [mN]": f"{1e3 * tension.min():.3g}",
        "tension, largest [mN]": f"{1e3 * tension.max():.3g}",
        "steps": run.stats["steps"], "wall time [s]": f"{run.stats['wall_time']:.3g}",
        "method": run.stats["method"],
    }])  # fmt: skip


def write(name, rows):
    """Writes rows to a table."""
    with (HERE / name).open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    print(*rows, sep="\n", flush=True)


if __name__ == "__main__":
    main()
