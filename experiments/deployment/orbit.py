"""A tether paid out below a carrier in low orbit in two stages, as YES2 did in 2007, and reeled in again.

python experiments/deployment/orbit.py    # writes orbit.csv, orbit.png
"""

import time as clock

import numpy as np
from common import HERE, panels, written
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

import esail_jax as esail

W = 1.17e-3
"""Mean motion at about 270 km [rad/s]."""

TIP, LINE, STIFFNESS, MODULUS = 12.0, 970.0 * np.pi / 4.0 * 0.5e-3**2, np.pi / 4.0 * 0.5e-3**2 * 90e9, 90e9
"""End mass [kg], mass per length [kg/m], EA [N], E [Pa]: 0.5 mm of Dyneema."""

FIRST, SECOND = 3400.0, 31700.0
"""Lengths of the two stages [m]."""

DAMPING = 0.005
"""Of axial damping [s]."""

SLACK, LOOSE = 1e-6, 1e-3
"""Strain over which the stiffness of a slack rod rises, and tension that counts as slack [N]."""

START, EJECTED = 160.0, 3.0
"""Length [m] at which the runs begin, a two-hundredth of the tether, and speed of the springs [m/s]."""

STAGE_1, HOLD, STAGE_2, BACK = 5400.0, 3000.0, 3900.0, 900.0
"""Durations [s]: first payout, pause, second payout, swing back."""

KNOT, HALF = 30.0, 5.0
"""Instants of the tables, and half a step of the model [s]."""

GAIN = 0.5
"""Of the damping of the swing: l'/l = k W - (|k| + GAIN) theta'."""

RETRIEVED = 5000.0, 500.0
"""Lengths of the retrieval [m]."""


# ---- the model for the design: a straight tether that does not stretch -------------------------------


def moments(length):
    """First and second moment of tether and end mass about the reel."""
    return TIP * length + LINE * length**2 / 2.0, TIP * length**2 + LINE * length**3 / 3.0


def turning(length, rate, angle, speed):
    """theta'' of the angle from the vertical below the carrier, positive forward."""
    first, second = moments(length)
    return -2.0 * rate * first / second * (speed - W) - 3.0 * W**2 * np.sin(angle) * np.cos(angle)


def tension(length, acceleration, angle, speed):
    """At the reel [N]."""
    pull = (speed - W) ** 2 + W**2 * (3.0 * np.cos(angle) ** 2 - 1.0)
    return moments(length)[0] * pull - (TIP + LINE * length) * acceleration


def paid(rates, start):
    """Lengths at instants every HALF seconds."""
    return start + np.concatenate([[0.0], np.cumsum(0.5 * HALF * (rates[1:] + rates[:-1]))])


def swing(rates, start, angle, speed):
    """Lengths, angles and their speeds every HALF seconds, by Runge and Kutta with twice that as the step;
    rates: at all instants."""
    length = paid(rates, start)
    first, second = moments(length)
    coriolis = (2.0 * rates * first / second).tolist()
    out = [(angle, speed)]
    h, pull = 2.0 * HALF, 3.0 * W**2

    def slope(c, a, s):
        return s, -c * (s - W) - 0.5 * pull * np.sin(2.0 * a)

    for i in range(0, len(rates) - 1, 2):
        c = coriolis[i : i + 3]
        a1, s1 = slope(c[0], angle, speed)
        a2, s2 = slope(c[1], angle + 0.5 * h * a1, speed + 0.5 * h * s1)
        a3, s3 = slope(c[1], angle + 0.5 * h * a2, speed + 0.5 * h * s2)
        a4, s4 = slope(c[2], angle + h * a3, speed + h * s3)
        angle, speed = (
            angle + h * (a1 + 2 * a2 + 2 * a3 + a4) / 6,
            speed + h * (s1 + 2 * s2 + 2 * s3 + s4) / 6,
        )
        out.append((angle, speed))
    return length[::2], *np.array(out).T


def table(nodes, duration, first):
    """Instants and rates of a table through nodes, with rates `first` and zero at the ends: a spline, in
    straight lines between the instants."""
    at = np.linspace(0.0, duration, len(nodes) + 2)
    ends = ((2, 0.0) if first else (1, 0.0), (1, 0.0))
    spline = CubicSpline(at, [first, *nodes, 0.0], bc_type=ends)
    times = np.arange(0.0, duration + 0.5 * KNOT, KNOT)
    rates = spline(times)
    rates[[0, -1]] = first, 0.0
    return times, rates


def fine(times, rates):
    """The rates every HALF seconds."""
    return np.interp(np.arange(0.0, times[-1] + 0.5 * HALF, HALF), times, rates)


def designed(nodes, duration, first, start, end, state, goal, fastest):
    """Table of a stage that ends at length `end` and makes `goal(angles, speeds)` zero: by least squares,
    with smooth rates, a taut tether and no rate above `fastest`."""

    def missing(nodes):
        times, rates = table(nodes, duration, first)
        length, angle, speed = swing(fine(times, rates), start, *state)
        acceleration = np.interp(np.arange(len(length)) * 2.0 * HALF, times, np.gradient(rates, KNOT))
        slack = np.minimum(tension(length, acceleration, angle, speed) - 4e-6 * length, 0.0)
        size = np.abs(rates).mean()
        return np.concatenate([
            1e3 * goal(angle, speed), [1e3 * (length[-1] / end - 1.0)],
            0.1 * np.diff([*nodes, 0.0], 2) / size, 30.0 * np.minimum(rates, 0.0) / size,
            30.0 * np.maximum(rates - fastest, 0.0) / size, 10.0 * slack / length * 1e6,
        ])  # fmt: skip

    found = least_squares(missing, nodes, x_scale=np.abs(nodes), max_nfev=300)
    times, rates = table(found.x, duration, first)
    rates[1:-1] *= 1.0 + (end - start - np.trapezoid(rates, times)) / np.trapezoid(rates[1:-1], times[1:-1])
    return times, rates


def joined(*parts):
    """One table of several, each with its own instants from zero; the rate is zero between them."""
    times, rates = parts[0]
    for more, others in parts[1:]:
        times = np.concatenate([times, times[-1] + more[1:]])
        rates = np.concatenate([rates, others[1:]])
    return times, rates


PAUSE = np.array([0.0, HOLD]), np.zeros(2)


def ejected():
    """Angle and its speed at START: the springs throw along the vertical, and the end mass flies freely."""
    return W * START / EJECTED, W


def stages():
    """The tables of stage 1 with a good brake profile, of one with a straight one, and of stage 2."""
    nodes = np.array([1.0, 0.4, 0.4, 0.6, 0.8, 0.8, 0.4])

    def at_rest(angle, speed):
        return np.array([angle[-1], speed[-1] / W])

    def swung_forward(angle, speed):
        return np.array([angle.max() - np.deg2rad(45.0)])

    good = designed(nodes, STAGE_1, EJECTED, START, FIRST, ejected(), at_rest, EJECTED)
    stop = 2.0 * (FIRST - START) / EJECTED
    straight = np.array([0.0, stop, STAGE_1]), np.array([EJECTED, 0.0, 0.0])
    nodes = np.array([1.5, 3.0, 7.5, 12.0, 12.0, 12.0, 10.0])
    second = designed(nodes, STAGE_2, 0.0, FIRST, SECOND, (0.0, 0.0), swung_forward, 13.0)
    return good, straight, second


# ---- the flights of the chain ------------------------------------------------------------------------


def flown(
    times, rates, start, state, out=(0.0, 0.0), end=None, whole=SECOND, rods=6, keys=None, growth=None
):
    """A run of the chain that starts straight at the angle and speed of `state`, and of `out` to the
    normal of the orbit. growth: an exponential law in place of the table."""
    (angle, speed), (up, rise), rate = state, out, rates[0]
    along = np.array([-np.cos(angle) * np.cos(up), np.sin(angle) * np.cos(up), np.sin(up)])
    inside = np.array([np.sin(angle) * np.cos(up), np.cos(angle) * np.cos(up), 0.0])
    normal = np.array([np.cos(angle) * np.sin(up), -np.sin(angle) * np.sin(up), np.cos(up)])
    change = growth**2 * start if growth else (rates[1] - rates[0]) / (times[1] - times[0])
    # Every rod has the stretch of what hangs from its middle.
    middle = (np.arange(rods) + 0.5) / rods * start
    first, pulled = moments(start)[0] - LINE * middle**2 / 2.0, TIP + LINE * (start - middle)
    newtons = first * tension(start, 0.0, angle, speed) / moments(start)[0] - pulled * change
    share = (1.0 + newtons / STIFFNESS)[:, None] / rods
    vector, moving = (
        start * share * along,
        share * (rate * along + start * (speed * inside + rise * normal)),
    )
    law = {"law": "exponential", "growth": growth}
    if growth is None:
        law = {"time": times.tolist(), "rate": rates.tolist()}
    end = float(times[-1] if end is None else end)
    scene = esail.Scene(
        chain=esail.Chain(
            rods=rods, mass=LINE * whole / rods, length=whole / rods, area=STIFFNESS / MODULUS,
            youngs_modulus=MODULUS, tip_mass=TIP, anchor="fixed", axial_damping_time=DAMPING,
            slack_strain=SLACK,
        ),
        deployment=esail.ChainDeployment(start_length=start, **law),
        initial=esail.ChainInitial(rod_vector=vector.tolist(), rod_rate=moving.tolist()),
        orbit=esail.Orbit(mean_motion=W),
        integrator=esail.Integrator(t_end=end, method="dopri8", tolerance=1e-9),
        output=esail.Output(interval=10.0),
    )  # fmt: skip
    begin = clock.perf_counter()
    run = esail.simulate(scene, keys or {})
    print(
        f"  {run.stats['steps']:.0f} steps, {clock.perf_counter() - begin:.0f} s",
        run.stats["message"] or "",
    )
    return Flight(run)


class Flight:
    """What is read from a run: angles are those of the chord."""

    def __init__(self, run):
        tip = np.asarray(run["joint_position"])[:, -1]
        self.time, self.length = np.asarray(run.time), np.asarray(run["deployed_length"]).ravel()
        self.rate = np.asarray(run["payout_rate"]).ravel()
        self.tension = np.asarray(run["tension"])[:, 0]
        self.power = self.tension * self.rate
        self.angle = np.rad2deg(np.arctan2(tip[:, 1], -tip[:, 0]))
        self.out = np.rad2deg(np.arcsin(tip[:, 2] / np.linalg.norm(tip, axis=1)))
        bow = np.asarray(run["joint_position"])[:, 1:-1]
        chord = tip / np.linalg.norm(tip, axis=1)[:, None]
        off = bow - np.einsum("tki,ti->tk", bow, chord)[..., None] * chord[:, None]
        self.bow = np.linalg.norm(off, axis=2).max(1) / self.length
        self.work = float(np.asarray(run["winch_work"]).ravel()[-1])
        loose = np.flatnonzero(self.tension < LOOSE)
        self.taut = slice(None, loose[0] if len(loose) else None)
        self.error = float(np.abs(np.asarray(run["energy_balance_error"])).max() / np.abs(self.work))


def shown(row):
    """Prints a row."""
    print({k: x if isinstance(x, str) else float(f"{x:.4g}") for k, x in row.items()}, flush=True)


# ---- the two stages ----------------------------------------------------------------------------------


def stage_row(name, flight, part):
    """Row of one stage. part: first and last instant [s]."""
    now = (flight.time >= part[0]) & (flight.time <= part[1])
    angle, length = flight.angle[now], flight.length[now]
    vertical = np.flatnonzero((angle[:-1] > 0.0) & (angle[1:] <= 0.0) & (length[1:] > 0.9 * SECOND))
    released = [x[now][vertical[0] + 1] if len(vertical) else np.nan
                for x in (flight.time, flight.length, flight.tension)]  # fmt: skip
    return {
        "case": name, "from [s]": part[0], "to [s]": part[1],
        "length at the end [m]": flight.length[now][-1], "largest rate [m/s]": flight.rate[now].max(),
        "least angle [deg]": flight.angle[now].min(), "largest angle [deg]": flight.angle[now].max(),
        "angle at the end [deg]": flight.angle[now][-1],
        "least tension [N]": flight.tension[now].min(), "largest tension [N]": flight.tension[now].max(),
        "largest power of the brake [W]": flight.power[now].max(),
        "energy taken up by the brake [J]": np.trapezoid(flight.power[now], flight.time[now]),
        "bow over length": flight.bow[now].max(),
        "back at the vertical after [s]": released[0], "length there [m]": released[1],
        "tension there [N]": released[2],
        "slack after [s]": flight.time[flight.taut][-1] if flight.taut.stop else np.nan,
    }  # fmt: skip


def two_stages(rows):
    """Flies both tables of stage 1, each with the same stage 2."""
    good, straight, second = stages()
    flights = {}
    ends = np.cumsum([0.0, STAGE_1, HOLD, STAGE_2, BACK])
    for name, first in (("good profile", good), ("straight brake", straight)):
        times, rates = joined(first, PAUSE, second)
        # The tether of the second flight becomes slack soon after the pause.
        last = ends[-1] if name == "good profile" else ends[2] + 600.0
        flight = flown(times, rates, START, ejected(), end=last)
        flights[name] = flight
        for k, stage in enumerate(("stage 1", "pause", "stage 2", "swing back")):
            if ends[k] < last:
                rows.append(stage_row(f"{name}: {stage}", flight, (ends[k], min(ends[k + 1], last))))
                shown(rows[-1])
        half = times.searchsorted(ends[1] + HOLD)
        model = swing(fine(times[: half + 1], rates[: half + 1]), START, *ejected())
        print(
            f"  model: largest angle {np.rad2deg(model[1]).max():.2f} deg; energy error {flight.error:.1e}"
        )
    return flights, ends


# ---- retrieval ---------------------------------------------------------------------------------------


def steady(k, length):
    """Angle at which a tether rests that grows as exp(k W t)."""
    first, second = moments(length)
    return 0.5 * np.arcsin(4.0 / 3.0 * k * length * first / second)


def exponent(time, signal, guess):
    """Growth a and frequency b [1/s] of signal = exp(a t) (A cos b t + B sin b t) + C."""

    def parts(x):
        grow = np.exp(x[0] * W * time)
        return np.stack(
            [grow * np.cos(x[1] * W * time), grow * np.sin(x[1] * W * time), np.ones_like(time)], 1
        )

    def missing(x):
        matrix = parts(x)
        return (matrix @ np.linalg.lstsq(matrix, signal, rcond=None)[0] - signal) / np.abs(signal).max()

    return least_squares(missing, guess).x


def held(k, gain, angle, longest=40000.0):
    """Table of a retrieval with l'/l = k W - gain theta', computed with the model, from `angle`."""
    long, short = RETRIEVED
    length, speed, rates = long, 0.0, []

    def slope(x):
        length, angle, speed = x
        rate = length * (k * W - gain * speed)
        return np.array([rate, speed, turning(length, rate, angle, speed)])

    x, h = np.array([length, angle, speed]), 2.0 * HALF
    track = [x]
    while x[0] > short and len(track) * h < longest:
        a = slope(x)
        b = slope(x + 0.5 * h * a)
        c = slope(x + 0.5 * h * b)
        x = x + h * (a + 2.0 * b + 2.0 * c + slope(x + h * c)) / 6.0
        track.append(x)
    track = np.array(track)
    rates = track[:, 0] * (k * W - gain * track[:, 2])
    times = h * np.arange(len(rates))
    few = slice(None, None, round(KNOT / h))
    return times[few], rates[few], track[few]


def retrievals(rows):
    """Exponential ones with a small and a large swing, and the law with a term against the swing."""
    flights = {}
    long, short = RETRIEVED
    for k in (-0.2, -0.4):
        rest = steady(k, long)
        duration = np.log(long / short) / (-k * W)
        small = np.deg2rad(0.5)
        common = {"end": duration, "whole": long, "growth": k * W}
        kick = np.array([k * W * long])
        flight = flown(None, kick, long, (rest + small, 0.0), (small, 0.0), **common)
        flights[k, "small"] = flight
        swinging = np.sqrt(3.0 * np.cos(2.0 * rest) - k**2), np.sqrt(1.0 + 3.0 * np.cos(rest) ** 2 - k**2)
        inside = exponent(flight.time, flight.angle - np.rad2deg(rest), [-k, swinging[0]])
        normal = exponent(flight.time, flight.out, [-k, swinging[1]])
        rows.append({
            "case": f"exponential, k = {k:g}", "duration [h]": duration / 3600.0,
            "rest, formula [deg]": np.rad2deg(rest),
            "growth in the plane / (|k| W)": -inside[0] / k,
            "growth out of the plane / (|k| W)": -normal[0] / k,
            "frequency in the plane / W": inside[1], "formula in the plane": swinging[0],
            "frequency out of the plane / W": normal[1], "formula out of the plane": swinging[1],
        })  # fmt: skip
        shown(rows[-1])
    return flights


def swung(rows):
    """Retrievals from a swing of three degrees: exponential, and held."""
    flights, long, off = {}, RETRIEVED[0], np.deg2rad(3.0)
    for k in (-0.2, -0.4):
        rest = steady(k, long)
        start = rest + off, 0.0
        duration = np.log(long / RETRIEVED[1]) / (-k * W)
        kick = np.array([k * W * long])
        out = np.deg2rad(0.5), 0.0
        cases = {"exponential": flown(None, kick, long, start, out, end=duration, whole=long, growth=k * W)}
        times, rates, _ = held(k, GAIN - k, start[0])
        cases["held"] = flown(times, rates, long, start, out, whole=long)
        wrong = start[0] + np.deg2rad(1.0), 0.0
        cases["held, 1 deg wrong"] = flown(times, rates, long, wrong, out, whole=long)
        for name, flight in cases.items():
            flights[k, name] = flight
            last = flight.time > flight.time[-1] - 3200.0
            rows.append({
                "case": f"{name}, k = {k:g}", "duration [h]": flight.time[-1] / 3600.0,
                "length at the end [m]": flight.length[-1],
                "largest distance from rest, last period [deg]":
                    np.abs(flight.angle[last] - np.rad2deg(rest)).max(),
                "out of the plane, last period [deg]": np.abs(flight.out[last]).max(),
                "fastest [m/s]": flight.rate.min(), "slowest [m/s]": flight.rate.max(),
                "least tension [N]": flight.tension.min(), "largest tension [N]": flight.tension.max(),
                "bow over length": flight.bow[last].max(), "energy error": flight.error,
            })  # fmt: skip
            shown(rows[-1])
    return flights


def picture(two, ends, small, large):
    """Draws the two stages, and the retrievals."""
    figure, axes = panels(2, 3, (11.0, 6.6))
    for (name, flight), style in zip(two.items(), ("-", "--"), strict=True):
        taut = flight.taut
        hours = flight.time[taut] / 3600.0
        rate, power = flight.rate[taut], np.where(flight.rate > 1e-2, flight.power, np.nan)[taut]
        axes[0, 0].plot(hours, 1e-3 * flight.length[taut], style, color="C0", label=f"length [km], {name}")
        axes[0, 0].plot(hours, rate, style, color="C1", label=f"rate [m/s], {name}")
        axes[0, 1].plot(hours, flight.angle[taut], style, color="C0", label=name)
        axes[0, 2].semilogy(hours, flight.tension[taut], style, color="C0", label=f"tension [N], {name}")
        axes[0, 2].semilogy(hours, power, style, color="C1", label=f"power of the brake [W], {name}")
        if taut.stop:
            axes[0, 1].plot(hours[-1], flight.angle[taut][-1], "kx", label="slack")
            axes[0, 2].plot(hours[-1], flight.tension[taut][-1], "kx")
    axes[0, 2].set_ylim(1e-3, 1e3)
    axes[0, 1].set_ylim(None, 95.0)
    for axis in axes[0]:
        axis.set_xlabel("time [h]")
        for end in ends[1:-1]:
            axis.axvline(end / 3600.0, color="0.7", lw=0.8, ls=":")
    for axis, label in zip(
        axes[0], ("length, rate", "angle from the vertical [deg]", "tension, power"), strict=True
    ):
        axis.set_ylabel(label)
        axis.legend(frameon=False, fontsize=7)
    for k, color in ((-0.2, "C0"), (-0.4, "C1")):
        flight = small[k, "small"]
        rest = np.rad2deg(steady(k, RETRIEVED[0]))
        hours, grown = flight.time / 3600.0, 0.5 * np.exp(-k * W * flight.time)
        axes[1, 0].plot(hours, flight.angle - rest, color=color, label=f"in plane, k = {k:g}")
        axes[1, 0].plot(hours, flight.out, ":", color=color, label=f"normal to it, k = {k:g}")
        for sign in (-1.0, 1.0):
            axes[1, 0].plot(hours, sign * grown, color="0.6", lw=0.8, ls="--")
        for name, style in (("exponential", "--"), ("held", "-")):
            flight = large[k, name]
            hours = flight.time / 3600.0
            axes[1, 1].plot(hours, flight.angle, style, color=color, label=f"{name}, k = {k:g}")
            axes[1, 2].plot(hours, flight.rate, style, color=color)
    labels = "distance from the rest [deg]", "angle from the vertical [deg]", "rate [m/s]"
    for axis, label in zip(axes[1], labels, strict=True):
        axis.set_ylabel(label)
        axis.set_xlabel("time [h]")
    axes[1, 0].set_ylim(None, 11.0)
    axes[1, 0].legend(frameon=False, fontsize=7, loc="upper left")
    for axis, title in zip(
        axes[1], ("small swing; grey: exp(|k| W t)", "from 3 deg", "from 3 deg"), strict=True
    ):
        axis.set_title(f"retrieval, {title}", fontsize=9)
    axes[1, 1].legend(frameon=False, fontsize=7)
    figure.savefig(HERE / "orbit.png", dpi=80)


def main():
    rows, more, last = [], [], []
    two, ends = two_stages(rows)
    small = retrievals(more)
    large = swung(last)
    for row in last:
        row["case"] += ", from 3 deg"
    keys = list(dict.fromkeys(key for row in (*rows, *more, *last) for key in row))
    written("orbit.csv", [{key: row.get(key, "") for key in keys} for row in (*rows, *more, *last)])
    picture(two, ends, small, large)


if __name__ == "__main__":
    main()
