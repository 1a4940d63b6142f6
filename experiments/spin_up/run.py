"""Spin-up of the baseline from near rest to 4 mrad/s by cold gas on the remote units.

python experiments/spin_up/run.py    # a minute; writes table.csv, spin_up.png
"""

import csv
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import esail_jax as esail

HERE = Path(__file__).parent
START, GOAL = 2e-4, 4e-3
FORCES = (2e-3, 10e-3, 50e-3, 0.5)
CALM = {f"solar_wind.{key}": None for key in ("speed", "number_density", "cutoff_voltage")}
CALM |= {"voltage.value": None, "initial.spin_rate": START, "initial.sailing_angle_deg": 0.0}
ISP = 60.0
"""Specific impulse of cold nitrogen [s]."""


def moment_of_inertia(scene):
    """About the spin axis, of a rigid sail [kg m^2]."""
    hub, tethers = scene.hub, scene.tethers
    end = hub.radius + tethers.length
    line = tethers.density * tethers.area
    each = scene.remote_units.mass * end**2 + line * (end**3 - hub.radius**3) / 3.0
    return 0.5 * np.pi * hub.density * hub.height * hub.radius**4 + tethers.count * each


def spun_up(force):
    """A run whose pulse has the impulse that a rigid sail needs, and that pulse's duration [s]."""
    scene = esail.load_scene("baseline", CALM)
    arm = scene.hub.radius + scene.tethers.length
    duration = moment_of_inertia(scene) * (GOAL - START) / (scene.tethers.count * force * arm)
    rise = 0.1 * duration
    pulse = {"force": force, "on": 50.0, "off": 50.0 + duration, "rise_time": rise}
    end = 50.0 + 1.5 * duration
    changes = CALM | {f"tip_thrust.{key}": x for key, x in pulse.items()}
    run = esail.simulate("baseline", changes | {"integrator.t_end": end, "output.interval": end / 800})
    return run, duration


def spin(run):
    """Mean angular rate of the tips about the spin axis [rad/s]."""
    offset = np.asarray(run["tip_position_I"]) - np.asarray(run["hub_position_I"])[:, None]
    body = np.einsum("tij,tki->tkj", np.asarray(run["rotation_IB"])[:1].repeat(len(offset), 0), offset)
    angle = np.unwrap(np.arctan2(body[..., 2], body[..., 1]), axis=0)
    return np.gradient(angle.mean(1), np.asarray(run.time))


def main():
    rows = []
    figure = Figure((9.0, 5.5), layout="constrained")
    panels = figure.subplots(3, len(FORCES), sharex="col", squeeze=False)
    for k, force in enumerate(FORCES):
        run, duration = spun_up(force)
        time, rate = np.asarray(run.time), spin(run)
        late = time > 50.0 + 1.2 * duration
        strain, lag = np.asarray(run["max_axial_strain"]), np.rad2deg(np.asarray(run["lagging_angle"]))
        gas = 1e3 * force * duration / (ISP * 9.80665)
        rows.append({
            "force [mN]": 1e3 * force, "duration [min]": duration / 60.0,
            "final spin [mrad/s]": 1e3 * rate[late].mean(), "gas per unit [g]": gas,
            "smallest of the largest strains": strain.min(),
            "strain at the end": strain[-1].mean(), "largest lag of the tips [deg]": np.abs(lag).max(),
            "message": run.stats["message"] or "none",
        })  # fmt: skip
        print(rows[-1], flush=True)
        for axes, y, name in zip(
            panels[:, k], (1e3 * rate, 1e3 * strain[:, 0], lag[:, 0]),
            ("spin [mrad/s]", "largest strain [1e-3]", "lag of the tip [deg]"), strict=True,
        ):  # fmt: skip
            axes.plot(time / 60.0, y, linewidth=0.8)
            axes.set_ylabel(name if k == 0 else "")
        panels[0, k].set_title(f"{1e3 * force:g} mN")
        panels[-1, k].set_xlabel("time [min]")
    figure.savefig(HERE / "spin_up.png", dpi=60)
    with (HERE / "table.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(
            {key: x if isinstance(x, str) else f"{x:.4g}" for key, x in r.items()} for r in rows
        )


if __name__ == "__main__":
    main()
