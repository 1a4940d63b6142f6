"""How long must a first E-sail fly until its thrust per length is known?

python experiments/first_flight/run.py    # writes four tables and a figure
"""

import csv
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import esail_jax as esail
from esail_jax.constants import PROTON_MASS, VACUUM_PERMITTIVITY
from esail_jax.identification.fit import Problem
from esail_jax.identification.uncertainty import uncertainty_of

HERE = Path(__file__).parent
K, N, U = "solar_wind.thrust_factor", "solar_wind.number_density", "solar_wind.speed"
FREE = [K, N, U, "hub.torque[1]", "initial.spin_rate", "bias.angular_velocity_B[1]"]
NOISE = {"spin_rate[1]": 1e-4, "angular_velocity_B": 3e-5, "tip_direction_B": 1e-3, "sailing_angle": 1e-4}
"""Assumed, every 10 s: the spin rate from a Sun sensor [rad/s]; a small gyro, 0.3 deg/sqrt(h),
in the mean of 10 s [rad/s], with a bias that is free; a camera of the tips [rad]; a star
tracker of 20 seconds of arc [rad]."""
PRIORS = {N: (7.3e6, 0.11 * 7.3e6), U: (4e5, 0.022 * 4e5)}
"""Of a monitor of the wind as usual after an hour: errors by chance and of the calibration together."""
SPIN = ("spin_rate", "angular_velocity_B")
INSTRUMENTS = {
    "Sun sensor": ("spin_rate",),
    "Sun sensor and gyro": SPIN,
    "camera": ("tip_direction_B",),
    "all": (*SPIN, "tip_direction_B", "sailing_angle"),
}
GOALS = (0.10, 0.03, 0.01)
WINDS = 20
TABLE = {
    "voltage.law": "piecewise-linear", "voltage.on_phase_deg": None, "voltage.off_phase_deg": None,
    "voltage.rise_phase_deg": None,
}  # fmt: skip
"""A schedule that is a table in time."""
PATTERN = TABLE | {
    "voltage.time": [0.0, 95.0, 105.0, 195.0, 205.0, 295.0, 305.0, 395.0, 405.0, 495.0, 505.0, 600.0],
    "voltage.table": [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0],
}
"""Both tethers off and on, every 100 s."""
NODES = np.arange(0.0, 601.0, 5.0)
"""Instants of the tables of the two schedules below [s]."""
LIMITS = TABLE | {
    "voltage.time": NODES.tolist(), "voltage.maximum": 10e3, "voltage.slew_rate": 2e3,
    "voltage.power_limit": 0.0105, "tethers.wire_radius": 25e-6,
}  # fmt: skip
"""Of these: 10 kV, 2 kV/s, and the power of one tether at 10 kV."""


def cubesat(changes=None):
    """The cubesat."""
    return esail.load_scene(str(HERE / "cubesat.toml"), changes or {})


def flown(table):
    """The cubesat with a table of voltages within the limits."""
    return cubesat(LIMITS | {"voltage.table": np.asarray(table).tolist()})


def opposite(signal):
    """One tether is on where a signal is positive, the other where it is negative."""
    on = np.where(signal > 0.0, 1.0, 0.0)
    return np.stack([on, 1.0 - on], 1)


def chirp():
    """One tether after the other, with periods from 20 to 200 s."""
    return opposite(np.sin(2.0 * np.pi * np.cumsum(5.0 / np.linspace(20.0, 200.0, len(NODES)))))


def table_in(name):
    """A schedule that was designed."""
    return np.loadtxt(HERE / name, delimiter=",", skiprows=1)


def shown(scene, random=None):
    """What the instruments show of a run, with noise if there are random numbers."""
    times = np.arange(10.0, 600.1, 10.0)
    names = tuple(name.partition("[")[0] for name in NOISE)
    run, data = esail.simulate(scene, save=names, times=times.tolist()), {"time": times}
    for name, sd in NOISE.items():
        exact = np.asarray(run[name.partition("[")[0]])
        exact = exact[:, 0] if name.endswith("[1]") else exact
        data[name] = exact + (0.0 if random is None else sd * random.normal(size=exact.shape))
    return data


def winds():
    """Densities [1/m^3] and speeds [m/s] about their medians, from logarithms with normal distributions."""
    random = np.random.default_rng(2027)
    return 6e6 * np.exp(0.5 * random.normal(size=WINDS)), 4.2e5 * np.exp(0.2 * random.normal(size=WINDS))


def derivatives(problem, density, speed):
    """The derivatives of all measurements in a wind."""
    values = np.array([p.start for p in problem.parameters])
    values[problem.names.index(N)], values[problem.names.index(U)] = density, speed
    found = problem.models[0](values).jacobian
    assert np.isfinite(found).all()
    return found


def errors(problem, jacobian, observables):
    """Relative errors of the thrust per length in a known wind, by the instants at which a flight may end
    [s]."""
    cells = problem.cells[0]
    time, mine = np.array(cells.times)[cells.row], np.isin(cells.name, observables)
    gyro = "angular_velocity_B" in observables
    used = [
        k
        for k, name in enumerate(problem.names)
        if name not in (N, U) and (gyro or not name.startswith("bias"))
    ]
    x = (jacobian / cells.deviations[:, None])[:, used]
    ends, names = np.array(cells.times)[2:], [problem.names[k] for k in used]
    found = [uncertainty_of(names, np.ones(len(used)), x[mine & (time <= end)]) for end in ends]
    return ends, np.array([one.sd[0] for one in found]) / problem.parameters[0].start


def minutes_until(ends, sd, power):
    """Minutes until the error is that of each of the goals. After the run it falls with a power of time."""
    late = [ends[-1] * (sd[-1] / goal) ** (1.0 / power) for goal in GOALS]
    within = [ends[np.argmax(sd <= goal)] if (sd <= goal).any() else np.inf for goal in GOALS]
    return np.where(np.isfinite(within), within, late) / 60.0


def write(name, rows):
    """Writes a table, numbers with three digits."""
    with (HERE / name).open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            {k: x if isinstance(x, str | int) else f"{x:.3g}" for k, x in row.items()} for row in rows
        )
    for row in rows:
        print({k: x if isinstance(x, str | int) else float(f"{x:.3g}") for k, x in row.items()}, flush=True)


def schedules(problems):
    """Minutes of each schedule and set of instruments over the winds. After the run a slope of the
    spin rate is known with an error that falls with T^-3/2, a mean with T^-1/2. Returns the medians of the
    first schedule with all instruments."""
    rows, medians, figure = [], [], Figure((9.0, 7.0), layout="constrained")
    first, all_axes = next(iter(problems.values())), figure.subplots(2, 2, sharex=True, sharey=True)
    for axes, (schedule, problem) in zip(all_axes.ravel(), problems.items(), strict=True):
        of_winds = [derivatives(problem, *wind) for wind in zip(*winds(), strict=True)]
        middle = derivatives(problem, 7.3e6, 4e5)
        for label, observables in INSTRUMENTS.items():
            power = 1.5 if "spin_rate" in observables and problem is first else 0.5
            many = [errors(problem, jacobian, observables) for jacobian in of_winds]
            times = np.array([minutes_until(*one, power) for one in many])
            ends, sd = errors(problem, middle, observables)
            axes.loglog(ends / 60.0, 100.0 * sd, label=label)
            row = {"schedule": schedule, "instruments": label}
            for goal, column in zip(GOALS, times.T, strict=True):
                row[f"{goal:.0%} [min]"] = (
                    f"{np.median(column):.2g} ({column.min():.2g} to {column.max():.2g})"
                )
            rows.append(row)
            medians.append(np.median(times, 0))
        axes.set(title=schedule, ylim=(0.05, 300.0))
        axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    for axes in all_axes[-1]:
        axes.set_xlabel("minutes of flight")
    for axes in all_axes[:, 0]:
        axes.set_ylabel("error of the thrust per length [%]")
    figure.savefig(HERE / "first_flight.png", dpi=80)
    write("schedules.csv", rows)
    return medians[len(INSTRUMENTS) - 1]


MONITORS = {
    "known exactly": (0.0, 0.0, 0.0, 0.0), "own, well calibrated": (0.10, 0.02, 0.01, 0.002),
    "own, as usual": (0.10, 0.02, 0.05, 0.01), "at L1": (0.30, 0.05, 0.05, 0.01),
}  # fmt: skip
"""Assumed errors of the wind's density and speed: by chance, of hourly means, and of the calibration."""


def hours(sail_minutes):
    """Hours until the thrust factor is known with a monitor of the wind. sail_minutes: until the sail's
    instruments tell the thrust per length as well as each of the goals."""
    rows = []
    for label, (n, u, n0, u0) in MONITORS.items():
        chance, floor = np.hypot(0.5 * n, u), np.hypot(0.5 * n0, u0)
        row = {"monitor of the wind": label, "chance, an hour [%]": 100.0 * chance}
        row["calibration [%]"] = 100.0 * floor
        for goal, minutes in zip(GOALS, sail_minutes, strict=True):
            sail = lambda t, g=goal, m=minutes: g * (m / 60.0 / t) ** 1.5  # noqa: E731
            grid = np.geomspace(1e-2, 1e5, 4000)
            error = np.sqrt(sail(grid) ** 2 + chance**2 / np.maximum(grid, 1.0) + floor**2)
            row[f"{goal:.0%} [h]"] = (
                f"{grid[np.argmax(error <= goal)]:.2g}" if (error <= goal).any() else "never"
            )
        rows.append(row)
    write("hours.csv", rows)


def smooth(z):
    """The smooth step of the voltage laws."""
    z = np.clip(z, 0.0, 1.0)
    return z**3 * (10.0 - 15.0 * z + 6.0 * z**2)


def closed(scene):
    """The mean rate of the spin of straight tethers that are on during half of every turn, for a window
    without edges, N sigma L^2 sin(alpha) / (2 pi I), and for the window of the scene."""
    t, wind, hub = scene.tethers, scene.solar_wind, scene.hub
    sigma = wind.thrust_factor * (scene.voltage.value - wind.cutoff_voltage) * wind.speed
    sigma *= np.sqrt(VACUUM_PERMITTIVITY * PROTON_MASS * wind.number_density)
    arm, root = 0.17 + t.length, 0.17
    each = scene.remote_units.mass * arm**2 + t.density * t.area * (arm**3 - root**3) / 3.0
    inertia = hub.inertia[0][0] + t.count * each
    psi = np.linspace(0.0, 2.0 * np.pi, 8001)
    rise = np.deg2rad(scene.voltage.rise_phase_deg)
    window = smooth(psi / rise) * smooth(1.0 - (psi - np.pi) / rise)
    mean = np.trapezoid(window * np.sin(psi), psi) / (2.0 * np.pi)
    torque = (
        t.count
        * sigma
        * np.sin(np.deg2rad(scene.initial.sailing_angle_deg))
        * (t.length**2 / 2.0 + root * t.length)
    )
    return torque / inertia / np.pi, torque / inertia * mean


def check(problem):
    """One fit of synthetic data with priors of the wind: estimates against the truth."""
    found = problem.solved()
    print(found)
    truth = np.array([p.start for p in problem.parameters])
    write("fit.csv", [
        {"parameter": name, "truth": truth[k], "estimate less truth": found.values[k] - truth[k],
         "sd": found.sd[k], "in standard deviations": (found.values[k] - truth[k]) / found.sd[k],
         "chi squared": f"{found.chi_squared:.0f}", "degrees of freedom": found.degrees_of_freedom}
        for k, name in enumerate(found.parameters)
    ])  # fmt: skip


def main():
    half, pattern = cubesat(), cubesat(PATTERN)
    run = esail.simulate(cubesat({"integrator.t_end": 40.0 * np.pi / 0.05}))
    momentum = np.asarray(run["spin_rate"])[:, 1]
    slope = (momentum[-1] - momentum[0]) / run.time[-1]
    ideal, with_edges = closed(half)
    write("closed.csv", [{
        "run [rad/s^2]": f"{slope:.4g}", "closed, sharp window [rad/s^2]": f"{ideal:.4g}",
        "closed, with edges [rad/s^2]": f"{with_edges:.4g}",
        "run over closed with edges": f"{slope / with_edges:.4f}",
    }])  # fmt: skip
    random = np.random.default_rng(77)
    data = shown(half, random)
    problem = Problem.of(half, data, FREE, NOISE, PRIORS)
    others = {
        "off and on, 100 s": pattern, "chirp": flown(chirp()), "designed": flown(table_in("designed.csv")),
    }  # fmt: skip
    others = {name: Problem.of(x, shown(x), FREE, NOISE, PRIORS) for name, x in others.items()}
    hours(schedules({"half of every turn": problem} | others))
    check(problem)


if __name__ == "__main__":
    main()
