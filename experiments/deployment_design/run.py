"""The shortest deployment within limits, by gradients, and what unequal reels make of it.

python experiments/deployment_design/run.py    # writes results.csv, schedules.csv, deployment.png
"""

import csv
import time
from pathlib import Path

import numpy as np
import search
from matplotlib.figure import Figure
from sail import COUNT, KNOTS, LIMITS, REFERENCE, simulate, violations

HERE = Path(__file__).parent
EQUAL = np.ones((1, COUNT))
MEMBERS = 4
FINE = {
    "tethers.elements": 4,
    "integrator.tolerance": 1e-10,
    "integrator.t_end": 1.25 * REFERENCE,
    "output.interval": REFERENCE / 1024,
}
"""A finer mesh, smaller errors and sixteen times as many instants; the run goes on for a quarter of the
duration after the deployment."""


def reels(seed):
    """Factors of the rates, (member, tether): errors of 2 % that slow a reel down, as friction does, and a
    first reel that is slower by up to 10 %."""
    rng = np.random.default_rng(seed)
    scales = 1.0 - 0.02 * np.abs(rng.normal(size=(MEMBERS, COUNT)))
    scales[:, 0] -= rng.uniform(0.0, 0.1, MEMBERS)
    return scales


def checked(schedule):
    """The largest violation of every limit on the finer mesh, the largest lag after the end, and the
    signals."""
    signals = {name: np.asarray(x) for name, x in simulate(schedule, more=FINE).items()}
    count = int(np.sum(signals["time"] <= float(schedule.duration) * (1.0 + 1e-9)))
    during = {name: x[:count] for name, x in signals.items()}
    worst = {name: float(np.max(x)) for name, x in violations(during).items()}
    return worst, np.rad2deg(np.abs(signals["lagging_angle"][count:]).max()), signals


def row(name, schedule, worst, **more):
    over = max(worst, key=worst.get)
    return {
        "schedule": name, "duration [s]": f"{float(schedule.duration):.0f}",
        "largest violation [%]": f"{100.0 * worst[over]:.1f}", "of": over,
        "limits violated by more than 1 %": ", ".join(n for n, x in worst.items() if x > 0.01) or "none",
    } | more  # fmt: skip


def main():
    rows, drawn, began = [], {}, time.time()
    schedules = {}
    for name in ("constant rate", "constant tension"):
        kind = getattr(search, name.replace(" ", "_"))
        z, runs = search.scan(kind, EQUAL)
        print(f"{name}: {float(kind(z).duration):.0f} s after {runs} runs of a scan", flush=True)
        z = search.search(kind, z, EQUAL, rounds=4, iterations=10)
        schedules[name] = kind(z)
        print(f"{time.time() - began:.0f} s", flush=True)
    z = search.freed(schedules["constant tension"])
    z = search.search(search.free, z, EQUAL, rounds=5, iterations=25)
    schedules["free"] = search.free(z)
    print(f"{time.time() - began:.0f} s", flush=True)
    for name, schedule in schedules.items():
        worst, after, drawn[name] = checked(schedule)
        rows.append(row(name, schedule, worst, reels="equal, finer mesh", swing=f"{after:.1f}"))
        for label, seed in (("unequal", 0), ("unequal, others", 1)):
            worst = search.largest(search.exceeded_by(schedule, reels(seed)))
            rows.append(row(name, schedule, worst, reels=label, swing=""))
        for x in rows[-3:]:
            print(x, flush=True)
    print(f"{(time.time() - began) / 60.0:.0f} minutes")
    write(rows, schedules)
    draw(drawn, schedules).savefig(HERE / "deployment.png", dpi=70)


def write(rows, schedules):
    with (HERE / "results.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    with (HERE / "schedules.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["schedule", "time [s]", "rate [m/s]", "force [mN]"])
        for name, schedule in schedules.items():
            for x in zip(KNOTS / REFERENCE, schedule.rates, schedule.forces, strict=True):
                share, rate, force = (float(y) for y in x)
                numbers = (share * float(schedule.duration), rate, 1e3 * force)
                table.writerow([name, *(f"{y:.6g}" for y in numbers)])


def draw(drawn, schedules):
    """Rates, thrust, tension and lag of the best schedule of every kind."""
    figure = Figure((11.0, 6.0), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True).ravel()
    for name, schedule in schedules.items():
        signals = drawn[name]
        instants = KNOTS / REFERENCE * float(schedule.duration)
        panels[0].plot(instants, schedule.rates, label=name)
        panels[1].plot(instants, 1e3 * np.asarray(schedule.forces))
        panels[2].plot(signals["time"], signals["winch_tension"][:, 0], linewidth=0.8)
        panels[3].plot(signals["time"], np.rad2deg(signals["lagging_angle"][:, 0]), linewidth=0.8)
    lag = np.rad2deg(LIMITS["lag"])
    for panel, levels in (
        (panels[2], (LIMITS["slack"], LIMITS["tension"])), (panels[3], (-lag, lag)),
    ):  # fmt: skip
        for level in levels:
            panel.axhline(level, color="grey", linestyle=":", linewidth=1.0)
    labels = (
        "payout [m/s]",
        "thrust of a remote unit [mN]",
        "tension at the guide [N]",
        "lagging angle [deg]",
    )
    for panel, label in zip(panels, labels, strict=True):
        panel.set_ylabel(label)
    for panel in panels[2:]:
        panel.set_xlabel("time [s]")
    panels[0].legend()
    return figure


if __name__ == "__main__":
    main()
