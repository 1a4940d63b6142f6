"""What the parts of this folder share: the small sail, its instruments, and tables."""

import csv
import time
from pathlib import Path

import numpy as np

import esail_jax as esail
from esail_jax.identification.information import planned
from esail_jax.identification.model import Cells, predictor
from esail_jax.identification.uncertainty import uncertainty_of

HERE = Path(__file__).parent
NOISE = {"angular_velocity_B": 1e-6, "spin_rate[1]": 1e-6, "tip_direction_B": 1e-4}
"""Of the instruments: a gyro [rad/s], the spin rate from a Sun sensor [rad/s], a camera that sees the tips
[rad]."""


def small(changes=None):
    """The small sail."""
    return esail.load_scene(str(HERE / "small.toml"), changes or {})


class Measured:
    """What instruments would show of a run, and its derivatives, from one program for all instants and
    places: F of a part of them is a sum over a part of the rows."""

    def __init__(self, scene, free, noise, times=None):
        self.cells, parameters = planned(scene, free, noise, times)
        self.names = tuple(p.name for p in parameters)
        self.start = np.array([p.start for p in parameters])
        self.model = predictor(scene, parameters, self.cells)
        self.time = np.array(self.cells.times)[self.cells.row]

    def rows(self, *observables):
        """Which cells are those of these observables."""
        return np.isin(self.cells.name, observables)

    def scaled(self, values):
        """The derivatives at these values in units of the noise (cell, parameter)."""
        return self.model(np.asarray(values, float)).jacobian / self.cells.deviations[:, None]


def known(names, values, scaled, priors=None):
    """The uncertainty of these parameters. scaled: derivatives in units of the noise; priors: standard
    deviations by name."""
    rows = [np.eye(len(names))[names.index(name)] / sd for name, sd in (priors or {}).items()]
    return uncertainty_of(names, np.asarray(values, float), np.vstack([scaled, *rows]))


def table(path, rows):
    """Writes rows as a table, numbers with four digits."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            {key: x if isinstance(x, str | int) else f"{x:.4g}" for key, x in row.items()} for row in rows
        )
    for row in rows:
        print(
            {key: x if isinstance(x, str | int) else float(f"{x:.4g}") for key, x in row.items()},
            flush=True,
        )


class Timer:
    """Seconds of the wall and of the process since it was made."""

    def __init__(self):
        self.wall, self.process = time.perf_counter(), time.process_time()

    def read(self):
        return time.perf_counter() - self.wall, time.process_time() - self.process


__all__ = ["HERE", "NOISE", "Cells", "Measured", "Timer", "known", "small", "table"]
