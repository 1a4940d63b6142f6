"""Integrates an orbit from a thrust history file, and compares it with that of the run.

    python docs/scripts/thrust_orbit.py sail.thrust sail.csv sail.oem --mass 5561.646

It reads the file without the code that wrote it, starts from the first row of the table, and integrates
R'' = -mu R/|R|^3 + F(t)/m with a cubic spline (not-a-knot) through the rows of F. The OEM holds the orbit
of the hub, the integrated one is that of the centre of mass: the second line that is printed leaves out how
far the two are apart."""

import argparse
from pathlib import Path

import numpy as np
from run_table import SOLAR_MU, Table, in_words, read_message, read_table
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline


def read_thrust(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Seconds from the start and the thrust [N] of a file with one segment without mass flow."""
    head, _, rest = path.read_text(encoding="ascii").partition("ModelThrustOnly\n")
    rows = np.array([line.split() for line in rest.partition("EndThrust")[0].splitlines()], float)
    keys = dict(line.split(" = ") for line in head.splitlines()[1:])
    if keys["Thrust_Vector_Coordinate_System"] != "EarthMJ2000Eq":
        raise SystemExit("The thrust must be in EarthMJ2000Eq.")
    return rows[:, 0], rows[:, 1:]


def orbit(thrust: Path, table: Table, message: Path, mass: float) -> tuple[np.ndarray, np.ndarray]:
    """Position [m] and velocity [m/s] in the rows of the OEM minus those of the OEM.

    The integrated unknown is the distance from the straight line of the first row, so that rounding is that
    of thousands of kilometres and not that of an astronomical unit."""
    spline = CubicSpline(*read_thrust(thrust))
    time, rows = read_message(message)
    start, speed = np.split(table.start(), 2)

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        place = start + speed * t + y[:3]
        pull = -SOLAR_MU * place / np.linalg.norm(place) ** 3
        return np.concatenate([y[3:], pull + spline(t) / mass])

    tight = {"rtol": 1e-12, "atol": 1e-9, "max_step": 60.0}
    found = solve_ivp(rates, (0.0, time[-1]), np.zeros(6), "DOP853", t_eval=time, **tight).y.T
    moved = 1e3 * rows[:, :3] - start - speed * time[:, None]
    return found[:, :3] - moved, found[:, 3:] - (1e3 * rows[:, 3:] - speed)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("thrust", type=Path, help="thrust history file")
    options.add_argument("table", type=Path, help="table of the run (.csv)")
    options.add_argument("message", type=Path, help="its orbit (.oem)")
    options.add_argument("--mass", type=float, required=True, help="mass of the sail [kg]")
    given = options.parse_args()
    run = read_table(given.table)
    apart = orbit(given.thrust, run, given.message, given.mass)
    left = (x - y for x, y in zip(apart, run.from_hub_to_centre(given.mass), strict=True))
    print("from the hub:           ", in_words(*apart))
    print("from the centre of mass:", in_words(*left))
