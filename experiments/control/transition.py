"""The spin plane turned from a sailing angle of 10 to 25 deg: a plan made for a rigid sail, and one made by
gradient on the flexible sail, both tracked by the steering law.

A plan is a table of the sailing angle, linear between eleven instants two turns apart. The plan of a rigid
sail is a ramp over twelve turns. The other one is optimised with bounds on the lagging angle, the
power and the distance of tethers (augmented Lagrangian, Adam).

    python experiments/control/transition.py

writes transition.csv, plan.csv and transition.png.
"""

import time as clock
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from laws import Steering
from matplotlib.figure import Figure
from sail import TURN, miss, sail
from tables import write

import esail_jax as esail

HERE = Path(__file__).parent
TURNS, KNOTS = 20, 11
FROM, TO = np.deg2rad(10.0), np.deg2rad(25.0)
MOST_LAG, MOST_POWER, LEAST_DISTANCE = np.deg2rad(1.6), 9.0, 10e3
"""Bounds: lagging angle [rad], electric power [W] of four tethers of four wires of 25 um, and distance of
remote units to other tethers [m]."""

WIRES = {"tethers.wire_radius": 12.5e-6, "tethers.wires": 4}
SAVED = [
    "heliocentric_position",
    "tip_position_I",
    "lagging_angle",
    "electric_power",
    "smallest_tether_distance",
]


class Tracking(eqx.Module):
    """The steering law whose aim follows a plan: sailing angles [rad] at instants two turns apart."""

    plan: jax.Array
    gains: tuple[float, float, float] = eqx.field(static=True, default=(5.0, 0.5, 0.3))
    period: float = eqx.field(static=True, default=60.0)

    def law(self, time):
        angle = jnp.interp(time, TURN * jnp.linspace(0.0, TURNS, KNOTS), self.plan)
        return Steering(*jnp.array(self.gains)).towards(angle)

    def init(self, measurements):
        return jnp.zeros(3)

    def update(self, measurements, memory):
        return self.law(measurements.time).update(measurements, memory)


def fly(plan):
    given = sail(TURNS * TURN, 10.0, 60.0) | WIRES
    return esail.simulate("baseline", given, voltage_law=Tracking(plan), save=SAVED)


def measures(plan):
    """Mean square of the miss in the last two turns [rad^2], the mean over the whole run, and by how much
    the bounds are exceeded, relative: the largest lagging angle, power, and contact of tethers."""
    run = fly(plan)
    off = miss(run, TO) ** 2
    late = jnp.asarray(run.time) > (TURNS - 2) * TURN
    lag = jnp.abs(run["lagging_angle"]).max() / MOST_LAG - 1.0
    power = run["electric_power"].max() / MOST_POWER - 1.0
    contact = 1.0 - run["smallest_tether_distance"].min() / LEAST_DISTANCE
    return (off * late).sum() / late.sum(), off.mean(), jnp.stack([lag, power, contact])


def plan_by_gradient(start, rounds=9, steps=15):
    """Minimises the mean square of the miss over the run under the bounds."""

    def lagrangian(plan, multipliers, weight):
        late, whole, excess = measures(plan)
        active = jnp.maximum(multipliers + weight * excess, 0.0)
        return 30.0 * late + whole + ((active**2 - multipliers**2) / (2.0 * weight)).sum(), excess

    of = esail.jit(jax.value_and_grad(lagrangian, has_aux=True))
    plan, multipliers, weight = jnp.asarray(start), jnp.zeros(3), 0.3
    seconds = []
    for number in range(rounds):
        optimiser = optax.adam(optax.cosine_decay_schedule(np.deg2rad(0.6) * 0.75**number, steps))
        state = optimiser.init(plan)
        for _ in range(steps):
            began = clock.perf_counter()
            (value, excess), slope = of(plan, multipliers, weight)
            jax.block_until_ready(slope)
            seconds.append(clock.perf_counter() - began)
            updates, state = optimiser.update(slope.at[0].set(0.0), state)
            plan = optax.apply_updates(plan, updates)
        (value, excess), _ = of(plan, multipliers, weight)
        multipliers = jnp.maximum(multipliers + weight * excess, 0.0)
        weight *= 2.0
        print(f"round {number}: {float(value):.3e}, bounds {np.asarray(excess)}", flush=True)
    return plan, float(np.median(seconds))


def main():
    turns = np.linspace(0.0, TURNS, KNOTS)
    plans = {
        "step": np.where(turns > 0, TO, FROM),
        "ramp of a rigid sail": np.clip(FROM + (TO - FROM) * turns / 12.0, FROM, TO),
    }
    plans["plan by gradient"], seconds = plan_by_gradient(plans["ramp of a rigid sail"])
    print(f"median of a gradient: {seconds:.2f} s")
    table, lines = [], {}
    for name, plan in plans.items():
        run = fly(jnp.asarray(plan))
        late, whole, _ = measures(jnp.asarray(plan))
        lag = float(np.rad2deg(np.abs(run["lagging_angle"]).max()))
        off = np.rad2deg(miss(run, TO))
        away = np.flatnonzero(off > 0.5)[-1]  # the last instant at which the aim is not reached
        reached = float(run.time[min(away + 1, len(off) - 1)] / TURN)
        rms = [float(np.rad2deg(np.sqrt(x))) for x in (late, whole)]
        table.append((name, *rms, reached, lag, float(run["electric_power"].max())))
        lines[name] = run.time / TURN, off, np.rad2deg(np.abs(run["lagging_angle"]).max(1))
        print(*table[-1], flush=True)
    header = ("plan", "rms miss, last two turns [deg]", "rms miss [deg]", "within 0.5 deg after [turns]",
              "largest lag [deg]", "largest power [W]")  # fmt: skip
    write("transition.csv", header, table)
    write("plan.csv", ("turn", *plans), [(float(t), *(float(np.rad2deg(p[i])) for p in plans.values()))
                                         for i, t in enumerate(turns)])  # fmt: skip
    figure = Figure(figsize=(7.0, 4.4), layout="constrained")
    top, bottom = figure.subplots(2, sharex=True)
    for name, (turn, off, lag) in lines.items():
        top.semilogy(turn, np.maximum(off, 1e-3), label=name, lw=1.0)
        bottom.plot(turn, lag, lw=1.0)
    bottom.axhline(np.rad2deg(MOST_LAG), color="0.6", ls=":")
    top.set(ylabel="angle to 25 deg [deg]")
    bottom.set(xlabel="turns", ylabel="largest lag [deg]", xlim=(0, TURNS))
    top.legend(fontsize=8)
    figure.savefig(HERE / "transition.png", dpi=150)


if __name__ == "__main__":
    main()
