"""One of twelve reels stops at 40 % of the length, while cold gas keeps the spin of the baseline.

python experiments/deployment/stuck.py    # writes stuck.csv, stuck.png
"""

import jax
import jax.numpy as jnp
import numpy as np
from common import CALM, HERE, Rigid, panels, schedule, simulated, written

import esail_jax as esail
from esail_jax.array_types import Array
from esail_jax.physics import TipLoad

SPIN, FORCE = 4e-3, 10e-3
START, STUCK, FULL = 2e3, 4e3, 10e3
STOP = 120.0
"""Time within which a reel stops [s]."""

REACTION = 600.0
"""Time after which other reels react [s]."""

TURNS, VOLTS = 3, 20e3
"""Turns of the sail with the voltage on, and the voltage [V]."""


class Gas(TipLoad):
    """A force on every tip normal to its chord, in the spin plane, of a table (instant, tether)."""

    time: Array
    size: Array

    def force(self, measurements):
        axis, chords = measurements.spin_axis, measurements.chords
        flat = chords - axis[:, None] * (axis @ chords)
        along = jnp.cross(axis[:, None], flat / jnp.linalg.norm(flat, axis=0), axis=0)
        now = jax.vmap(lambda size: jnp.interp(measurements.time, self.time, size), 1)(self.size)
        return now * along


class Plan:
    """The payout that was planned: rates of all tethers at instants, and the instant at which one stops."""

    def __init__(self, rigid):
        self.rigid = rigid
        self.times, rates, _ = schedule(self.speed, START, FULL, 1500.0)
        self.end = self.times[-1]
        self.fine = np.unique([*np.linspace(0.0, self.end, 401), *self.times])
        self.rates = np.interp(self.fine, self.times, rates)
        self.at = float(np.interp(STUCK, self.lengths(self.fine, self.rates), self.fine))

    def slope(self, length):
        """dI/dl of a tether over its arm."""
        r, line = self.rigid.radius, self.rigid.line
        end = r + length
        return 2.0 * self.rigid.tip + line * (end**2 - r**2) / end

    def speed(self, length):
        """Rate [m/s] at which the force keeps the spin."""
        return FORCE / (SPIN * self.slope(length))

    @staticmethod
    def lengths(times, rates):
        """Lengths of a table of one tether."""
        steps = 0.5 * (rates[1:] + rates[:-1]) * np.diff(times)
        return START + np.concatenate([[0.0], np.cumsum(steps)])

    def stop(self, instant):
        """Rates of a tether that stops."""
        return self.rates * np.clip(1.0 - (self.fine - instant) / STOP, 0.0, 1.0)

    def back(self, instant, length):
        """Rates of a tether that stops and is reeled back to a length, within half an hour."""
        rates = self.stop(instant)
        begin, duration = instant + STOP, 1800.0
        x = np.clip((self.fine - begin) / duration, 0.0, 1.0)
        shape = x**2 * (1.0 - x) ** 2
        excess = self.lengths(self.fine, rates)[-1] - length
        return rates - shape * excess / np.trapezoid(shape, self.fine)

    def gas(self, rates):
        """Force [N] that keeps the spin of a tether of these rates."""
        return SPIN * rates * self.slope(self.lengths(self.fine, rates))


TETHER, OPPOSITE = 0, 6


def tables(plan, name):
    """Rates and forces (instant, tether) of a case."""
    count = plan.rigid.count
    stuck = plan.stop(plan.at)
    length = plan.lengths(plan.fine, stuck)[-1]
    rates = plan.rates[:, None].repeat(count, 1)
    if not name.startswith("none stuck"):
        rates[:, TETHER] = stuck
    if name.startswith("opposite"):
        rates[:, OPPOSITE] = plan.back(plan.at + REACTION, length)
    if name.startswith("all"):
        for i in set(range(count)) - {TETHER}:
            rates[:, i] = plan.back(plan.at + REACTION, length)
    forces = np.stack([plan.gas(rate) for rate in rates.T], axis=1)
    if name == "stuck, its gas goes on":
        forces[:, TETHER] = plan.gas(plan.rates)
    return rates, forces


def volts(plan, name, thrust_from=1e3):
    """Voltage of every tether: raised or lowered, in proportion to the voltage above the cutoff."""
    values = np.full(plan.rigid.count, VOLTS)
    rates, _ = tables(plan, name)
    short = plan.lengths(plan.fine, rates[:, TETHER])[-1] / FULL
    if "no voltage" in name:
        return 0.0 * values
    if "its voltage raised" in name:
        values[TETHER] = thrust_from + (VOLTS - thrust_from) / short
    if "opposite voltage lowered" in name:
        values[OPPOSITE] = thrust_from + (VOLTS - thrust_from) * short
    return values


def run_of(plan, name, count=1200):
    """The payout, and some turns with the voltage on."""
    rates, forces = tables(plan, name)
    on = plan.end + 300.0
    wind = esail.load_scene("baseline").solar_wind
    changes = {k: x for k, x in CALM.items() if not k.startswith(("solar_wind", "voltage"))}
    changes |= {
        "solar_wind.speed": wind.speed, "initial.sailing_angle_deg": 10.0, "initial.spin_rate": SPIN,
        "initial.coning_angle_deg": 0.0, "tethers.elements": 3,
        "voltage.law": "on-off", "voltage.value": volts(plan, name).tolist(), "voltage.on": on,
        "voltage.rise_time": 600.0, "deployment.start_length": START,
        "deployment.time": plan.fine.tolist(), "deployment.rate": rates.tolist(),
    }  # fmt: skip
    end = on + 600.0 + TURNS * 2.0 * np.pi / SPIN
    if name == "stuck, its gas goes on":
        end = plan.at + 1800.0
    if "40 h" in name:
        end = 40.0 * 3600.0
    gas = Gas(jnp.asarray(plan.fine), jnp.asarray(forces))
    run = simulated(changes, end, count, [gas])
    return run, 1e3 * np.trapezoid(np.abs(forces), plan.fine, axis=0).max() / (60.0 * 9.80665)


def motion(run, rigid, hub_mass):
    """Of every instant: gaps between neighbours about the spin axis [deg], distance of the hub from the
    centre of mass [m], angle of the hub's axis to the angular momentum [deg], and angle of the latter to
    its start [deg]."""
    hub, tips = np.asarray(run["hub_position_I"]), np.asarray(run["tip_position_I"])
    length = np.asarray(run["deployed_length"])
    rotation, momentum = np.asarray(run["rotation_IB"]), np.asarray(run["angular_momentum_I"])
    axis = momentum / np.linalg.norm(momentum, axis=1)[:, None]
    out = tips - hub[:, None]
    line = rigid.line * length
    moments = ((rigid.tip + 0.5 * line)[..., None] * out).sum(1)
    offset = moments / (hub_mass + rigid.count * (rigid.tip + rigid.line * rigid.length))
    y = np.cross(axis, [0.0, 0.0, 1.0])
    y /= np.linalg.norm(y, axis=1)[:, None]
    z = np.cross(axis, y)
    about = out - offset[:, None]
    angles = np.unwrap(
        np.arctan2(np.einsum("tki,ti->tk", about, z), np.einsum("tki,ti->tk", about, y)), axis=0
    )
    gaps = np.diff(np.concatenate([angles, angles[:, :1] + 2.0 * np.pi], axis=1), axis=1)
    gaps += np.round((2.0 * np.pi / rigid.count - gaps[0]) / (2.0 * np.pi)) * 2.0 * np.pi
    wobble = np.arccos(np.clip((rotation[:, :, 0] * axis).sum(1), -1.0, 1.0))
    turned = np.arccos(np.clip(axis @ axis[0], -1.0, 1.0))
    return np.rad2deg(gaps), np.linalg.norm(offset, axis=1), np.rad2deg(wobble), np.rad2deg(turned)


CASES = (
    "none stuck", "stuck, its gas goes on", "stuck, its gas stops", "opposite reeled back to it",
    "all reeled back to it", "stuck, its voltage raised", "stuck, opposite voltage lowered",
    "none stuck, 40 h", "stuck, its gas stops, no voltage, 40 h", "stuck, its gas stops, 40 h",
    "opposite reeled back to it, 40 h",
)  # fmt: skip


def main():
    scene = esail.load_scene("baseline")
    rigid, hub = Rigid(scene), scene.hub
    mass = np.pi * hub.radius**2 * hub.height * hub.density
    plan = Plan(rigid)
    print(f"stops at {plan.at:.0f} s of {plan.end:.0f} s, hub of {mass:.0f} kg")
    rows, runs = [], {}
    for name in CASES:
        run, grams = run_of(plan, name)
        gaps, offset, wobble, turned = motion(run, rigid, mass)
        runs[name] = run, gaps, offset, wobble, turned
        time, angle = np.asarray(run.time), lambda key, run=run: np.rad2deg(np.asarray(run[key]))
        crossed = time[(gaps < 0.0).any(1)]
        calm, late = time <= plan.end + 300.0, time > plan.end + 900.0
        sailing = bool(late.any())

        def most(signal, late=late, sailing=sailing):
            return signal[late].max() if sailing else np.nan

        rows.append({
            "case": name,
            "spin of the sail before the voltage [mrad/s]": 1e3 * run["spin_rate"][calm][-1, 1],
            "gas of a unit [g]": grams,
            "least gap without voltage [deg]": gaps[calm].min(),
            "neighbours in line after [min]": (crossed[0] - plan.at) / 60.0 if len(crossed) else np.nan,
            "hub from centre of mass [m]": offset[calm][-1],
            "largest lag without voltage [deg]": np.abs(angle("lagging_angle")[calm]).max(),
            "largest tension [N]": np.asarray(run["winch_tension"]).max(),
            "wobble without voltage [deg]": wobble[calm].max(),
            "axis turned by the voltage [deg]": np.ptp(turned[late]) if sailing else np.nan,
            "wobble with voltage [deg]": most(wobble),
            "coning from [deg]": -most(-angle("coning_angle")),
            "to [deg]": most(angle("coning_angle")),
            "largest lag with voltage [deg]": most(np.abs(angle("lagging_angle"))),
            "least gap with voltage [deg]": -most(-gaps),
            "steps": run.stats["steps"], "message": run.stats["message"] or "none",
        })  # fmt: skip
        print(rows[-1], flush=True)
    written("stuck.csv", rows)
    picture(plan, runs)


def picture(plan, runs):
    """Draws the smallest gap between neighbours, the place of the hub and its wobble."""
    figure, axes = panels(2, 2, (10.0, 6.5))
    for name, (run, gaps, offset, wobble, _) in runs.items():
        hours = np.asarray(run.time) / 3600.0
        if "40 h" in name:
            axes[1, 1].plot(hours, gaps.min(1), lw=0.8, label=name.replace(", 40 h", ""))
            continue
        axes[0, 0].plot(hours, gaps.min(1), label=name)
        axes[0, 1].plot(hours, offset)
        axes[1, 0].plot(hours, wobble, lw=0.8)
    labels = ("least gap between neighbours [deg]", "hub from centre of mass [m]",
              "wobble of the hub's axis [deg]", "least gap in 40 h [deg]")  # fmt: skip
    for axis, label in zip(axes.ravel(), labels, strict=True):
        axis.set_ylabel(label)
        axis.set_xlabel("time [h]")
    for axis in axes.ravel()[:3]:
        axis.axvline(plan.at / 3600.0, color="0.7", lw=0.8)
        axis.axvline((plan.end + 300.0) / 3600.0, color="0.7", lw=0.8, ls=":")
    axes[0, 0].set_ylim(0.0, 35.0)
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(),
        frameon=False,
        fontsize=8,
        ncols=3,
        loc="outside upper center",
    )
    axes[1, 1].set_ylim(0.0, 35.0)
    axes[1, 1].legend(frameon=False, fontsize=7)
    figure.savefig(HERE / "stuck.png", dpi=90)


if __name__ == "__main__":
    main()
