"""Compares gradients through three spin periods of the baseline: reverse mode, forward mode, differences.

python experiments/gradients/run.py        # ten minutes on one core; writes gradients.csv
"""

import csv
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import esail_jax as esail

TOLERANCE = 1e-12
"""Tolerance of the runs: small enough that finite differences are smooth although the steps of runs
differ."""

CHANGES = (2e-3, 1e-4)
"""Relative changes for fourth-order differences: of voltages, and of all other numbers. The second is
smaller because a change of a frequency changes the phase of the shortest waves, 0.3 rad/s, a thousand
times as much over the run."""

NUMBERS = {
    "initial.spin_rate": 4e-3,
    "initial.sailing_angle_deg": 10.0,
    "tethers.length": 10e3,
    "tethers.area": 4.28e-9,
    "tethers.density": 7653.0,
    "tethers.youngs_modulus": 70e9,
    "remote_units.mass": 1.5,
    "solar_wind.speed": 4e5,
    "solar_wind.number_density": 7.3e6,
    "hub.radius": 1.0,
}
"""Numbers that are varied, besides the twelve voltages: 22 in all, each multiplied by a factor of 1."""

SCALARS = ("tip x", "spin rate", "coning of tether 3", "sailing angle", "thrust along the wind")
"""Names of the five outputs, all at the end of the run."""


def outcome(factors):
    """The five scalars as functions of the 22 factors."""
    overrides = {key: value * factors[12 + i] for i, (key, value) in enumerate(NUMBERS.items())}
    overrides |= {"voltage.value": 20e3 * factors[:12], "output.interval": 4712.39 / 10}
    run = esail.simulate("baseline", overrides | {"integrator.tolerance": TOLERANCE})
    return jnp.stack(
        [
            jnp.asarray(x)
            for x in (
                run["tip_position_I"][-1, 0, 0],
                run["angular_velocity_B"][-1, 0],
                run["coning_angle"][-1, 2],
                run["sailing_angle"][-1],
                run["thrust_O"][-1, 2],
            )
        ]
    )


def main() -> None:
    """Computes the derivatives in three ways, compares them, writes gradients.csv."""
    one = np.ones(12 + len(NUMBERS))
    began = time.perf_counter()
    reverse = np.asarray(jax.jit(jax.jacrev(outcome))(one))
    print(f"reverse mode, compiling included: {time.perf_counter() - began:.0f} s", flush=True)
    along = np.random.default_rng(0).normal(size=len(one))
    forward = np.asarray(jax.jit(lambda x: jax.jvp(outcome, (x,), (along,))[1])(one))
    mode = np.abs(reverse @ along / forward - 1.0)
    print("forward mode / reverse mode - 1:", mode, flush=True)

    def at(i, steps):
        factors = one.copy()
        factors[i] += steps * CHANGES[i >= 12]
        return np.asarray(outcome(factors))

    rows, names = [], [*(f"voltage {i + 1}" for i in range(12)), *NUMBERS]
    for i, name in enumerate(names):
        near, far = at(i, 1) - at(i, -1), at(i, 2) - at(i, -2)
        change = CHANGES[i >= 12]
        quotient, coarse = (8.0 * near - far) / (12.0 * change), far / (4.0 * change)
        # Estimated error of the difference: a tenth of the change from second to fourth order.
        doubt = np.abs(quotient - near / (2.0 * change)) * 0.1
        for k, scalar in enumerate(SCALARS):
            scale = np.abs(reverse[k]).max()
            error = abs(quotient[k] - reverse[k, i])
            relative = error / max(abs(reverse[k, i]), 1e-300)
            digits = (f"{x:.8g}" for x in (reverse[k, i], quotient[k], coarse[k]))
            parts = (f"{x:.1e}" for x in (relative, error / scale, doubt[k] / scale))
            rows.append((scalar, name, *digits, *parts))
        print(name, *rows[-1][5:], flush=True)
    with open(Path(__file__).with_name("gradients.csv"), "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        head = "scalar number reverse_mode differences second_order relative of_largest doubt_of_largest"
        table.writerow(head.split())
        table.writerows(rows)


if __name__ == "__main__":
    main()
