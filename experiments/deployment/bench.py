"""Constant rate of the hub against constant tension, as Fulton and Schaub compare them.

python experiments/deployment/bench.py    # writes bench.csv, bench.png
"""

import jax.numpy as jnp
import numpy as np
from common import CALM, HERE, panels, simulated, table_keys, written

from esail_jax.array_types import Array
from esail_jax.physics import HubLoad

RADIUS, LENGTH, START = 1.0, 100.0, 5.0
SPIN = 0.05
"""Rate of the hub at the end [rad/s]; of the constant rate, all the time."""

PART = 0.3
"""Part of the lag limit: l' = PART r w/2, or sin(lag) = PART."""

DENSITY, AREA = 7653.0, 4.28e-9
LINE = DENSITY * AREA


class Motor(HubLoad):
    """A torque about the spin axis that holds the hub at a rate which a table gives."""

    time: Array
    rate: Array
    gain: Array

    def wrench(self, hub):
        wanted = jnp.interp(hub.time, self.time, self.rate)
        return jnp.zeros(3), self.gain * (wanted - hub.angular_velocity[0]) * jnp.array([1.0, 0.0, 0.0])


class Tether:
    """One rigid radial tether with a remote unit, on a hub of radius r that turns at a given rate."""

    def __init__(self, share):
        """share: mass of the tether over that of the remote unit."""
        self.tip = LINE * LENGTH / share

    def tension(self, length):
        """At the guide, over the square of the rate."""
        return self.tip * (RADIUS + length) + LINE * length * (RADIUS + 0.5 * length)

    def lag(self, length, rate, slope):
        """Sine of the lag per rate of payout at rate `rate` of the hub, slope: dw/dl. Moments about the
        root: of Coriolis and Euler forces, over that of the pull to the outside."""
        first = self.tip * length + 0.5 * LINE * length**2
        second = self.tip * length**2 + LINE * length**3 / 3.0
        coriolis = 2.0 * rate * first
        return (coriolis + slope * (second + RADIUS * first)) / (RADIUS * rate**2 * first)


def schedule(tether, law, limit, knots=241):
    """Table of a payout: instants, rates of payout, rates of the hub, lengths."""
    u = np.linspace(0.0, 1.0, 4001)
    length = START + (LENGTH - START) * u**2
    if law == "constant rate":
        rate = np.full(length.shape, SPIN)
    else:
        rate = SPIN * np.sqrt(tether.tension(LENGTH) / tether.tension(length))
    slope = np.gradient(rate, length)
    speed = PART * RADIUS * rate / 2.0 if limit == "nominal" else PART / tether.lag(length, rate, slope)
    middle = 0.5 * (speed[1:] + speed[:-1])
    time = np.concatenate([[0.0], np.cumsum(np.diff(length) / middle)])
    ideal = time[-1]
    # The rate rises from zero and falls to zero: time is stretched at both ends.
    rise = 0.04 * ideal
    real = np.linspace(0.0, ideal + rise, 8001)
    s = [np.clip((real - a) / rise, 0.0, 1.0) for a in (0.0, ideal)]
    smooth = [x**3 * (10.0 - 15.0 * x + 6.0 * x**2) for x in s]
    flow = smooth[0] - smooth[1]
    inner = np.concatenate([[0.0], np.cumsum(0.5 * (flow[1:] + flow[:-1]) * np.diff(real))])
    inner *= ideal / inner[-1]
    at = np.interp(inner, time, length)
    paid = np.interp(at, length, speed) * flow
    few = np.unique(np.concatenate([np.linspace(0.0, rise, 41), np.linspace(0.0, real[-1], knots),
                                    np.linspace(ideal, real[-1], 41)]))  # fmt: skip
    rates = np.interp(few, real, paid)
    rates *= (LENGTH - START) / (0.5 * (rates[1:] + rates[:-1]) * np.diff(few)).sum()
    return few, rates, np.interp(few, real, np.interp(at, length, rate)), ideal


def run_of(tether, law, limit):
    """The run, and the ideal duration."""
    time, paid, rate, ideal = schedule(tether, law, limit)
    inertia = 1e4
    changes = CALM | {
        "hub.height": None, "hub.density": None, "hub.mass": 1e4,
        "hub.inertia": np.diag([inertia, 0.8 * inertia, 0.8 * inertia]).tolist(), "hub.radius": RADIUS,
        "tethers.count": 2, "tethers.length": LENGTH, "tethers.elements": 4,
        "remote_units.mass": tether.tip, "initial.spin_rate": float(rate[0]),
            }  # fmt: skip
    changes |= table_keys(time, paid, START)
    motor = Motor(jnp.asarray(time), jnp.asarray(rate), jnp.asarray(inertia * 0.5))
    return simulated(changes, time[-1], 600, [motor]), ideal


def main():
    rows, runs, known = [], {}, {}
    for share in (0.01, 1.0, 100.0):
        tether = Tether(share)
        for limit in ("nominal", "lag"):
            found = {}
            for law in ("constant rate", "constant tension"):
                same = limit == "lag" and law == "constant rate"
                # The constant rate has no Euler force: both limits are the same.
                key = (share, law, "nominal" if same else limit)
                if key not in known:
                    known[key] = run_of(tether, law, limit)
                run, ideal = known[key]
                lag = np.sin(np.asarray(run["lagging_angle"])[:, 0])
                middle = (run.time > 0.15 * run.time[-1]) & (run.time < 0.85 * run.time[-1])
                found[law] = (
                    run.time[-1], ideal, np.abs(lag).max(), np.abs(lag[middle]).mean(),
                    np.asarray(run["winch_tension"]).max() / (SPIN**2 * tether.tension(LENGTH)),
                    np.asarray(run["winch_tension"])[:, 0][middle].std()
                    / np.asarray(run["winch_tension"])[:, 0][middle].mean(),
                    np.abs(np.asarray(run["spin_rate"])[:, 0]).max(),
                )  # fmt: skip
                runs[share, limit, law] = run
                print(share, limit, law, found[law], run.stats["steps"], flush=True)
            a, b = found["constant rate"], found["constant tension"]
            whole = 0.0 if limit == "nominal" else 0.5
            rows.append({
                "tether mass / unit mass": share, "held": "l' / (r w)" if limit == "nominal" else "lag",
                "time at constant rate [s]": a[0], "time at constant tension [s]": b[0],
                "ratio": a[0] / b[0], "quasi-steady ratio from 5 %": a[1] / b[1],
                "quasi-steady ratio from 0": limit_ratio(share, whole),
                "mean sine of lag, constant rate": a[3], "mean sine of lag, constant tension": b[3],
                "largest sine of lag, constant rate": a[2], "largest sine of lag, constant tension": b[2],
                "largest tension / allowed, constant rate": a[4],
                "largest tension / allowed, constant tension": b[4],
            })  # fmt: skip
    written("bench.csv", rows)
    picture(runs)


def limit_ratio(share, euler):
    """The ratio from length zero, without the radius of the hub in the arms. euler: 0 without the moment of
    the Euler force, any other number with it."""
    x = np.linspace(0.0, 1.0, 200_001)[1:]
    pull = x + 0.5 * share * x**2
    rate = np.sqrt(pull[-1] / pull)
    times = []
    for w in (np.ones_like(x), rate):
        first, second = x + 0.5 * share * x**2, x**2 + share * x**3 / 3.0
        slope = np.gradient(w, x) if euler else 0.0
        cost = (2.0 * w * first + slope * second) / (w**2 * first)
        times.append(np.trapezoid(cost, x))
    return times[0] / times[1]


def picture(runs):
    """Draws length, tension and lag of the light and of the heavy tether."""
    figure, axes = panels(3, 3, (10.5, 7.0))
    shares = sorted({key[0] for key in runs})
    titles = "light tether", "tether as heavy as the unit", "heavy tether"
    for column, share in enumerate(shares):
        for (other, limit, law), run in runs.items():
            if other != share:
                continue
            style = {"nominal": "-", "lag": "--"}[limit]
            color = {"constant rate": "C0", "constant tension": "C1"}[law]
            label = law + {"nominal": ", equal l'/(r w)", "lag": ", equal lag"}[limit]
            if limit == "lag" and law == "constant rate":
                continue
            time = np.asarray(run.time) / 60.0
            allowed = SPIN**2 * Tether(share).tension(LENGTH)
            axes[0, column].plot(time, run["deployed_length"][:, 0], style, color=color, label=label)
            axes[1, column].plot(time, run["winch_tension"][:, 0] / allowed, style, color=color)
            axes[2, column].plot(time, np.rad2deg(run["lagging_angle"][:, 0]), style, color=color)
        axes[0, column].set_title(titles[column])
        axes[2, column].set_xlabel("time [min]")
    for axis, label in zip(
        axes[:, 0], ("deployed length [m]", "tension / allowed", "lag [deg]"), strict=True
    ):
        axis.set_ylabel(label)
    axes[0, 0].legend(frameon=False, fontsize=7)
    figure.savefig(HERE / "bench.png", dpi=90)


if __name__ == "__main__":
    main()
