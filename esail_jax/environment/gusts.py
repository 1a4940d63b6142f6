"""Synthetic gusts of the solar wind: correlated noise, for examples and robust designs."""

import csv
import os

import numpy as np

from esail_jax.array_types import Float
from esail_jax.constants import PROTON_MASS

SPREAD = {"speed": 0.05, "number_density": 0.3}
"""Standard deviation of the logarithm of each quantity."""


def gusty_wind(
    seed: int,
    duration: float,
    speed: float = 4e5,
    number_density: float = 7.3e6,
    interval: float = 60.0,
    correlation_time: float = 600.0,
) -> dict[str, Float[np.ndarray, " instant"]]:
    """A gusty wind: time [s], speed [m/s] and number_density [1/m^3].

    Instants are `interval` apart, from 0 to `duration` or the first instant beyond. The logarithms are
    independent Ornstein-Uhlenbeck processes, exact at the instants:
    x_{n+1} = rho x_n + sqrt(1 - rho^2) xi_n, rho = exp(-interval / correlation_time).
    """
    time, x = correlated(seed, 2, duration, interval, correlation_time)
    means = {"speed": speed, "number_density": number_density}
    gusts = {key: means[key] * np.exp(SPREAD[key] * row) for key, row in zip(means, x, strict=True)}
    return {"time": time, **gusts}


def gamma_wind(
    seed: int,
    duration: float,
    speed: float = 4e5,
    dynamic_pressure: float = 2e-9,
    variation: float = 0.6,
    interval: float = 60.0,
    correlation_time: float = 600.0,
) -> dict[str, Float[np.ndarray, " instant"]]:
    """A wind of constant speed whose dynamic pressure P = m_p n u^2 has a gamma distribution (Niccolai et
    al., Aerosp. Sci. Technol. 82 (2018) 38): time [s], speed [m/s] and number_density [1/m^3].

    dynamic_pressure: mean of P [Pa]. variation: its standard deviation over its mean, 1/sqrt(k) for the
    shape k; the default is a choice for examples. Correlated normal numbers x, the process of
    `gusty_wind`, are mapped by F_gamma^-1(Phi(x)), so that P has this distribution at every instant.
    """
    from scipy.special import gammaincinv, ndtr

    time, (x,) = correlated(seed, 1, duration, interval, correlation_time)
    shape = variation**-2
    pressure = dynamic_pressure / shape * gammaincinv(shape, ndtr(x))
    return {"time": time, "speed": np.full(len(time), speed),
            "number_density": pressure / (PROTON_MASS * speed**2)}  # fmt: skip


def correlated(
    seed: int, rows: int, duration: float, interval: float, correlation_time: float
) -> tuple[Float[np.ndarray, " instant"], Float[np.ndarray, "row instant"]]:
    """Instants [s] and independent Ornstein-Uhlenbeck processes of unit variance at them."""
    time = interval * np.arange(int(np.ceil(duration / interval)) + 1)
    noise = np.random.default_rng(seed).normal(size=(rows, len(time)))
    rho = np.exp(-interval / correlation_time)
    x = noise.copy()
    for n in range(1, len(time)):
        x[:, n] = rho * x[:, n - 1] + np.sqrt(1.0 - rho**2) * noise[:, n]
    return time, x


def write_wind(path: str | os.PathLike, wind: dict[str, Float[np.ndarray, " instant"]]) -> None:
    """Writes a wind as a CSV file for `solar_wind.file`, which reproduces every digit."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(wind)
        writer.writerows(zip(*(map(repr, column.tolist()) for column in wind.values()), strict=True))
