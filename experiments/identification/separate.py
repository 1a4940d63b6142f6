"""Which measurements tell which parameters apart, by the Fisher information of runs."""

import numpy as np
from common import HERE, Measured, known, small, table

GYRO, CAMERA, SPIN, CURRENT = "angular_velocity_B", "tip_direction_B", "spin_rate", "electron_current"
NOISE = {GYRO: 1e-6, CAMERA: 1e-4, SPIN: 1e-6, CURRENT: 1e-6}
LEVELS = {
    "voltage.law": "piecewise-linear", "voltage.time": [0.0, 145.0, 155.0, 300.0],
    "voltage.table": [1.0, 1.0, 0.5, 0.5], "integrator.t_end": 300.0, "output.interval": 5.0,
}  # fmt: skip
"""10 kV, and from the half of the run on 5 kV."""

K, N, U, V1, L = (
    "solar_wind.thrust_factor", "solar_wind.number_density", "solar_wind.speed",
    "solar_wind.cutoff_voltage", "tethers.length",
)  # fmt: skip
TE = "solar_wind.electron_temperature_ev"


def row(measured, scaled, what, names, observables, until=np.inf):
    """How well parameters are known from some of the observables up to an instant [s]."""
    cells = measured.rows(*observables) & (measured.time <= until)
    columns = [measured.names.index(name) for name in names]
    found = known(names, measured.start[columns], scaled[cells][:, columns])
    short = {name: name.partition(".")[2] for name in names}
    sds = [
        f"{short[name]} {'not seen' if not np.isfinite(sd) else f'{100.0 * sd / value:.2g} %'}"
        for name, sd, value in zip(names, found.sd, measured.start[columns], strict=True)
    ]
    words = found.weakest.words
    for name in names:
        words = words.replace(name, short[name])
    return {
        "case": what,
        "measured": " and ".join(observables),
        "standard deviations": "; ".join(sds),
        "weakest": words,
    }


def linear():
    """Rows of the linear law of thrust."""
    m = Measured(small(LEVELS), [K, N, U, V1, L], NOISE)
    x = m.scaled(m.start)
    both = (GYRO, CAMERA)
    return [
        row(m, x, "linear law, one voltage", [K, N], both, 145.0),
        row(m, x, "linear law, two voltages", [K, N], both),
        row(m, x, "linear law, two voltages", [N, U], both),
        row(m, x, "linear law, one voltage", [K, V1], both, 145.0),
        row(m, x, "linear law, two voltages", [K, V1], both),
        row(m, x, "linear law, two voltages, current of the tethers", [K, N], (*both, CURRENT)),
        row(m, x, "linear law, one voltage", [K, L], (SPIN,), 145.0),
        row(m, x, "linear law, one voltage", [K, L], (CAMERA,), 145.0),
        row(m, x, "linear law, one voltage", [K, L], both, 145.0),
    ]


def sheath():
    """Rows of the law of the electron sheath."""
    law = {
        "solar_wind.thrust_law": "debye-sheath", "solar_wind.cutoff_voltage": None,
        "solar_wind.thrust_factor": None, "solar_wind.electron_temperature_ev": 12.0,
        "solar_wind.tether_radius": 1e-3,
    }  # fmt: skip
    m = Measured(small(LEVELS | law), [N, U, TE], NOISE)
    x = m.scaled(m.start)
    both = (GYRO, CAMERA)
    return [
        row(m, x, "sheath law, one voltage", [N, U], both, 145.0),
        row(m, x, "sheath law, two voltages", [N, U], both),
        row(m, x, "sheath law, two voltages", [N, TE], both),
        row(m, x, "sheath law, two voltages", [N, U, TE], both),
    ]


def main():
    table(HERE / "separate.csv", [*linear(), *sheath()])
