"""What an eclipse does to the baseline, and how near to a planet a sail may pass its shadow.

python experiments/eclipse/run.py      # three minutes; writes baseline.csv, distances.csv, eclipse.png
"""

import csv
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import esail_jax as esail
from esail_jax.environment.thermal import ALUMINIUM, Wire, eclipse_series, eclipse_temperature, solar_flux

HERE = Path(__file__).parent
EXPANSION = 2.3e-5
"""Thermal expansion of aluminium [1/K]."""

ENTER, DURATION = 300.0, 1800.0
SUN_RADIUS, AU = 6.957e8, 1.495978707e11


def written(name, header, rows):
    """Writes a table."""
    with (HERE / name).open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(header)
        table.writerows(rows)


# ---- the baseline -----------------------------------------------------------------------------------


def baseline(penumbra):
    """The run of the baseline through an eclipse at 1 au; without one if `penumbra` is None. The tethers
    have their undeformed length at the temperature of the start."""
    warm = ALUMINIUM.steady(solar_flux(1.0))
    heat = {"thermal.expansion": EXPANSION, "thermal.reference_temperature": warm}
    heat["thermal.temperature"] = warm
    end = {"integrator.t_end": 3600.0, "output.interval": 2.0}
    if penumbra is not None:
        series = eclipse_series(ALUMINIUM, solar_flux(1.0), ENTER, ENTER + DURATION, penumbra)
        heat |= {f"thermal.{key}": values.tolist() for key, values in series.items()}
    return esail.simulate("baseline", heat | end)


def tension(run):
    """Force on the root of every tether [N]."""
    return np.linalg.norm(run["reaction_B"], axis=-1)


def compare_baselines():
    """Writes baseline.csv: what differs with an eclipse of some penumbras."""
    runs = {"no eclipse": baseline(None)}
    runs |= {f"penumbra {x:g} s": baseline(x) for x in (0.0, 10.0, 60.0)}
    rows, usual = [], next(iter(runs.values()))
    start = tension(usual)[0].max()
    for name, run in runs.items():
        force, change = tension(run), run["tether_length"] - run["tether_length"][0]
        coning = np.rad2deg(run["coning_angle"] - usual["coning_angle"])
        spin = run["angular_velocity_B"][:, 0] / usual["angular_velocity_B"][:, 0] - 1.0
        balance = np.abs(run["energy_balance_error"]).max() / np.ptp(run["kinetic_energy"])
        rows.append((
            name, f"{run['temperature'].min():.0f}", f"{change.min():.1f}", f"{force.max() / start:.3f}",
            f"{force.min() / start:.3f}", f"{np.abs(coning).max():.3f}", f"{1e2 * spin.max():.2f}",
            f"{1e2 * spin[-600:].mean():.2f}", f"{balance:.0e}",
        ))  # fmt: skip
    header = "case", "lowest T [K]", "shortening [m]", "largest tension / start", "smallest tension / start"
    header += (
        "change of coning [deg]",
        "largest gain of spin [%]",
        "gain in the last 1200 s [%]",
        "energy error",
    )
    written("baseline.csv", header, rows)
    return runs


def picture(runs):
    """Draws temperature, length, tension and spin of the runs."""
    figure = Figure(figsize=(9, 6.5), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True).ravel()
    for name, run in runs.items():
        if name == "no eclipse":
            continue
        axes[0].plot(run.time, run["temperature"][:, 0], label=name)
        axes[1].plot(run.time, run["tether_length"][:, 0] - run["tether_length"][0, 0])
        axes[2].plot(run.time, tension(run)[:, 0], lw=0.8)
        axes[3].plot(run.time, 1e3 * run["angular_velocity_B"][:, 0])
    labels = "temperature [K]", "change of length [m]", "force on a root [N]", "spin of the hub [mrad/s]"
    for axis, label in zip(axes, labels, strict=True):
        axis.set_ylabel(label)
        axis.axvspan(ENTER, ENTER + DURATION, color="0.93", zorder=0)
    for axis in axes[2:]:
        axis.set_xlabel("time [s]")
    axes[0].legend(frameon=False)
    figure.savefig(HERE / "eclipse.png", dpi=110)


# ---- safe distances ---------------------------------------------------------------------------------

WIRE = Wire(diameter=50e-6, density=2700.0, heat_capacity=900.0, absorptivity=0.12, emissivity=0.04)
LENGTH, PULL, LINE = 20e3, 0.05, 1e-5
"""A tether of 20 km that the spin pulls with 5 cN, of 10 g/km, whose load-bearing wire is of 50 um."""

UNITS = (0.2, 0.4, 1.0)
"""Masses of the remote unit [kg]; the published one is not known to us."""

KNOTS = np.concatenate([[0.0], ENTER + np.linspace(0.0, 480.0, 61)])


def single(distance, penumbra, unit):
    """Largest tension over that of the start, of an undamped tether that enters a shadow."""
    spin = np.sqrt(PULL / (unit * LENGTH + 0.5 * LINE * LENGTH**2))
    flux = solar_flux(distance)
    heat = eclipse_temperature(WIRE, flux, KNOTS, ENTER, ENTER + 1e6, penumbra)
    area = np.pi * WIRE.diameter**2 / 4.0
    tables = {
        "tethers": {
            "count": 1, "length": LENGTH, "area": area, "density": LINE / area, "youngs_modulus": 70e9,
            "element": "truss", "elements": 6,
        },
        "remote_units": {"mass": unit},
        "thermal": {
            "expansion": EXPANSION, "reference_temperature": float(heat[0]),
            "temperature": heat.tolist(), "time": KNOTS.tolist(),
        },
        "initial": {"spin_rate": spin},
        "integrator": {"t_end": ENTER + 480.0, "tolerance": 1e-9},
        "output": {"interval": 2.0},
    }  # fmt: skip
    kinds = {"tethers": esail.Tethers, "remote_units": esail.RemoteUnits, "thermal": esail.Thermal}
    kinds |= {"initial": esail.Initial, "integrator": esail.Integrator}
    output = tables.pop("output")
    scene = esail.Scene(
        **{name: kinds[name](**table) for name, table in tables.items()}, output=esail.Output(**output)
    )
    force = tension(esail.simulate(scene))[:, 0]
    return float(force.max() / force[0])


BODIES = {
    "Venus": (0.723, 3.24859e14, 6052e3),
    "Earth": (1.0, 3.986004e14, 6371e3),
    "Moon": (1.0, 4.9028e12, 1737e3),
    "Mars": (1.524, 4.282837e13, 3390e3),
}
"""Distance from the Sun [au], gravitational parameter [m^3/s^2] and radius [m]."""

PENUMBRAS = np.array([0.0, 10.0, 20.0, 30.0, 45.0, 60.0, 80.0, 110.0, 150.0, 220.0])


def radius_of(penumbra, distance, parameter, speed):
    """Distance from a body [m] at which a limb crosses the Sun's disc in a time: r theta / v, where v is
    `speed` times that of a circular orbit."""
    angle = 2.0 * SUN_RADIUS / (distance * AU)
    return (penumbra * speed * np.sqrt(parameter) / angle) ** (2.0 / 3.0)


def safe_distances():
    """Writes distances.csv: the radii at which the tension rises as much as in a sudden eclipse at 2.5 au,
    which the paper calls safe."""
    rows = []
    for unit in UNITS:
        allowed = single(2.5, 0.0, unit)
        for name, (distance, parameter, radius) in BODIES.items():
            peaks = np.array([single(distance, penumbra, unit) for penumbra in PENUMBRAS])
            # The largest tension falls with the penumbra, but for ripples.
            above = np.flatnonzero(peaks > allowed)[-1]
            penumbra = np.interp(-allowed, -peaks[above : above + 2], PENUMBRAS[above : above + 2])
            orbits = (radius_of(penumbra, distance, parameter, s) for s in (1.0, np.sqrt(2.0)))
            radii = [f"{1e-3 * x:.3g}" for x in orbits]
            sudden = f"{peaks[0]:.3f}"
            rows.append(
                (unit, f"{allowed:.3f}", name, sudden, f"{penumbra:.0f}", *radii, f"{radius / 1e3:.0f}")
            )
            print(*rows[-1], flush=True)
    header = "remote unit [kg]", "allowed tension / start", "body", "tension in a sudden eclipse / start"
    header += (
        "least penumbra [s]",
        "safe radius, circular [km]",
        "safe radius, parabolic [km]",
        "body's radius [km]",
    )
    written("distances.csv", header, rows)


if __name__ == "__main__":
    picture(compare_baselines())
    safe_distances()
