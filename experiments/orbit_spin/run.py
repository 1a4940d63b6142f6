"""Spin of a sail that keeps its angle to the Sun, on an orbit about the Sun, against the law
d ln(L cos alpha)/dt = Omega tan alpha; and its path against that of a point mass with the mean thrust.

    python experiments/orbit_spin/run.py            writes results.csv, run_*.csv and spin.png here
"""

import csv
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp

import esail_jax as esail
from esail_jax.constants import SOLAR_MU

HERE = Path(__file__).parent
ANGLES = (35.0, -35.0, 20.0)
DAYS = 6.0

SAIL = {
    "tethers.count": 6,
    "tethers.elements": 2,
    "tethers.element": "truss",
    "tethers.bending": False,
    "tethers.bending_damping_time": None,
    "voltage.law": "feedback",
    "voltage.gain": 0.2,
    "integrator.t_end": DAYS * 86400.0,
    "output.interval": 1800.0,
}
"""Six tethers of two trusses in place of twelve of five cables; the numbers of the tethers stay."""


def masses(scene):
    """Mass [kg] of the whole sail."""
    t, hub = scene.tethers, scene.hub
    tether = t.density * t.area * t.length + scene.remote_units.mass
    return t.count * tether + hub.density * np.pi * hub.radius**2 * hub.height


def plane(run):
    """Unit normal of the plane of the tips (instant, 3), on the side of X_B, and the arms of the tips from
    their centre (instant, tether, 3)."""
    tips = run["tip_position_I"]
    arms = tips - tips.mean(1, keepdims=True)
    normal = np.linalg.svd(arms)[2][:, 2]
    side = (normal * run["rotation_IB"][:, :, 0]).sum(1)
    return normal * np.sign(side)[:, None], arms


def angular_momentum(run, normal, arms):
    """Times [s] between saved instants and the spin angular momentum there, up to a factor: the rate at
    which the tips turn about the normal of their plane times their mean squared radius.

    The mean rate of the hub is that of the tips to one per cent, a fifteenth of a radian in an interval of
    1.15 turns, and so tells the whole turns; the tips then give the rate to 1e-5."""
    side = np.cross(np.array([0.0, 0.0, 1.0]), normal)
    side /= np.linalg.norm(side, axis=1)[:, None]
    up = np.cross(normal, side)
    angle = np.arctan2((arms * up[:, None]).sum(-1), (arms * side[:, None]).sum(-1))
    step, rate = np.diff(run.time), run["angular_velocity_B"][:, 0]
    rates = []
    smooth = np.convolve(np.pad(rate, 12, mode="edge"), np.ones(25) / 25.0, "valid")
    for k, h in enumerate(step):
        expected = 0.5 * (smooth[k] + smooth[k + 1]) * h
        turned = angle[k + 1] - angle[k] - expected
        turned = (turned + np.pi) % (2.0 * np.pi) - np.pi
        rates.append((expected + turned.mean()) / h)
    squared = (arms**2).sum(-1).mean(1)
    return run.time[:-1] + 0.5 * step, np.array(rates) * 0.5 * (squared[1:] + squared[:-1])


def point_mass(run, scene):
    """Heliocentric position [m] at the end of a point mass with the thrust of the run in the orbital frame,
    smoothed by a polynomial of fourth degree in time: its mean over a turn."""
    t_end = run.time[-1]
    fits = np.polyfit(run.time / t_end, run["thrust_O"] / masses(scene), 4)

    def rate(t, y):
        size = np.linalg.norm(y[:3])
        k = y[:3] / size
        i = np.array([-k[1], k[0], 0.0]) / np.hypot(k[0], k[1])
        mean = (t / t_end) ** np.arange(4, -1, -1) @ fits
        push = np.stack([i, np.cross(k, i), k], 1) @ mean
        return np.concatenate([y[3:], -SOLAR_MU * k / size**2 + push])

    start = np.concatenate([run["heliocentric_position"][0], run["heliocentric_velocity"][0]])
    found = solve_ivp(rate, (0.0, run.time[-1]), start, "DOP853", rtol=1e-12, atol=1e-6)
    return found.y[:3, -1]


def measured(angle):
    """One run: its rows for the table, and time, angle and momentum for the figure."""
    aims = {"initial.sailing_angle_deg": angle, "voltage.target_sailing_angle_deg": angle}
    scene = esail.load_scene("heliocentric", SAIL | aims)
    begun = time.process_time()
    run = esail.simulate(scene)
    used = time.process_time() - begun
    normal, arms = plane(run)
    middle, momentum = angular_momentum(run, normal, arms)
    r = run["heliocentric_position"]
    out = r / np.linalg.norm(r, axis=1)[:, None]
    ahead = np.cross([0.0, 0.0, 1.0], out)
    tilt = np.rad2deg(np.arctan2((normal * ahead).sum(1), (normal * out).sum(1)))
    sun = np.unwrap(np.arctan2(r[:, 1], r[:, 0]))
    turned = np.interp(middle, run.time, sun - sun[0])
    late = middle > 0.1 * run.time[-1]
    angle_now = np.deg2rad(np.interp(middle, run.time, tilt))
    slope = np.polyfit(turned[late], np.log(momentum * np.cos(angle_now))[late], 1)[0]
    whole = np.polyfit(turned[late], np.log(momentum)[late], 1)[0]
    held = tilt[run.time > 0.1 * run.time[-1]]
    alone = point_mass(run, scene)
    moved = np.linalg.norm(run["hub_position_I"][-1])
    row = {
        "target_deg": angle,
        "held_deg": round(float(held.mean()), 3),
        "mean_tan": round(float(np.tan(np.deg2rad(held)).mean()), 4),
        "d_ln(L cos a)_d_phi": round(float(slope), 4),
        "d_lnL_d_phi": round(float(whole), 4),
        "displacement_m": f"{moved:.5g}",
        "point_mass_error": f"{np.linalg.norm(run['heliocentric_position'][-1] - alone) / moved:.2e}",
        "steps": run.stats["steps"],
        "cpu_s": round(used, 1),
        "energy_balance_error": f"{np.abs(run['energy_balance_error']).max():.1e}",
        "external_work": f"{run['external_work'][-1]:.4g}",
    }
    # ln(L cos alpha) grows by the integral of tan alpha over the Sun's angle phi.
    tangent = np.tan(angle_now)
    gained = np.cumsum(np.append(0.0, 0.5 * (tangent[1:] + tangent[:-1]) * np.diff(turned)))
    exact = np.exp(gained) * np.cos(angle_now[0]) / np.cos(angle_now)
    days = middle / 86400.0
    return row, days, np.interp(middle, run.time, tilt), momentum / momentum[:20].mean(), exact


def main():
    rows, figure = [], Figure(figsize=(9, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    for angle in ANGLES:
        row, days, held, momentum, exact = measured(angle)
        print(row, flush=True)
        rows.append(row)
        np.savetxt(
            HERE / f"run_{angle:g}.csv", np.stack([days, held, momentum, exact], 1)[::8], fmt="%.6g",
            delimiter=",", header="day,angle_deg,L/L_0,law", comments="",
        )  # fmt: skip
        lines = left.plot(days, momentum, label=f"{angle:g} deg")
        left.plot(days, exact, "--", color=lines[0].get_color())
        right.plot(days, held)
        with (HERE / "results.csv").open("w", newline="") as file:
            table = csv.DictWriter(file, rows[0], lineterminator="\n")
            table.writeheader()
            table.writerows(rows)
        left.set(xlabel="day", ylabel="$L/L_0$; dashed: law")
        right.set(xlabel="day", ylabel="angle of the spin plane [deg]")
        left.legend()
        figure.savefig(HERE / "spin.png", dpi=110)


if __name__ == "__main__":
    main()
