"""What do other switchings of the two tethers tell of the thrust, under the same limits?

python experiments/first_flight/limits.py            # writes limits.csv, from the two designed schedules
python experiments/first_flight/limits.py search     # finds designed.csv anew first, by trying switchings
python experiments/first_flight/limits.py gradients  # finds by_gradients.csv anew first: `esail design`
"""

import sys
import tempfile
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from run import HERE, INSTRUMENTS, NODES, NOISE, K, chirp, cubesat, flown, opposite, table_in, write

import esail_jax as esail
from esail_jax.cli import main as command
from esail_jax.identification.information import Measured
from esail_jax.identification.model import jacobian_of, steps_with_room
from esail_jax.identification.uncertainty import uncertainty_of
from esail_jax.scenes.toml_text import to_toml

FREE = [
    K, "hub.torque[1]", "initial.spin_rate", "bias.angular_velocity_B[1]", "hub.inertia[2,2]",
    "hub.inertia[3,3]",
]  # fmt: skip
SPIN = "Sun sensor and gyro"
OBJECTIVES = ("information=1", "tension:0.008,0.0083=0.001")
"""Of the design by gradients: log det of the information on all of FREE, and a limit for the tension at the
roots, 8 to 8.3 mN, where a percent outside costs about as much as the information left."""


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

    def volume(self, scaled):
        """The volume of the ellipsoid of errors of all parameters by all instruments, to the power 1/6."""
        return np.exp(-np.linalg.slogdet(scaled.T @ scaled)[1] / 12.0)

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
    keep("designed.csv", best)


def gradients():
    """A schedule that tells more of all parameters by all instruments: descent from the chirp."""
    with tempfile.TemporaryDirectory() as folder:
        start, out = Path(folder, "start.toml"), Path(folder, "design")
        start.write_text(to_toml(flown(0.03 + 0.94 * chirp())), encoding="utf-8")
        options = ["--iterations", "10"]  # the tenth gains 1 %
        for name, given in (
            ("objective", OBJECTIVES), ("free", FREE), ("noise", (f"{x}={sd}" for x, sd in NOISE.items())),
        ):  # fmt: skip
            for one in given:
                options += [f"--{name}", one]
        assert command(["design", str(start), "-o", str(out), *options]) == 0
        keep("by_gradients.csv", esail.load_scene(str(out / "designed.toml")).voltage.table)


def keep(name, table):
    """Writes a schedule."""
    np.savetxt(HERE / name, table, fmt="%.4g", delimiter=",", header="tether 1,tether 2", comments="")


def row(told, label, table, volume):
    """What a schedule tells, and what it takes. volume: of the ellipsoid of half of every turn."""
    scaled, run = told.scaled(table), esail.simulate(flown(table))
    volts, power, force = (np.asarray(run[x]) for x in ("voltage", "electric_power", "reaction_B"))
    tension = np.linalg.norm(force, axis=-1)
    slew = np.abs(np.diff(np.asarray(table), axis=0)).max() * 10e3 / np.diff(NODES)[0]
    errors = {f"{name} [%]": told.error(scaled, seen) for name, seen in INSTRUMENTS.items()}
    return {
        "schedule": label, **errors,
        f"{SPIN}, moments of the hub unknown [%]": told.error(scaled, INSTRUMENTS[SPIN], inertia=True),
        "all parameters, against the first": told.volume(scaled) / volume,
        "largest voltage [kV]": 1e-3 * volts.max(), "largest slew [kV/s]": 1e-3 * slew,
        "mean power [mW]": 1e3 * power.mean(), "largest power [mW]": 1e3 * power.max(),
        "tension [mN]": f"{1e3 * tension.min():.3g} to {1e3 * tension.max():.3g}",
    }  # fmt: skip


def main():
    told = Told()
    if "search" in sys.argv:
        search(told)
    if "gradients" in sys.argv:
        gradients()
    first = half_turn()
    volume = told.volume(told.scaled(first))
    write("limits.csv", [
        row(told, "half of every turn", first, volume),
        row(told, "chirp", chirp(), volume),
        row(told, "designed", table_in("designed.csv"), volume),
        row(told, "by gradients", table_in("by_gradients.csv"), volume),
    ])  # fmt: skip


if __name__ == "__main__":
    main()
