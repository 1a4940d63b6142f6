"""What do other switchings of the two tethers tell of the thrust, under the same limits?

python experiments/first_flight/limits.py            # writes limits.csv, from the schedule in designed.csv
python experiments/first_flight/limits.py search     # finds designed.csv anew first
"""

import sys

import jax.numpy as jnp
import numpy as np
from run import HERE, INSTRUMENTS, NODES, NOISE, K, chirp, cubesat, flown, opposite, table_in, write

import esail_jax as esail
from esail_jax.identification.information import Measured
from esail_jax.identification.model import jacobian_of, steps_with_room
from esail_jax.identification.uncertainty import uncertainty_of

FREE = [
    K, "hub.torque[1]", "initial.spin_rate", "bias.angular_velocity_B[1]", "hub.inertia[2,2]",
    "hub.inertia[3,3]",
]  # fmt: skip
SPIN = "Sun sensor and gyro"


def half_turn():
    """The voltages of half of every turn, at the instants of the tables."""
    return np.asarray(esail.simulate(cubesat(), times=NODES.tolist())["voltage"]) / 10e3


class Told:
    """Errors of the thrust factor [%], in a known wind, by table: one program for all tables."""

    def __init__(self):
        scene = flown(half_turn())
        measured = Measured.of(scene, FREE, NOISE, None)
        self.cells, self.names = measured.cells, np.array(measured.cells.name)
        self.start = np.array([p.start for p in measured.parameters])
        steps, numbers = 2 * steps_with_room(scene, self.cells), jnp.asarray(self.start)

        def derivatives(table):
            changed = scene.replace({"voltage.table": table})
            return jacobian_of(changed, measured.parameters, self.cells, steps)(numbers)[1]

        self.derivatives = esail.jit(derivatives)

    def scaled(self, table):
        """The derivatives in units of the noise (cell, parameter)."""
        return np.asarray(self.derivatives(jnp.asarray(table))) / self.cells.deviations[:, None]

    def error(self, scaled, observables, inertia=False):
        """The error by some of the instruments. inertia: whether two moments of the hub are unknown."""
        gyro = "angular_velocity_B" in observables
        used = [k for k, name in enumerate(FREE) if (gyro or k != 3) and (inertia or k < 4)]
        rows = scaled[np.isin(self.names, observables)][:, used]
        return 100.0 * uncertainty_of([FREE[k] for k in used], self.start[used], rows).sd[0] / self.start[0]


def search(told):
    """A schedule that tells more by Sun sensor and gyro: the best period and phase of switching, and from
    there every switching moved by five seconds where that tells more."""
    error = lambda table: told.error(told.scaled(table), INSTRUMENTS[SPIN])  # noqa: E731
    waves = [
        opposite(np.sin(2.0 * np.pi * NODES / period + phase))
        for period in range(30, 38)
        for phase in (1e-6, 0.5 * np.pi)
    ]
    best = min(waves, key=error)
    least = error(best)
    print(f"best period and phase: {least:.4g} %", flush=True)
    for k in np.flatnonzero(np.diff(best[:, 0])) + 1:
        other = best.copy()
        other[k] = 1.0 - other[k]
        if (found := error(other)) < least:
            best, least = other, found
            print(f"{NODES[k]:g} s: {least:.4g} %", flush=True)
    print(f"with its switchings moved: {least:.4g} %", flush=True)
    np.savetxt(
        HERE / "designed.csv", best, fmt="%g", delimiter=",", header="tether 1,tether 2", comments=""
    )


def row(told, label, table):
    """What a schedule tells, and what it takes."""
    scaled, run = told.scaled(table), esail.simulate(flown(table))
    volts, power, force = (np.asarray(run[x]) for x in ("voltage", "electric_power", "reaction_B"))
    tension = np.linalg.norm(force, axis=-1)
    slew = np.abs(np.diff(np.asarray(table), axis=0)).max() * 10e3 / np.diff(NODES)[0]
    errors = {f"{name} [%]": told.error(scaled, seen) for name, seen in INSTRUMENTS.items()}
    return {
        "schedule": label, **errors,
        f"{SPIN}, moments of the hub unknown [%]": told.error(scaled, INSTRUMENTS[SPIN], inertia=True),
        "largest voltage [kV]": 1e-3 * volts.max(), "largest slew [kV/s]": 1e-3 * slew,
        "mean power [mW]": 1e3 * power.mean(), "largest power [mW]": 1e3 * power.max(),
        "tension [mN]": f"{1e3 * tension.min():.3g} to {1e3 * tension.max():.3g}",
    }  # fmt: skip


def main():
    told = Told()
    if sys.argv[1:] == ["search"]:
        search(told)
    write("limits.csv", [
        row(told, "half of every turn", half_turn()),
        row(told, "chirp", chirp()),
        row(told, "designed", table_in("designed.csv")),
    ])  # fmt: skip


if __name__ == "__main__":
    main()
