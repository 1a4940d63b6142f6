"""What the scripts of this folder share: schedules of payout, moments of inertia, tables and figures."""

import csv
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure

import esail_jax as esail
from esail_jax.plotting.style import SHEET

HERE = Path(__file__).parent
ISP, G0 = 60.0, 9.80665
"""Specific impulse of cold nitrogen [s], and standard gravity [m/s^2]."""

CALM = {f"solar_wind.{key}": None for key in ("speed", "number_density", "cutoff_voltage")}
CALM |= {"voltage.value": None, "initial.sailing_angle_deg": 0.0, "tethers.bending_damping_time": None}
"""The baseline without wind, with the keys that a deployment asks for."""


class Rigid:
    """The rigid sail of a scene: its tethers are radial, and as long as they are deployed."""

    def __init__(self, scene):
        hub, tethers = scene.hub, scene.tethers
        self.radius = float(hub.radius)
        if hub.inertia is not None:
            self.hub = float(np.asarray(hub.inertia).ravel()[0])
        else:
            self.hub = float(0.5 * np.pi * hub.density * hub.height * hub.radius**4)
        self.count, self.length = tethers.count, float(tethers.length)
        self.line, self.tip = float(tethers.density * tethers.area), float(scene.remote_units.mass)

    def inertia(self, length):
        """About the spin axis [kg m^2], with what is wound up."""
        r, line = self.radius, self.line
        end = r + length
        each = self.tip * end**2 + line * ((end**3 - r**3) / 3.0 + (self.length - length) * r**2)
        return self.hub + self.count * each

    def tension(self, length, spin):
        """At the guide [N], at rest."""
        return spin**2 * (
            self.tip * (self.radius + length) + self.line * length * (self.radius + 0.5 * length)
        )


def pulse(time, off, rise):
    """A smooth step up at 0 and one down at `off`, each of duration `rise`, as that of `[tip_thrust]`."""
    up, down = (np.clip((time - start) / rise, 0.0, 1.0) for start in (0.0, off))
    s = [x**3 * (10.0 - 15.0 * x + 6.0 * x**2) for x in (up, down)]
    return s[0] - s[1]


def schedule(speed, start, end, rise, knots=161):
    """A table of rates from `start` to `end` [m] with l' = speed(l) times a pulse: instants, rates, and the
    instant `off` at which the pulse begins to fall."""

    def run(off, count):
        times = np.linspace(0.0, off + rise, count)
        lengths, rates = [start], []
        for a, b in pairwise(times):
            h, x = b - a, lengths[-1]
            k1 = speed(x) * pulse(a, off, rise)
            k2 = speed(x + 0.5 * h * k1) * pulse(a + 0.5 * h, off, rise)
            k3 = speed(x + 0.5 * h * k2) * pulse(a + 0.5 * h, off, rise)
            k4 = speed(x + h * k3) * pulse(b, off, rise)
            rates.append(k1)
            lengths.append(x + h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0)
        return times, np.array([*rates, 0.0]), lengths[-1]

    low, high = rise, rise
    while abs(run(high, 400)[2] - start) < abs(end - start):
        high *= 2.0
    for _ in range(60):
        off = 0.5 * (low + high)
        low, high = (off, high) if abs(run(off, 800)[2] - start) < abs(end - start) else (low, off)
    fine, rates, _ = run(off, 1601)
    # Knots are dense where the rate bends: in the rises.
    between = rise * (off / rise) ** np.linspace(0.0, 1.0, knots - 40)
    inner = np.unique([*np.linspace(0.0, rise, 21), *np.linspace(off, off + rise, 21), *between])
    at = np.interp(inner, fine, rates)
    paid = (0.5 * (at[1:] + at[:-1]) * np.diff(inner)).sum()
    return inner, at * ((end - start) / paid), off


def table_keys(times, rates, start):
    """Overrides of a scene for a table of rates."""
    keys = {"start_length": start, "time": times.tolist(), "rate": rates.tolist()}
    return {f"deployment.{key}": x for key, x in keys.items()}


def written(name, rows):
    """Writes rows, each a dictionary, and prints them."""
    with (HERE / name).open("w", newline="", encoding="utf-8") as file:
        out = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        out.writeheader()
        out.writerows({k: x if isinstance(x, str) else f"{x:.4g}" for k, x in r.items()} for r in rows)
    print((HERE / name).read_text(encoding="utf-8"))


def panels(rows, columns, size):
    """A figure in the package's style, with its axes."""
    with style.context(SHEET):
        figure = Figure(size, layout="constrained")
        return figure, figure.subplots(rows, columns, squeeze=False)


def simulated(changes, end, count=400, terms=(), scene="baseline"):
    """A run with `count` saved intervals; says what it is warned of."""
    changes = changes | {"integrator.t_end": float(end), "output.interval": float(end) / count}
    run = esail.simulate(scene, changes, terms=list(terms))
    if run.stats["message"]:
        print("  message:", run.stats["message"])
    return run
