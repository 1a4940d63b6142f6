"""A voltage source that fails, and a tether that is lost: what becomes of a sail of twelve tethers in a day
with constant voltages, with the package's feedback, and with the steering law of this folder.

    python experiments/control/failures.py

writes failures.csv and failures.png.
"""

from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from laws import VOLTS, Steering
from matplotlib.figure import Figure
from sail import AIM, DAY, circumstance, sail
from tables import write

import esail_jax as esail
from esail_jax import control
from esail_jax.environment.orbit import orbital_frame

HERE = Path(__file__).parent
FAILS, TETHER = 2 * 3600.0, 3
"""Instant of the failure [s], and the tether that fails."""

GAINS = 5.0, 0.5, 0.3
SAVED = ["heliocentric_position", "hub_position_I", "tip_position_I", "voltage", "lagging_angle",
         "coning_angle", "smallest_tether_distance"]  # fmt: skip


class Still(eqx.Module):
    """Constant voltages, as a law: its source may fail."""

    volts: float = VOLTS
    period: float = eqx.field(static=True, default=60.0)

    def commanded(self, measurements):
        return self.volts


def miss_of_kept(run):
    """Angle [deg] between the aim and the normal of the plane of the tips that are not lost, through the
    hub."""
    kept = [i for i in range(12) if i != TETHER - 1]
    arms = run["tip_position_I"][:, kept] - run["hub_position_I"][:, None]
    normal = np.cross(arms[:, :-1], arms[:, 1:]).sum(1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    aim = [np.sin(AIM), 0.0, np.cos(AIM)]
    aims = np.stack([np.asarray(orbital_frame(jnp.asarray(x))) @ aim for x in run["heliocentric_position"]])
    return np.rad2deg(np.arcsin(np.linalg.norm(np.cross(normal, aims), axis=1)))


def main():
    steering = Steering(*jnp.array(GAINS))
    aware = Steering(*jnp.array(GAINS), lost=(TETHER,))
    feedback = {"voltage.law": "feedback", "voltage.gain": 5.0, "voltage.target_sailing_angle_deg": 15.0}
    release = {"event.time": [FAILS], "event.release": [TETHER]}
    cases = {
        "no failure, constant": (Still(), {}),
        "no failure, steering": (steering, {}),
        "source fails, constant": (control.FailedSource(Still(), TETHER, FAILS), {}),
        "source fails, steering": (control.FailedSource(steering, TETHER, FAILS), {}),
        "tether lost, constant": (Still(), release),
        "tether lost, feedback of the hub": (None, release | feedback),
        "tether lost, steering": (steering, release),
        "tether lost, steering that knows": (aware, release),
    }
    given = sail(DAY, 15.0) | {"tethers.count": 12} | circumstance(7, DAY) | {"tethers.length": 10e3}
    table, lines = [], {}
    for name, (law, overrides) in cases.items():
        run = esail.simulate("baseline", given | overrides, voltage_law=law, save=SAVED, throw=False)
        off, kept = miss_of_kept(run), [i for i in range(12) if i != TETHER - 1]
        late = run.time > 6 * 3600.0
        change = np.sqrt(np.mean((run["voltage"][:, kept] / VOLTS - 1.0) ** 2))
        lag = np.rad2deg(np.abs(run["lagging_angle"][:, kept]).max())
        numbers = np.sqrt((off[late] ** 2).mean()), off[-1], change, lag
        table.append((name, *map(float, (*numbers, run["smallest_tether_distance"].min()))))
        lines[name] = run.time / 3600.0, off
        print(*table[-1], run.stats["message"], f"{run.stats['wall_time']:.1f} s", flush=True)
    header = ("case", "rms miss after 6 h [deg]", "miss after a day [deg]", "rms voltage change",
              "largest lag [deg]", "smallest distance [m]")  # fmt: skip
    write("failures.csv", header, table)
    figure = Figure(figsize=(7.0, 3.6), layout="constrained")
    axes = figure.subplots()
    styles = ("k:", "k-", "C0:", "C0-", "C1:", "C2-", "C1--", "C1-")
    for (name, (hours, off)), style in zip(lines.items(), styles, strict=True):
        axes.semilogy(hours, np.maximum(off, 1e-3), style, label=name, lw=1.0)
    axes.axvline(FAILS / 3600.0, color="0.7", lw=0.8)
    axes.set(xlabel="time [h]", ylabel="angle to the aim [deg]", xlim=(0, 24))
    axes.legend(fontsize=7, ncols=2)
    figure.savefig(HERE / "failures.png", dpi=150)


if __name__ == "__main__":
    main()
