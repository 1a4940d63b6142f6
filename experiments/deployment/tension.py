"""Two tethers whose motors hold a constant tension: the longer one runs away, and loops that prevent it.

python experiments/deployment/tension.py    # writes tension.csv, tension.png
"""

import jax.numpy as jnp
import numpy as np
from common import CALM, HERE, panels, simulated, written

from esail_jax.array_types import Array
from esail_jax.physics import WinchLaw

SPIN, RADIUS, LENGTH, WHOLE = 0.05, 1.0, 100.0, 200.0
TIP, LINE = 0.5, 7653.0 * 4.28e-9
STIFFNESS = 70e9 * 4.28e-9
APART = 0.002
"""Difference of the lengths at the start [m]."""

DRUMS = 2.0, 5.0, 20.0, 100.0, 500.0, 5000.0
"""Inertia of drum and motor over the radius squared [kg]."""

SHOWN = 20.0
"""The drum for the loops [kg]."""


class Loop(WinchLaw):
    """A motor that holds a tension [N], with a term of the rate and a term of the length."""

    newtons: Array
    damping: Array
    spring: Array

    def tension(self, measurements):
        off = measurements.deployed_length - LENGTH
        return self.newtons + self.damping * measurements.payout_rate + self.spring * off


def resting():
    """The tension [N] of a tether of LENGTH at rest, and its slope by the length [N/m]."""
    strain = 0.0
    for _ in range(5):
        long = LENGTH * (1.0 + strain)
        pull = SPIN**2 * (TIP * (RADIUS + long) + LINE * LENGTH * (RADIUS + 0.5 * long))
        strain = pull / STIFFNESS
    return pull, SPIN**2 * (TIP + LINE * (RADIUS + LENGTH))


def growths(drum):
    """Growth [1/s] of a difference of the lengths: of a tether that stays radial, and with its lag."""
    _, slope = resting()
    moved = drum + TIP + LINE * WHOLE
    part, arm = slope / SPIN**2 / moved, RADIUS / LENGTH
    both = arm + 3.0 * part
    square = 2.0 * part * arm / (both + np.sqrt(both**2 + 4.0 * part * arm))
    return np.sqrt(slope / moved), SPIN * np.sqrt(square)


def run_of(drum, end, law=None):
    """Times [s], and the difference of the lengths [m]."""
    newtons, _ = resting()
    changes = CALM | {
        "hub.height": None, "hub.density": None, "hub.mass": 1e6, "hub.radius": RADIUS,
        "hub.inertia": (1e9 * np.diag([1.0, 0.8, 0.8])).tolist(), "tethers.count": 2,
        "tethers.length": WHOLE, "tethers.elements": 2, "remote_units.mass": TIP,
        "initial.spin_rate": SPIN, "deployment.law": "tension", "deployment.drum_mass": drum,
        "deployment.start_length": [LENGTH + 0.5 * APART, LENGTH - 0.5 * APART],
    }  # fmt: skip
    terms = (law,)
    if law is None:
        terms = ()
        changes |= {"deployment.time": [0.0, end], "deployment.tension": [newtons, newtons]}
    run = simulated(changes, end, 400, terms, "truss")
    lengths = np.asarray(run["deployed_length"])
    return np.asarray(run.time), lengths[:, 0] - lengths[:, 1], run


def slope_of(time, apart):
    """Growth [1/s] in the second half of a run."""
    late = time > 0.5 * time[-1]
    return np.polyfit(time[late], np.log(np.abs(apart[late])), 1)[0]


def main():
    rows, shown = [], {}
    newtons, slope = resting()
    print(f"tension {newtons:.4g} N, slope {slope:.4g} N/m")
    for drum in DRUMS:
        radial, lagging = growths(drum)
        time, apart, run = run_of(drum, 6.0 / lagging)
        rows.append({
            "case": "constant tension", "drum [kg]": drum, "growth, radial formula [1/s]": radial,
            "growth, formula with lag [1/s]": lagging, "growth, simulated [1/s]": slope_of(time, apart),
            "apart at the end [m]": apart[-1], "after [s]": time[-1],
            "largest lag [deg]": np.rad2deg(np.abs(np.asarray(run["lagging_angle"]))).max(),
        })  # fmt: skip
        print(rows[-1], flush=True)
        if drum == SHOWN:
            shown["constant tension"] = time, apart
            end = 2.0 * time[-1]
    for name, damping, spring in (
        ("loop on the rate", 4.0, 0.0),
        ("loop on rate and length", 4.0, 2.0 * slope),
    ):
        law = Loop(jnp.asarray(newtons), jnp.asarray(damping), jnp.asarray(spring))
        time, apart, run = run_of(SHOWN, end, law)
        shown[name] = time, apart
        rows.append({
            "case": name, "drum [kg]": SHOWN, "growth, radial formula [1/s]": (slope - spring) / damping,
            "growth, formula with lag [1/s]": np.nan, "growth, simulated [1/s]": slope_of(time, apart),
            "apart at the end [m]": apart[-1], "after [s]": time[-1],
            "largest lag [deg]": np.rad2deg(np.abs(np.asarray(run["lagging_angle"]))).max(),
        })  # fmt: skip
        print(rows[-1], flush=True)
    written("tension.csv", rows)
    picture(rows, shown)


def picture(rows, shown):
    """Draws the difference of the lengths, and its growth by the drum."""
    figure, axes = panels(1, 2, (9.0, 3.6))
    for name, (time, apart) in shown.items():
        axes[0, 0].semilogy(time / 3600.0, np.abs(apart), label=name)
    axes[0, 0].set_xlabel("time [h]")
    axes[0, 0].set_ylabel("difference of the lengths [m]")
    axes[0, 0].legend(frameon=False, fontsize=8, title=f"drum of {SHOWN:g} kg", title_fontsize=8)
    drums = np.geomspace(DRUMS[0], DRUMS[-1], 100)
    both = np.array([growths(drum) for drum in drums])
    axes[0, 1].loglog(drums, both[:, 0], "--", label="formula, tethers radial")
    axes[0, 1].loglog(drums, both[:, 1], label="formula, with lag")
    own = [row for row in rows if row["case"] == "constant tension"]
    axes[0, 1].loglog(
        [row["drum [kg]"] for row in own],
        [row["growth, simulated [1/s]"] for row in own],
        "ko",
        label="run",
    )
    axes[0, 1].set_xlabel("inertia of drum and motor over radius squared [kg]")
    axes[0, 1].set_ylabel("growth of the difference [1/s]")
    axes[0, 1].legend(frameon=False, fontsize=8)
    figure.savefig(HERE / "tension.png", dpi=90)


if __name__ == "__main__":
    main()
