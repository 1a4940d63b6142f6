"""Tables and messages that `esail export` writes, as arrays. It needs NumPy and SciPy alone, so that
scripts which run beside another program can import it where `esail_jax` is not installed."""

import csv
import datetime
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

SOLAR_MU = 1.32712440018e20
"""The gravitational parameter of the Sun in `esail_jax` [m^3/s^2]."""

OBLIQUITY = np.radians(84381.448 / 3600.0)

TO_EQUATOR = np.array([
    [1.0, 0.0, 0.0],
    [0.0, np.cos(OBLIQUITY), -np.sin(OBLIQUITY)],
    [0.0, np.sin(OBLIQUITY), np.cos(OBLIQUITY)],
])  # fmt: skip
"""Components in EME2000 of a vector with components in the ecliptic of J2000, the axes of the frame I."""


class Table(NamedTuple):
    """A table of vectors: (row, component). time [s]; scale and dates of the rows, "UTC" or "TDB"."""

    time: np.ndarray
    scale: str
    dates: list[str]
    vectors: dict[str, np.ndarray]

    def start(self) -> np.ndarray:
        """Heliocentric position [m] and velocity [m/s] of the hub in the first row, in EME2000."""
        rows = [self.vectors[f"heliocentric_{name}"][0] for name in ("position", "velocity")]
        return np.concatenate([TO_EQUATOR @ row for row in rows])

    def in_eme2000(self, name: str) -> np.ndarray:
        """A vector whose name ends in `_O`, in EME2000. The frame O is that of the hub's position."""
        radial = self.vectors["heliocentric_position"]
        k = radial / np.linalg.norm(radial, axis=1, keepdims=True)
        i = np.cross([0.0, 0.0, 1.0], k)
        i /= np.linalg.norm(i, axis=1, keepdims=True)
        axes = np.stack([i, np.cross(k, i), k], axis=2)
        return np.einsum("hi,tij,tj->th", TO_EQUATOR, axes, self.vectors[name])

    def from_hub_to_centre(self, mass: float) -> tuple[np.ndarray, np.ndarray]:
        """Position [m] and velocity [m/s] of the centre of mass minus those of the hub, in EME2000, of a
        run that starts with the hub at the centre of mass. The velocity of the centre of mass in I is the
        momentum divided by the mass of the whole sail [kg]."""
        velocity = self.vectors["total_momentum_I"] / mass
        position = CubicSpline(self.time, velocity).antiderivative()(self.time)
        apart = position - self.vectors["hub_position_I"], velocity - self.vectors["hub_velocity_I"]
        return apart[0] @ TO_EQUATOR.T, apart[1] @ TO_EQUATOR.T


def in_words(position: np.ndarray, velocity: np.ndarray) -> str:
    """The largest sizes of two series of vectors [m, m/s]."""
    sizes = (np.linalg.norm(x, axis=1).max() for x in (position, velocity))
    return "{:.2g} m, {:.2g} m/s".format(*sizes)


def read_table(path: str | Path) -> Table:
    """The vectors of a table that was written with `--calendar`."""
    with open(path, encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    columns = dict(zip(header, zip(*rows, strict=True), strict=True))
    found: dict[str, list[np.ndarray]] = {}
    for title, values in columns.items():
        named = re.fullmatch(r"(\w+)\[[123]\] \[.*\]", title)
        if named:
            found.setdefault(named[1], []).append(np.array(values, float))
    (dates,) = (title for title in header if title.startswith("date ["))
    vectors = {name: np.stack(parts, axis=1) for name, parts in found.items()}
    return Table(np.array(columns["time [s]"], float), dates[6:9], list(columns[dates]), vectors)


def read_message(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """The rows of a message with one segment: seconds from the first row, and the numbers of each row, as
    they stand there: km and km/s of an OEM, a quaternion with the scalar last of an AEM. No leap second may
    be between the rows."""
    rows = [line.split() for line in Path(path).read_text(encoding="ascii").splitlines()]
    rows = [row for row in rows if row and re.match(r"\d{4}-\d\d-\d\dT", row[0])]
    first = datetime.datetime.fromisoformat(rows[0][0].partition(".")[0])
    seconds = []
    for date, *_ in rows:
        whole, _, part = date.partition(".")
        seconds.append(
            (datetime.datetime.fromisoformat(whole) - first).total_seconds() + float(f"0.{part}")
        )
    time = np.array(seconds)
    return time - time[0], np.array([row[1:] for row in rows], float)
