"""The baseline paid out from 1 % of its length, and reeled in again.

python experiments/deployment/sail.py    # writes sail.csv, sail.png
"""

import numpy as np
from common import CALM, G0, HERE, ISP, Rigid, panels, schedule, simulated, table_keys, written

import esail_jax as esail
from esail_jax.loads.tip_thrust import Switching, TipThrust

GOAL = 4e-3
SHORT, LONG = 100.0, 10e3
FORCE = 10e-3
"""Of nitrogen, on every remote unit [N]."""

COUNT = 1000
"""Saved intervals of a run."""


def gas(rigid, spin, start, end, force=FORCE, rise=600.0, after=0.0, terms=None):
    """Run with the force on every tip under which a rigid sail follows the law `spin(length)`; its
    duration [s] and its impulse [N s] on a unit. terms: more terms, as a function of the end of payout."""
    change = 1e-4

    def speed(length):
        near = [rigid.inertia(x) * spin(x) for x in (length - change, length + change)]
        slope = (near[1] - near[0]) / (2.0 * change)
        return np.sign(end - start) * rigid.count * force * (rigid.radius + length) / slope

    times, rates, off = schedule(speed, start, end, rise)
    sign = np.sign(end - start)
    thrust = {"force": sign * force, "on": 0.0, "off": float(off), "rise_time": rise}
    changes = CALM | {f"tip_thrust.{key}": float(x) for key, x in thrust.items()}
    changes |= table_keys(times, rates, start) | {"initial.spin_rate": spin(start), "tethers.elements": 3}
    run = simulated(changes, times[-1] + after, COUNT, terms(times[-1]) if terms else ())
    return run, times[-1], force * off


def hub_alone(rigid, spin, end, rate, rise, start=SHORT):
    """Run without a torque: the rate rises to `rate` and falls again."""
    times, rates, _ = schedule(lambda length: rate, start, end, rise)
    changes = CALM | table_keys(times, rates, start)
    changes |= {"initial.spin_rate": spin, "tethers.elements": 3}
    return simulated(changes, times[-1], COUNT), times[-1], 0.0


def line(name, run, duration, impulse):
    """A row of the table."""
    lag = np.rad2deg(np.abs(np.asarray(run["lagging_angle"])))
    spin = np.asarray(run["spin_rate"])[:, 1]
    length = np.asarray(run["deployed_length"])[:, 0]
    momentum = np.einsum("ti,ti->t", run["angular_momentum_I"], np.asarray(run["rotation_IB"])[:, :, 0])
    return {
        "case": name,
        "from [m]": length[0], "to [m]": length[-1],
        "spin at the start [mrad/s]": 1e3 * spin[0], "spin at the end [mrad/s]": 1e3 * spin[-1],
        "change of angular momentum [N m s]": momentum[-1] - momentum[0],
        "impulse per unit [N s]": impulse, "gas per unit [g]": 1e3 * impulse / (ISP * G0),
        "duration [h]": duration / 3600.0,
        "largest lag [deg]": lag.max(), "largest tension [N]": np.asarray(run["winch_tension"]).max(),
        "least tension [N]": np.asarray(run["winch_tension"]).min(),
        "work of the winches [J]": float(run["winch_work"][-1]),
        "steps": float(run.stats["steps"]),
        "message": run.stats["message"] or "none",
    }  # fmt: skip


def second_pulse(rigid, slow):
    """Force that spins the whole sail up to the goal after the payout, and its impulse [N s]."""
    rise = 600.0
    impulse = rigid.inertia(LONG) * (GOAL - slow) / (rigid.count * (rigid.radius + LONG))

    def terms(end):
        on = np.full(rigid.count, end)
        switching = Switching(on, on + impulse / FORCE, np.asarray(rise))
        return [TipThrust(np.full(rigid.count, FORCE), switching, "tangential")]

    return terms, impulse, impulse / FORCE + rise


def main():
    rigid = Rigid(esail.load_scene("baseline"))
    allowed = rigid.tension(LONG, GOAL)
    taut = np.sqrt(allowed / rigid.tension(SHORT, 1.0))
    needed = rigid.inertia(LONG) * GOAL
    print(f"needed {needed:.4g} N m s; hub {rigid.hub:.4g} kg m^2, alone at {needed / rigid.hub:.4g} rad/s")
    print(f"at 1 %, {taut:.4g} rad/s gives the final tension, and {taut * rigid.inertia(SHORT):.4g} N m s")
    cases = {
        "gas, constant spin": lambda: gas(rigid, lambda x: GOAL, SHORT, LONG, rise=3000.0),
        "gas, constant tension": lambda: gas(
            rigid, lambda x: np.sqrt(allowed / rigid.tension(x, 1.0)), SHORT, LONG
        ),
        "gas, slow payout, then spin-up": lambda: slow_then_up(rigid, 1e-3),
        "hub alone, 0.24 m/s": lambda: hub_alone(rigid, taut, LONG, 0.24, 1000.0),
        "hub alone, 0.06 m/s": lambda: hub_alone(rigid, taut, LONG, 0.06, 2000.0),
        "hub alone, 0.7 m/s": lambda: hub_alone(rigid, taut, LONG, 0.7, 1000.0),
        "hub alone, 2 m/s": lambda: hub_alone(rigid, taut, LONG, 2.0, 300.0),
        "retrieval, gas, constant spin": lambda: gas(rigid, lambda x: GOAL, LONG, SHORT, rise=3000.0),
        "retrieval, no gas": lambda: hub_alone(rigid, GOAL, 0.8 * LONG, 0.5, 1200.0, LONG),
    }
    runs, rows = {}, []
    for name, case in cases.items():
        print(name, flush=True)
        run, duration, impulse = case()
        runs[name] = run
        rows.append(line(name, run, duration, impulse))
        print(rows[-1], flush=True)
    written("sail.csv", rows)
    picture(runs)


def slow_then_up(rigid, slow):
    """Payout at a slow spin, then spin-up of the whole sail."""
    terms, second, after = second_pulse(rigid, slow)
    run, duration, first = gas(rigid, lambda x: slow, SHORT, LONG, 1.5e-3, 10000.0, after, terms)
    return run, duration + after, first + second


def picture(runs):
    """Draws length, spin, tension and lag."""
    figure, axes = panels(2, 2, (10.0, 6.5))
    axes = axes.ravel()
    for name, run in runs.items():
        hours = np.asarray(run.time) / 3600.0
        style = "--" if name.startswith("retrieval") else "-"
        lag = np.rad2deg(np.abs(np.asarray(run["lagging_angle"])[:, 0]))
        axes[0].plot(hours, 1e-3 * run["deployed_length"][:, 0], style, label=name)
        axes[1].semilogy(hours, 1e3 * run["spin_rate"][:, 1], style)
        axes[2].semilogy(hours, run["winch_tension"][:, 0], style, lw=0.8)
        # The largest lag of every twentieth of a run: the swing is faster than lines can show.
        parts = np.array_split(np.arange(len(hours)), 20)
        axes[3].semilogy([hours[p].mean() for p in parts], [lag[p].max() for p in parts], style)
    labels = "deployed length [km]", "spin of the sail [mrad/s]", "tension at the guide [N]"
    for axis, label in zip(axes, (*labels, "largest lag of a twentieth [deg]"), strict=True):
        axis.set_ylabel(label)
        axis.set_xscale("log")
        axis.set_xlim(0.1, None)
    for axis in axes[2:]:
        axis.set_xlabel("time [h]")
    figure.legend(
        *axes[0].get_legend_handles_labels(), frameon=False, fontsize=8, ncols=4, loc="outside upper center"
    )
    figure.savefig(HERE / "sail.png", dpi=90)


if __name__ == "__main__":
    main()
