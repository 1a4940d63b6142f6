"""Receding horizon: the transition from 10 to 25 deg is planned again once a turn, by the gradient of the
next three turns, from where the sail is. The planner knows the mean wind and the nominal lengths only.

    python experiments/control/replan.py

writes replan.csv and replan.png.
"""

import time as clock
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from laws import Steering, aim_of
from matplotlib.figure import Figure
from sail import CONSTANT, TURN, sail
from tables import write

import esail_jax as esail
from esail_jax.environment.gusts import gusty_wind

HERE = Path(__file__).parent
HORIZON, TURNS, STEPS = 3, 20, 6
TO = np.deg2rad(25.0)
WIND = jnp.array([0.5**0.5, 0.5**0.5, 0.0])
"""Direction of the wind: the sail stays at one place, so that a plan may begin at t = 0 again."""

SAVED = ["tip_position_I", "lagging_angle", "voltage"]
EFFORT, LAG = 1e-3, 1e-2
"""Weights of the mean squares of the relative change of voltage and of the lagging angle [rad]."""

PLACE = {"initial.heliocentric_position_au": [0.5**0.5, 0.5**0.5, 0.0]}


class Plan(eqx.Module):
    """The steering law with sailing angles [rad] as its aim, linear between instants one turn apart."""

    aims: jax.Array
    period: float = eqx.field(static=True, default=60.0)

    def init(self, measurements):
        return jnp.zeros(3)

    def update(self, measurements, memory):
        angle = jnp.interp(measurements.time, TURN * jnp.arange(HORIZON + 1.0), self.aims)
        return Steering(*jnp.array([5.0, 0.0, 0.3])).towards(angle).update(measurements, memory)


def fly(plan, turns, start, given):
    scene = sail(turns * TURN, 10.0, orbit=PLACE) | given
    times = [*np.arange(0.0, turns * TURN, 60.0).tolist(), turns * TURN]
    return esail.simulate("baseline", scene, voltage_law=plan, save=SAVED, start=start, times=times)


def miss(run):
    """Angle [rad] between the normal of the plane of the tips and the direction at 25 deg."""
    arms = run["tip_position_I"] - run["tip_position_I"].mean(1, keepdims=True)
    normal = jnp.cross(arms, jnp.roll(arms, -1, axis=1)).sum(1)
    normal = normal / jnp.linalg.norm(normal, axis=1)[:, None]
    return jnp.arcsin(jnp.linalg.norm(jnp.cross(normal, aim_of(WIND, TO)), axis=1))


@esail.jit
@jax.value_and_grad
def cost(aims, start):
    run = fly(Plan(aims), HORIZON, start._replace(time=np.zeros(())), {})
    change = run["voltage"] / 20e3 - 1.0
    lag = jnp.mean(run["lagging_angle"] ** 2)
    return jnp.mean(miss(run) ** 2) + EFFORT * jnp.mean(change**2) + LAG * lag


def planned(aims, start):
    """The aims after some steps of Adam from a warm start, and the seconds that they took."""
    began, optimiser = clock.perf_counter(), optax.adam(np.deg2rad(1.0))
    state, best = optimiser.init(aims), (np.inf, aims)
    for _ in range(STEPS):
        value, slope = cost(aims, start)
        if float(value) < best[0]:
            best = float(value), aims
        updates, state = optimiser.update(slope, state)
        aims = optax.apply_updates(aims, updates)
    return best[1], clock.perf_counter() - began


def gusts(wind, turn):
    """The wind of a turn as a series from t = 0, always with the same number of instants."""
    grid = np.linspace(0.0, 1620.0, 28)
    rows = {
        name: np.interp(turn * TURN + grid, wind["time"], wind[name])
        for name in ("speed", "number_density")
    }
    return {"solar_wind.time": grid} | {f"solar_wind.{name}": x for name, x in rows.items()}


def transition(replans, seed):
    """The turns of a transition, planned once a turn, or along a ramp of 1.25 deg a turn."""
    wind = gusty_wind(seed, (TURNS + 2) * TURN)
    lengths = {"tethers.length": 10e3 + 10.0 * np.random.default_rng(seed).standard_normal(4)}
    first = sail(HORIZON * TURN, 10.0, orbit=PLACE) | lengths
    point = esail.simulate("baseline", first | CONSTANT, times=[0.0], save=[]).final_state
    rows, aims = [], jnp.deg2rad(jnp.array([10.0, 12.0, 14.0, 16.0]))
    for turn in range(TURNS):
        seconds = 0.0
        if replans:
            aims, seconds = planned(aims, point)
        else:
            aims = jnp.deg2rad(jnp.clip(10.0 + 1.25 * (turn + jnp.arange(HORIZON + 1.0)), 10.0, 25.0))
        run = fly(Plan(aims), 1, point, lengths | gusts(wind, turn))
        off, lag = np.rad2deg(miss(run)), np.rad2deg(np.abs(run["lagging_angle"]).max())
        rows.append(
            (turn + 1, float(off[-1]), float(lag), float(np.abs(run["voltage"] / 20e3 - 1).max()), seconds)
        )
        point = run.final_state._replace(time=jnp.zeros(()))
        aims = jnp.append(aims[1:], aims[-1])
    return rows


def main():
    scene = sail(HORIZON * TURN, 10.0, orbit=PLACE) | CONSTANT
    begin = esail.simulate("baseline", scene, times=[0.0], save=[]).final_state
    cost(jnp.full(HORIZON + 1, TO), begin)  # compiles
    found = {"planned once a turn": transition(True, 3), "ramp": transition(False, 3)}
    for name, rows in found.items():
        reached = next((row[0] for i, row in enumerate(rows) if max(r[1] for r in rows[i:]) < 0.5), "never")
        print(
            name,
            "within 0.5 deg after",
            reached,
            "turns; last",
            rows[-1],
            "largest lag",
            max(r[2] for r in rows),
        )
    seconds = [row[4] for row in found["planned once a turn"]]
    print(
        f"seconds per plan: median {np.median(seconds):.2f}, largest {max(seconds):.2f}; "
        f"a turn has {TURN:.0f} s"
    )
    header = ("law", "turn", "miss [deg]", "largest lag [deg]", "voltage change", "seconds per plan")
    write("replan.csv", header, [(name, *row) for name, rows in found.items() for row in rows])
    figure = Figure(figsize=(7.0, 3.0), layout="constrained")
    axes = figure.subplots()
    for name, rows in found.items():
        axes.semilogy([r[0] for r in rows], [max(r[1], 1e-3) for r in rows], "o-", label=name, ms=3, lw=1.0)
    axes.set(xlabel="turns", ylabel="angle to 25 deg [deg]")
    axes.legend(fontsize=8)
    figure.savefig(HERE / "replan.png", dpi=150)


if __name__ == "__main__":
    main()
