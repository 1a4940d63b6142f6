"""The figures of this folder."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from measures import signals, wind_of

import esail_jax as esail
from esail_jax.plotting.style import BLUE, ORANGE, PURPLE, RED, styled

GREY = "0.45"
LOOKS: dict[str, dict[str, Any]] = {
    "held": {"color": BLUE},
    "held, mean wind": {"color": "black", "ls": "--"},
    "held, 40 W at most": {"color": PURPLE},
    "constant thrust": {"color": ORANGE},
    "held, no gaps": {"color": GREY},
}
DAY, HOUR = 86400.0, 3600.0
TURNS = 13
"""Rows over which coning is averaged: five turns of the sail, with which it oscillates."""


def smooth(values: np.ndarray) -> np.ndarray:
    """The mean over five turns about every row, nan where the run has not so many rows."""
    half = np.full(TURNS // 2, np.nan)
    return np.concatenate([half, np.convolve(values, np.ones(TURNS) / TURNS, "valid"), half])


def gaps_of(scene: esail.Scene) -> list[tuple[float, float]]:
    """First and last instant [s] of every bridged gap: rows farther apart than the least distance."""
    time = np.asarray(scene.solar_wind.time)
    step = np.diff(time)
    return [(time[k], time[k + 1]) for k in np.flatnonzero(step > 1.5 * step.min())]


def finish(figure: Figure, handles: dict[str, Any], path: Path) -> None:
    """A legend below the panels, and the file."""
    figure.legend(
        handles.values(),
        handles.keys(),
        loc="outside lower center",
        ncols=min(len(handles), 4),
        frameon=False,
    )
    figure.savefig(path, dpi=90)
    print(f"wrote {path}")


@styled
def draw_wind(scene: esail.Scene, marks: dict[str, float], path: Path) -> None:
    """The wind of the month with its gaps, and sqrt(n) u against that of the means. marks: instants [s] by
    what begins there."""
    time, speed, density = wind_of(scene)
    marks = {name: instant for name, instant in marks.items() if instant < time[-1]}
    day, load = time / DAY, np.sqrt(density) * speed
    load /= np.sqrt(density.mean()) * speed.mean()
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    handles = {"wind": panels[0].plot(day, 1e-3 * speed, lw=1.0, color=BLUE)[0]}
    panels[1].semilogy(day, 1e-6 * density, lw=1.0, color=BLUE)
    panels[2].plot(day, load, lw=1.0, color=BLUE)
    means = (1e-3 * speed.mean(), 1e-6 * density.mean(), load.mean())
    for panel, value in zip(panels, means, strict=True):
        handles["mean"] = panel.axhline(value, color="black", ls="--", lw=1.0)
        for first, last in gaps_of(scene):
            handles["gap, bridged"] = panel.axvspan(first / DAY, last / DAY, color="0.8", lw=0)
        for instant in marks.values():
            panel.axvline(instant / DAY, color=RED, lw=0.8, ls=":")
    for name, instant in marks.items():
        panels[0].annotate(
            name, (instant / DAY, 1.0), (0, 3), xycoords=("data", "axes fraction"),
            textcoords="offset points", ha="center", fontsize=9, color=RED,
        )  # fmt: skip
    panels[2].axhline(1.0, color="black", lw=0.5)
    labels = ("speed [km/s]", "density [1/cm$^3$]", r"$\sqrt{n}\,u$, of that of the means [-]")
    for panel, label in zip(panels, labels, strict=True):
        panel.set_ylabel(label)
        panel.grid(alpha=0.3)
    panels[2].set(xlabel="day", xlim=(0.0, scene.integrator.t_end / DAY))
    finish(figure, handles, path)


@styled
def draw_month(flights: dict[str, esail.Solution], path: Path) -> None:
    """Thrust, voltage, power, coning, angle and path over the month."""
    figure = Figure(figsize=(12.0, 9.5), layout="constrained")
    panels = figure.subplots(3, 2, sharex=True)
    shown = (
        ("thrust_mN", "thrust [mN]", ("held", "constant thrust", "held, mean wind")),
        ("voltage_kV", "mean voltage [kV]", ("constant thrust", "held, 40 W at most", "held")),
        ("power_W", "electric power [W]", ("held", "held, 40 W at most", "held, mean wind")),
        ("coning_deg", "coning, mean over 5 turns [deg]", ("held", "constant thrust", "held, mean wind")),
        ("angle_deg", "angle of the spin plane [deg]", ("held", "held, mean wind", "constant thrust")),
    )
    handles: dict[str, Any] = {}
    of = {name: signals(run) for name, run in flights.items() if name in LOOKS}
    for panel, (key, label, names) in zip(panels.flat, shown, strict=False):
        for name in names:
            day, values = flights[name].time / DAY, of[name][key]
            values = smooth(values) if key == "coning_deg" else values
            (handles[name],) = panel.plot(day, values, lw=0.9, **LOOKS[name])
        panel.set_ylabel(label)
    place = {name: np.asarray(flights[name]["heliocentric_position"]) for name in LOOKS if name in flights}
    for name in ("held", "constant thrust", "held, 40 W at most"):
        apart = np.linalg.norm(place[name] - place["held, mean wind"], axis=1)
        panels[2, 1].plot(flights[name].time / DAY, 1e-6 * apart, lw=1.2, **LOOKS[name])
    panels[2, 1].set_ylabel("off the path in the mean wind [1000 km]")
    for panel in panels.flat:
        panel.grid(alpha=0.3)
    for panel in panels[2]:
        panel.set(xlabel="day", xlim=(0.0, next(iter(flights.values())).time[-1] / DAY))
    finish(figure, handles, path)


@styled
def draw_cost_of_gaps(
    flights: dict[str, esail.Solution], scene: esail.Scene, span: tuple[float, float], path: Path
) -> None:
    """Thrust and coning in a storm of which hours are missing. span: first and last instant [s]."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    panels = figure.subplots(1, 2)
    handles: dict[str, Any] = {}
    for panel, key, label in zip(
        panels, ("thrust_mN", "coning_deg"), ("thrust [mN]", "coning, mean over 5 turns [deg]"), strict=True
    ):
        for name in ("held, no gaps", "held"):
            run = flights[name]
            now = (run.time >= span[0]) & (run.time <= span[1])
            values = signals(run)[key]
            values = smooth(values) if key == "coning_deg" else values
            line = panel.plot(run.time[now] / HOUR, values[now], lw=1.2, **LOOKS[name])
            handles[name] = line[0]
        for first, last in gaps_of(scene):
            if span[0] <= first <= span[1]:
                handles["gap, bridged"] = panel.axvspan(first / HOUR, last / HOUR, color="0.85", lw=0)
        panel.set(xlabel="hour of the month", ylabel=label, xlim=(span[0] / HOUR, span[1] / HOUR))
        panel.grid(alpha=0.3)
    finish(figure, handles, path)
