"""A synthetic solar wind at 1 au in the hourly format of OMNI: noise with the statistics of the wind at the
Earth, two shocks, a fast stream, and gaps.

    python experiments/measured_wind/synthetic.py WIND.dat    # writes the file; run.py does the same

Nothing here is measured. Speed and density of the quiet wind are lognormal; their logarithms follow
Ornstein-Uhlenbeck processes, and a part of that of the density goes against that of the speed. Storms are
shapes in time that are drawn by hand (`SHOCKS`, `STREAM`)."""

import sys
from datetime import datetime, timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np

EPOCH = datetime(2027, 3, 1)
"""Start of the month [UTC]. The file begins a day before it."""

DAYS = 32
"""Length of the file: a day before the month, and one after it."""

SEED = 10

QUIET = {"speed": 395.0, "density": 4.9}
"""Medians of the quiet wind [km/s, 1/cm^3]."""

SPREAD = {"speed": 0.10, "density": 0.42}
"""Standard deviations of the logarithms."""

MEMORY = {"speed": 36.0, "density": 8.0}
"""Times [h] after which the processes are correlated by 1/e."""

AGAINST = -1.5
"""Power of the speed with which the quiet density goes."""

MISSING = ((112, 3), (283, 7), (518, 6), (640, 11))
"""Gaps: first hour of the month, and how many hours have fill values. The third one is in the sheath behind
the second shock: plasma instruments fail in storms."""

DENSITY_MISSING = ((190, 4),)
"""Hours in which the density alone has fill values."""

LINE = (
    "{year:4d}{day:4d}{hour:3d} 9999 99 99 999 999" + " 999.9" * 14 + " 9999999.{density:6.1f}{speed:6.0f}."
    " 999.9 999.9 9.999 99.99 9999999. 999.9 9999. 999.9 999.9 9.999 999.99 999.99 999.9 99 999 99999 9999"
    " 999999.99" + " 99999.99" * 5 + "  0 999 999.9 999.9 99999 99999 99.9"
)
"""The 55 words of an hour. All but date, density (word 24) and speed (word 25) are fill values."""

FILL = {"speed": 9999.0, "density": 999.9}


class Shock(NamedTuple):
    """An interplanetary shock and what drives it. hour: of the month; jump: of the speed [km/s]; sheath:
    how long the compressed wind lasts [h]; compression: factor of its density; decay: time [h] in which the
    speed falls back; ejecta: how long the thin wind behind the sheath lasts [h]."""

    hour: float
    jump: float
    sheath: float
    compression: float
    decay: float
    ejecta: float


SHOCKS = (Shock(168.0, 190.0, 11.0, 3.6, 30.0, 20.0), Shock(516.0, 260.0, 8.0, 4.0, 36.0, 26.0))


class Stream(NamedTuple):
    """A fast stream. hour: of the steepest rise; gain: of the speed [km/s]; rise, decay: times [h];
    compression: factor of the density before it; thin: factor of the density within it."""

    hour: float
    gain: float
    rise: float
    decay: float
    compression: float
    thin: float


STREAM = Stream(300.0, 270.0, 8.0, 75.0, 3.2, 0.55)


def correlated(noise: np.ndarray, memory: float) -> np.ndarray:
    """An Ornstein-Uhlenbeck process of unit variance at every hour, exact at the hours. memory: [h]."""
    rho = np.exp(-1.0 / memory)
    found = noise.copy()
    for k in range(1, len(noise)):
        found[k] = rho * found[k - 1] + np.sqrt(1.0 - rho**2) * noise[k]
    return found


def month() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hours since the month's start (middles of the averages), speed [km/s] and density [1/cm^3]."""
    hour = np.arange(24 * DAYS) - 23.5
    noise = np.random.default_rng(SEED).normal(size=(2, len(hour)))
    x = SPREAD["speed"] * correlated(noise[0], MEMORY["speed"])
    y = SPREAD["density"] * correlated(noise[1], MEMORY["density"])
    speed, factor = QUIET["speed"] * np.exp(x), np.exp(AGAINST * x + y)
    for shock in SHOCKS:
        after = hour - shock.hour
        begun = after > 0.0
        speed += shock.jump * begun * np.exp(-np.clip(after - shock.sheath, 0.0, None) / shock.decay)
        factor *= np.where(begun & (after < shock.sheath), shock.compression, 1.0)
        thin = (after >= shock.sheath) & (after < shock.sheath + shock.ejecta)
        factor *= np.where(thin, 0.5, 1.0)
    after = hour - STREAM.hour
    risen = 1.0 / (1.0 + np.exp(-4.0 * after / STREAM.rise))
    falling = np.exp(-((np.clip(after - 24.0, 0.0, None) / STREAM.decay) ** 2))
    speed += STREAM.gain * risen * falling
    factor *= 1.0 + (STREAM.compression - 1.0) * np.exp(-(((after + 4.0) / STREAM.rise) ** 2))
    factor *= 1.0 + (STREAM.thin - 1.0) * risen * falling
    return hour, speed, QUIET["density"] * factor


def lines(gaps: bool = True) -> list[str]:
    """The lines of the file. gaps: whether hours are missing."""
    hour, speed, density = month()
    speed, density = speed.round(), density.round(1)
    if gaps:
        for first, count in MISSING + DENSITY_MISSING:
            lost = (hour > first) & (hour < first + count)
            density[lost] = FILL["density"]
            if (first, count) in MISSING:
                speed[lost] = FILL["speed"]
    found = []
    for h, u, n in zip(hour.tolist(), speed.tolist(), density.tolist(), strict=True):
        date = EPOCH + timedelta(hours=h)
        day = date.timetuple().tm_yday
        found.append(LINE.format(year=date.year, day=day, hour=date.hour, density=n, speed=u))
    return found


def write(path: Path, gaps: bool = True) -> None:
    """Writes the file."""
    path.write_text("\n".join(lines(gaps)) + "\n", encoding="ascii")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
