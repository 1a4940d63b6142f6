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
J, RHO, UNIT = "hub.inertia[1,1]", "tethers.density", "remote_units.mass"

REELS = {
    "hub.mass": 40.0, "hub.inertia": np.diag([20.0, 12.0, 12.0]), "hub.torque": [1e-3, 0.0, 0.0],
    "hub.roots": [[0.0, 1.0, 0.0], [0.0, -0.5, 0.866], [0.0, -0.5, -0.866]], "solar_wind": None,
    "voltage": None, "tethers.wire_radius": None, "tethers.elements": 1, "tethers.length": 80.0,
    "tethers.area": 4.28e-9, "tethers.density": 7653.0, "deployment.start_length": 20.0,
    "deployment.time": [0.0, 60.0, 340.0, 400.0], "initial.spin_rate": 0.5,
    "initial.sailing_angle_deg": 0.0, "integrator.t_end": 400.0, "output.interval": 4.0,
}  # fmt: skip
"""Tethers of 20 m on reels, no wind, and a known torque about the spin axis. The moments of inertia of hub
and tethers are of one size: 20 and 27 kg m^2."""


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


def payout():
    """Rows of tethers that keep their length, and of such that are paid out from 20 to 61 m."""
    rows = []
    for what, rate in (("reels, constant length", 0.0), ("reels, payout", 0.12)):
        rates = {"deployment.rate": [0.0, rate, rate, 0.0]}
        noise = {"spin_rate[2]": NOISE[SPIN], "angular_velocity_B[1]": NOISE[GYRO]}
        m = Measured(small(REELS | rates), [J, RHO, UNIT], noise)
        x = m.scaled(m.start)
        for names in ([J, RHO], [J, UNIT]):
            for observables in ((SPIN,), (SPIN, GYRO)):
                cells = m.rows(*observables)
                columns = x[cells][:, [m.names.index(name) for name in names]]
                values = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), compute_uv=False)
                print(what, names, observables, f"singular values {values[0]:.4f}, {values[1]:.2e}")
                rows.append(row(m, x, what, names, observables))
    return rows


def main():
    table(HERE / "separate.csv", [*linear(), *sheath(), *payout()])
