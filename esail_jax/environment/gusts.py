"""A synthetic gusty solar wind: correlated noise about steady values, for examples and robust designs."""

import csv
import os

import numpy as np

from esail_jax.array_types import Float

SPREAD = {"speed": 0.05, "number_density": 0.3}
"""Standard deviation of the logarithm."""


def gusty_wind(
    seed: int,
    duration: float,
    speed: float = 4e5,
    number_density: float = 7.3e6,
    interval: float = 60.0,
    correlation_time: float = 600.0,
) -> dict[str, Float[np.ndarray, " instant"]]:
    """time [s] from 0 to `duration` or just beyond, speed [m/s] and number_density [1/m^3].

    Logarithms are independent Ornstein-Uhlenbeck processes, exact at the instants:
    x_{n+1} = rho x_n + sqrt(1 - rho^2) xi_n, rho = exp(-interval / correlation_time).
    """
    time = interval * np.arange(int(np.ceil(duration / interval)) + 1)
    noise = np.random.default_rng(seed).normal(size=(2, len(time)))
    rho = np.exp(-interval / correlation_time)
    x = noise.copy()
    for n in range(1, len(time)):
        x[:, n] = rho * x[:, n - 1] + np.sqrt(1.0 - rho**2) * noise[:, n]
    means = {"speed": speed, "number_density": number_density}
    gusts = {key: means[key] * np.exp(SPREAD[key] * row) for key, row in zip(means, x, strict=True)}
    return {"time": time, **gusts}


def write_wind(path: str | os.PathLike, wind: dict[str, Float[np.ndarray, " instant"]]) -> None:
    """As a CSV file that `solar_wind.file` reads, digit for digit."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(wind)
        writer.writerows(zip(*(map(repr, column.tolist()) for column in wind.values()), strict=True))
