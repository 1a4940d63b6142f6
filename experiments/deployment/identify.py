"""The inertia of the hub, the mass of the tethers and the deployed length, from the spin of the hub alone.

python experiments/deployment/identify.py    # writes identify.csv, identify.png
"""

import time

import jax
import jax.numpy as jnp
import numpy as np
from common import CALM, HERE, Rigid, panels, table_keys, written
from scipy.optimize import least_squares

import esail_jax as esail

TRUE = {"hub inertia": 2777.0, "tether density": 76530.0, "length scale": 0.98, "start spin": 0.3}
"""Truth: moment of inertia of the hub [kg m^2], density of the tethers [kg/m^3], length that is paid out
over the one that the reel counts, spin at the start [rad/s]."""

GUESS = {"hub inertia": 3000.0, "tether density": 60000.0, "length scale": 1.0, "start spin": 0.3002}
NOISE = 1e-5
"""Standard deviation of a measured spin rate [rad/s]: two degrees an hour."""

START, LENGTH, INSTANTS = 10.0, 200.0, 96
BEFORE_THE_STOP = 0.9
"""Part of the payout's time before the reels slow down."""

SETS = {
    "J and mass": ("hub inertia", "tether density", "start spin"),
    "J and length": ("hub inertia", "length scale", "start spin"),
    "all": tuple(TRUE),
}
UNITS = "hub inertia", "tether density", "length scale"


def ramp(rate, paid=180.0, rise=300.0):
    """Table of a payout at a rate."""
    long = paid / rate - rise
    return np.array([0.0, rise, rise + long, 2.0 * rise + long]), np.array([0.0, rate, rate, 0.0])


def changes(rate, numbers, elements):
    """Overrides of a run with the numbers of a fit."""
    times, rates = ramp(rate)
    inertia = numbers["hub inertia"] * jnp.diag(jnp.array([1.0, 0.8, 0.8]))
    out = CALM | table_keys(times, rates, START) | {
        "hub.height": None, "hub.density": None, "hub.mass": 5554.0, "hub.inertia": inertia,
        "hub.radius": 1.0, "tethers.count": 4, "tethers.length": LENGTH, "tethers.elements": elements,
        "tethers.density": numbers["tether density"], "remote_units.mass": 0.05,
        "initial.spin_rate": numbers["start spin"], "integrator.t_end": float(times[-1]),
    }  # fmt: skip
    out["deployment.rate"] = numbers["length scale"] * jnp.asarray(rates)
    return out


def instants(rate):
    """Instants of the measurements [s]."""
    return np.linspace(0.0, ramp(rate)[0][-1], INSTANTS)


def spin(rate, numbers, elements=2):
    """Spin rate of the hub at the instants, by the simulation [rad/s]."""
    run = esail.simulate(
        "baseline",
        changes(rate, numbers, elements),
        times=instants(rate),
        save=["spin_rate"],
        max_steps=60000,
    )
    return run["spin_rate"][:, 0]


def rigid_spin(rate, numbers):
    """The same of a rigid sail with radial tethers."""
    times, rates = ramp(rate)
    fine = np.unique([*np.linspace(0.0, times[-1], 4001), *instants(rate)])
    at = np.interp(fine, times, rates)
    counted = np.concatenate([[0.0], np.cumsum(0.5 * (at[1:] + at[:-1]) * np.diff(fine))])
    length = START + numbers["length scale"] * np.interp(instants(rate), fine, counted)
    sail = object.__new__(Rigid)
    sail.radius, sail.hub, sail.count, sail.length = 1.0, numbers["hub inertia"], 4, LENGTH
    sail.line, sail.tip = numbers["tether density"] * 4.28e-9, 0.05
    return numbers["start spin"] * sail.inertia(START) / sail.inertia(length)


def fitted(both, names, data, passes, start=GUESS):
    """Numbers of a fit by Gauss and Newton from the guess, and their standard deviations. both: the model's
    derivatives, and its spin rates."""
    numbers = TRUE | {name: start[name] for name in names}
    for _ in range(passes):
        slopes, expected = both({k: jnp.asarray(float(x)) for k, x in numbers.items()})
        matrix = np.stack([np.asarray(slopes[name]) * TRUE[name] for name in names], axis=1)
        step = np.linalg.lstsq(matrix, data - np.asarray(expected), rcond=None)[0]
        numbers = numbers | {k: numbers[k] + x * TRUE[k] for k, x in zip(names, step, strict=True)}
    deviation = NOISE * np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))
    return numbers, dict(zip(names, deviation, strict=True))


def rigid_fit(rate, names, data, until=1.0):
    """The same with the rigid formula, from the measurements of the first part of the payout."""
    used = slice(round(until * INSTANTS))

    def missing(x):
        return (rigid_spin(rate, TRUE | dict(zip(names, x, strict=True))) - data)[used] / NOISE

    start = np.array([GUESS[name] for name in names])
    found = least_squares(missing, start, x_scale=np.abs(start), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return dict(zip(names, found.x, strict=True))


def main():
    rows, shown = [], {}
    generator = np.random.default_rng(58)
    for rate in (0.02, 0.05):
        truth = np.asarray(spin(rate, TRUE, 4))
        lag = esail.simulate("baseline", changes(rate, TRUE, 4), times=instants(rate))["lagging_angle"]
        noise = NOISE * generator.standard_normal((200, INSTANTS))
        shown[rate] = truth, rigid_spin(rate, TRUE), np.rad2deg(np.asarray(lag)[:, 0])

        def twice(numbers, rate=rate):
            found = spin(rate, numbers)
            return found, found

        both = esail.jit(jax.jacfwd(twice, has_aux=True))
        begin = time.perf_counter()
        for name, names in SETS.items():
            quiet, early = (rigid_fit(rate, names, truth, until) for until in (1.0, BEFORE_THE_STOP))
            noisy = [rigid_fit(rate, names, truth + n) for n in noise[:50]]
            exact, deviation = fitted(both, names, truth, 3)
            one, _ = fitted(both, names, truth + noise[0], 1, exact)
            for key in (x for x in names if x in UNITS):
                bias = {
                    "rigid, no noise": quiet[key], "rigid, no noise, without the stop": early[key],
                    "simulation, no noise": exact[key], "simulation, one draw": one[key],
                }  # fmt: skip
                row = {"rate [m/s]": rate, "largest lag [deg]": np.abs(shown[rate][2]).max(), "fit": name,
                       "number": key}  # fmt: skip
                row |= {f"error [%], {k}": 1e2 * (x / TRUE[key] - 1.0) for k, x in bias.items()}
                row["deviation by noise [%], simulation"] = 1e2 * deviation[key]
                row["deviation by noise [%], rigid, 50 draws"] = (
                    1e2 * np.std([x[key] for x in noisy]) / TRUE[key]
                )
                rows.append(row)
                print(
                    {k: x if isinstance(x, str) else float(f"{x:.4g}") for k, x in row.items()}, flush=True
                )
        print(f"fits at {rate} m/s: {time.perf_counter() - begin:.0f} s", flush=True)
    written("identify.csv", rows)
    picture(shown)


def picture(shown):
    """Draws spin, what the rigid formula misses, and the lag."""
    figure, axes = panels(1, 3, (11.0, 3.6))
    for rate, (truth, rigid, lag) in shown.items():
        hours = instants(rate) / 3600.0
        axes[0, 0].plot(hours, truth, label=f"{rate:g} m/s")
        axes[0, 1].plot(hours, (rigid - truth) / NOISE)
        axes[0, 2].plot(hours, lag)
    labels = (
        "spin of the hub [rad/s]",
        "rigid formula less simulation,\nover the noise [-]",
        "angle of a tether [deg]; negative: lag",
    )
    for axis, label in zip(axes[0], labels, strict=True):
        axis.set_ylabel(label)
        axis.set_xlabel("time [h]")
    axes[0, 1].set_yscale("symlog", linthresh=10.0)
    axes[0, 1].set_ylim(-20.0, 300.0)
    axes[0, 1].axhline(0.0, color="0.7", lw=0.8)
    axes[0, 0].legend(frameon=False)
    figure.savefig(HERE / "identify.png", dpi=90)


if __name__ == "__main__":
    main()
