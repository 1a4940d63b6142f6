"""Measures how fast the wind relative to the moving tethers brakes the spin of a sail.

    python experiments/relative_wind/run.py     # two minutes of one core; writes table.csv

Every sail runs for thirty spin periods twice, with `solar_wind.relative` and without. A spin that decays
with the rate k lags by the angle k w t^2 / 2 behind one that does not, as long as k t is small. The rate k
is fitted to the difference of the mean azimuths of the tips, and compared with that of rigid straight
tethers, sigma L / (3 u (m + rho A L / 3)).
"""

import csv
from pathlib import Path

import numpy as np

import esail_jax as esail
from esail_jax.constants import (
    ASTRONOMICAL_UNIT,
    PROTON_MASS,
    SOLAR_MU,
    THRUST_FACTOR,
    VACUUM_PERMITTIVITY,
)

HERE = Path(__file__).parent
TURNS = 30
YEAR = 365.25 * 86400.0
COULOMB = THRUST_FACTOR * np.sqrt(VACUUM_PERMITTIVITY * PROTON_MASS)
"""sigma / u = COULOMB (V - V_0) sqrt(n), the law of [PGV]."""

LIGHT = {"tethers.length": 20e3, "voltage.value": 40e3, "remote_units.mass": 0.5}
CASES = {
    "baseline, facing the Sun": {"initial.sailing_angle_deg": 0.0},
    "baseline, 10 deg": {},
    "baseline, 35 deg": {"initial.sailing_angle_deg": 35.0},
    "baseline, spin 8 mrad/s": {"initial.spin_rate": 8e-3},
    "20 km, 40 kV, units of 0.5 kg": LIGHT,
    "the same with the plasma at 0.5 au": LIGHT | {"solar_wind.number_density": 4 * 7.3e6},
}


def azimuth(scene: esail.Scene) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and the mean azimuth [rad] of the tips in the spin plane of the start."""
    run = esail.simulate(scene, save=("tip_position_I", "hub_position_I", "rotation_IB"))
    away = np.asarray(run["tip_position_I"]) - np.asarray(run["hub_position_I"])[:, None]
    seen = away @ np.asarray(run["rotation_IB"])[0]
    angle = np.unwrap(np.arctan2(seen[..., 2], seen[..., 1]), axis=0)
    return np.asarray(run.time), (angle - angle[0]).mean(1)


def rigid(scene: esail.Scene) -> float:
    """The rate of decay [1/s] of rigid straight tethers."""
    wind, tethers = scene.solar_wind, scene.tethers
    push = COULOMB * (scene.voltage.value - wind.cutoff_voltage) * np.sqrt(wind.number_density)
    mass = scene.remote_units.mass + tethers.density * tethers.area * tethers.length / 3.0
    return push * tethers.length / (3.0 * mass)


def measure(name: str, overrides: dict) -> dict:
    """The row of a case."""
    spin = overrides.get("initial.spin_rate", 4e-3)
    t_end = TURNS * 2 * np.pi / spin
    settings = overrides | {"integrator.t_end": t_end, "output.interval": t_end / (40 * TURNS)}
    scene = esail.load_scene("baseline", settings)
    time, without = azimuth(scene)
    _, braked = azimuth(scene.replace({"solar_wind.relative": True}))
    parabola = -0.5 * spin * time**2
    lag = braked - without
    rate = float(parabola @ lag / (parabola @ parabola))
    left = np.abs(lag - rate * parabola).max() / np.abs(lag).max()
    angle = np.radians(float(scene.initial.sailing_angle_deg))
    along = np.tan(angle) * np.sqrt(SOLAR_MU / ASTRONOMICAL_UNIT**3)
    return {
        "case": name, "rate [1/s]": rate, "rigid [1/s]": rigid(scene), "not a parabola": left,
        "spin lost in a year [%]": 100 * (1 - np.exp(-rate * YEAR)),
        "orbital rate x tan(angle) [1/s]": along,
    }  # fmt: skip


def main() -> None:
    """Measures all cases, prints and writes table.csv."""
    rows = []
    for case in CASES.items():
        rows.append(measure(*case))
        print(rows[-1], flush=True)
    with (HERE / "table.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        for row in rows:
            table.writerow({k: v if isinstance(v, str) else f"{v:.4g}" for k, v in row.items()})


if __name__ == "__main__":
    main()
