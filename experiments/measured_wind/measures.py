"""What the tables of this folder hold: statistics of a wind, and numbers of a run."""

import csv
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import esail_jax as esail
from esail_jax.calendar.frames import to_equatorial
from esail_jax.constants import ASTRONOMICAL_UNIT, PROTON_MASS, SOLAR_MU, THRUST_FACTOR, VACUUM_PERMITTIVITY

DAY = 86400.0
SIX_HOURS = 36
"""Rows of a run in a row of month.csv."""


def write(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Writes a table and prints it."""
    rows = [{k: f"{x:.5g}" if isinstance(x, float) else x for k, x in row.items()} for row in rows]
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, rows[0], lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    print(path.name, *rows[:9], sep="\n  ", flush=True)


# ---- the wind -------------------------------------------------------------------------------------


def wind_of(scene: esail.Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Instants [s], the middles of the saved intervals, with the wind of a scene at 1 au there: speed [m/s]
    and density [1/m^3]."""
    wind, interval = scene.solar_wind, scene.output.interval
    time = np.arange(0.5 * interval, scene.integrator.t_end, interval)
    if wind.time is None:
        return time, np.full(len(time), wind.speed), np.full(len(time), wind.number_density)
    return time, np.interp(time, wind.time, wind.speed), np.interp(time, wind.time, wind.number_density)


def memory(values: np.ndarray, interval: float) -> float:
    """Time [h] after which a series is correlated with itself by 1/e. interval: between its values [s]."""
    x = values - values.mean()
    for lag in range(1, len(x)):
        if x[lag:] @ x[:-lag] / (len(x) - lag) < np.exp(-1.0) * (x @ x) / len(x):
            return lag * interval / 3600.0
    return np.inf


def wind_rows(scene: esail.Scene) -> list[dict[str, Any]]:
    """Statistics of speed, density and of sqrt(n) u, which the thrust is proportional to, in the month."""
    time, speed, density = wind_of(scene)
    series = {
        "speed [km/s]": 1e-3 * speed,
        "density [1/cm^3]": 1e-6 * density,
        "sqrt(density) speed [km/s cm^-1.5]": 1e-6 * np.sqrt(density) * speed,
    }
    return [
        {"quantity": name, "mean": float(x.mean()), "standard deviation": float(x.std())}
        | {f"{q} %": float(np.quantile(x, q / 100)) for q in (5, 25, 50, 75, 95)}
        | {"least": float(x.min()), "largest": float(x.max()), "of its logarithm": float(np.log(x).std())}
        | {"memory [h]": memory(x, time[1] - time[0])}
        for name, x in series.items()
    ]


# ---- a run ----------------------------------------------------------------------------------------


def mass_of(scene: esail.Scene) -> float:
    """Mass [kg] of the whole sail."""
    t, hub = scene.tethers, scene.hub
    tether = t.density * t.area * t.length + scene.remote_units.mass
    return t.count * tether + hub.density * np.pi * hub.radius**2 * hub.height


def mean(values: np.ndarray) -> Any:
    """Time mean of equidistant rows, by the trapezoidal rule."""
    return (values[:-1] + values[1:]).mean(0) / 2.0


def angle_of(run: esail.Solution) -> np.ndarray:
    """Angle [deg] of the normal of the plane of the tips to the direction away from the Sun, positive
    towards the direction of flight."""
    tips = np.asarray(run["tip_position_I"])
    arms = tips - tips.mean(1, keepdims=True)
    normal = np.cross(arms, np.roll(arms, -1, axis=1)).sum(1)
    out = np.asarray(run["heliocentric_position"])
    out = out / np.linalg.norm(out, axis=1)[:, None]
    ahead = np.cross([0.0, 0.0, 1.0], out)
    return np.rad2deg(np.arctan2((normal * ahead).sum(1), (normal * out).sum(1)))


def signals(run: esail.Solution) -> dict[str, np.ndarray]:
    """What tables and figures show, at every saved instant. Coning is the mean over the tethers."""
    return {
        "thrust_mN": 1e3 * np.linalg.norm(run["thrust_O"], axis=1),
        "coning_deg": np.rad2deg(np.asarray(run["coning_angle"])).mean(1),
        "power_W": np.asarray(run["electric_power"]),
        "angle_deg": angle_of(run),
        "voltage_kV": 1e-3 * np.asarray(run["voltage"]).mean(1),
    }


def moved_by_thrust(run: esail.Solution) -> float:
    """Distance [m] at the end from a body that starts alike and is attracted by the Sun only."""
    start = np.concatenate([run["heliocentric_position"][0], run["heliocentric_velocity"][0]])
    found = solve_ivp(
        lambda _, y: np.concatenate([y[3:], -SOLAR_MU * y[:3] / np.linalg.norm(y[:3]) ** 3]),
        (0.0, run.time[-1]), start, "DOP853", rtol=1e-12, atol=1e-3,
    )  # fmt: skip
    return float(np.linalg.norm(found.y[:3, -1] - run["heliocentric_position"][-1]))


def rigid_thrust(run: esail.Solution, scene: esail.Scene) -> np.ndarray:
    """Thrust [mN] of a flat rigid sail with the angle, the mean voltage and the distance from the Sun of a
    run, in its wind, as the mean over a turn: N L sigma sqrt(1 + 3 cos^2 alpha) / 2."""
    wind, t = scene.solar_wind, scene.tethers
    speed, density = wind.speed, wind.number_density
    if wind.time is not None:
        speed, density = (np.interp(run.time, wind.time, x) for x in (speed, density))
    nearness = ASTRONOMICAL_UNIT / np.linalg.norm(run["heliocentric_position"], axis=1)
    of = signals(run)
    plasma = np.sqrt(VACUUM_PERMITTIVITY * PROTON_MASS * density) * nearness
    load = THRUST_FACTOR * (1e3 * of["voltage_kV"] - wind.cutoff_voltage) * plasma * speed
    cosine = np.cos(np.deg2rad(of["angle_deg"]))
    return 1e3 * t.count * t.length * load * np.sqrt(1.0 + 3.0 * cosine**2) / 2.0


def result_row(name: str, run: esail.Solution, scene: esail.Scene) -> dict[str, Any]:
    """The row of a case in results.csv."""
    of, end, mass = signals(run), run.time[-1], mass_of(scene)
    push = mean(np.asarray(run["thrust_O"])) * end / mass
    coning = np.rad2deg(np.asarray(run["coning_angle"]))
    volts = 1e-3 * np.asarray(run["voltage"])
    ordinary = {
        f"{key}, {q} %": float(np.quantile(x, q / 100))
        for key, x in of.items()
        if key in ("thrust_mN", "coning_deg", "power_W")
        for q in (5, 50, 95)
    }
    axis = np.asarray(run["orbital_elements"])[:, 0]
    return {
        "case": name,
        "delta_v [m/s]": float(mean(1e-3 * of["thrust_mN"])) * end / mass,
        "away from the Sun [m/s]": float(push[2]),
        "along the flight [m/s]": float(push[0]),
        "thrust, mean [mN]": float(mean(of["thrust_mN"])),
        "thrust, largest [mN]": float(of["thrust_mN"].max()),
        **ordinary,
        "coning of a tether, least [deg]": float(coning.min()),
        "coning of a tether, largest [deg]": float(coning.max()),
        "lagging, largest [deg]": float(np.rad2deg(np.abs(run["lagging_angle"])).max()),
        "power, mean [W]": float(mean(of["power_W"])),
        "power, largest [W]": float(of["power_W"].max()),
        "voltage, least [kV]": float(volts.min()),
        "voltage, largest [kV]": float(volts.max()),
        "angle, mean [deg]": float(mean(of["angle_deg"])),
        "angle, least [deg]": float(of["angle_deg"].min()),
        "angle, largest [deg]": float(of["angle_deg"].max()),
        "angle at the end [deg]": float(of["angle_deg"][-1]),
        "spin at the end, of that at the start": float(run["spin_rate"][-1, 1] / run["spin_rate"][0, 1]),
        "moved by the thrust [1000 km]": 1e-6 * moved_by_thrust(run),
        "semi-major axis, change [1000 km]": 1e-6 * float(axis[-1] - axis[0]),
        "rigid sail, mean thrust": float(mean(rigid_thrust(run, scene)) / mean(of["thrust_mN"])),
        "energy balance, of the work": f"{energy_error(run):.1e}",
        "steps": run.stats["steps"],
        "wall time [s]": round(run.stats["wall_time"]),
    }


def energy_error(run: esail.Solution) -> float:
    """Largest error of the energy balance over the work of the thrust."""
    return float(np.abs(run["energy_balance_error"]).max() / np.abs(run["external_work"]).max())


def apart_row(name: str, run: esail.Solution, other: esail.Solution) -> dict[str, Any]:
    """By how much a run is apart from another one, of the same start, until its end."""
    count = len(run.time)
    one, two = signals(run), {key: x[:count] for key, x in signals(other).items()}
    places = [np.asarray(x["heliocentric_position"])[count - 1] for x in (run, other)]
    lags = [np.rad2deg(np.asarray(x["lagging_angle"])[:count]) for x in (run, other)]
    row = {"case": name, "days": float(run.time[-1] / DAY)}
    row["mean thrust, relative"] = float(mean(one["thrust_mN"]) / mean(two["thrust_mN"]) - 1.0)
    row["mean power, relative"] = float(mean(one["power_W"]) / mean(two["power_W"]) - 1.0)
    for key in ("thrust_mN", "power_W", "coning_deg", "angle_deg"):
        row[f"{key}, at most"] = float(np.abs(one[key] - two[key]).max())
    row["lagging_deg, at most"] = float(np.abs(lags[0] - lags[1]).max())
    row["place at the end [km]"] = 1e-3 * float(np.linalg.norm(places[0] - places[1]))
    return row


def month_rows(flights: dict[str, esail.Solution], scene: esail.Scene) -> list[dict[str, Any]]:
    """Means over six hours: the wind, and the signals of some cases."""
    _, speed, density = wind_of(scene)

    def means(x: np.ndarray) -> np.ndarray:
        return x[: len(x) // SIX_HOURS * SIX_HOURS].reshape(-1, SIX_HOURS).mean(1)

    columns = {"speed_km_s": means(1e-3 * speed), "density_cm3": means(1e-6 * density)}
    for name, run in flights.items():
        for key, values in signals(run).items():
            columns[f"{name}: {key}"] = means((values[:-1] + values[1:]) / 2.0)
    rows = zip(*(x.tolist() for x in columns.values()), strict=True)
    return [{"day": (k + 0.5) / 4.0} | dict(zip(columns, row, strict=True)) for k, row in enumerate(rows)]


def prediction_rows(
    wind: esail.Scene, changing: dict[str, Any], steady: dict[str, Any]
) -> list[dict[str, Any]]:
    """By how much the mean wind is off, factor by factor. wind: a scene with the series; changing, steady:
    rows of results.csv with the series and with its means."""
    time, u, n = wind_of(wind)
    root, left = np.sqrt(n), time[::-1]
    least, volts, most = wind.solar_wind.cutoff_voltage, wind.voltage.value, wind.voltage.maximum
    steady_volts = np.minimum(least + (volts - least) * (root * u).mean() / (root * u), most)
    found = {
        "mean sqrt(n) / sqrt(mean n): the root is concave": root.mean() / np.sqrt(n.mean()),
        "mean sqrt(n) u / (mean sqrt(n) mean u): density against speed": (root * u).mean()
        / (root.mean() * u.mean()),
        "their product": (root * u).mean() / (np.sqrt(n.mean()) * u.mean()),
        "the same, weighted with the time that is left": (root * u * left).sum()
        / (np.sqrt(n.mean()) * u.mean() * left.sum()),
        "correlation of ln n and ln u": np.corrcoef(np.log(n), np.log(u))[0, 1],
        "the same product with medians in place of means": (root * u).mean()
        / (np.sqrt(np.median(n)) * np.median(u)),
        "constant thrust instead of constant voltage: mean power": (n * steady_volts**1.5).mean()
        / (n * volts**1.5).mean(),
        "constant thrust instead of constant voltage: largest power": (n * steady_volts**1.5).max()
        / (n * volts**1.5).max(),
    }
    for key in (
        "thrust, mean [mN]", "delta_v [m/s]", "away from the Sun [m/s]", "along the flight [m/s]",
        "coning_deg, 50 %", "coning_deg, 95 %", "power, mean [W]", "power, largest [W]",
        "moved by the thrust [1000 km]", "semi-major axis, change [1000 km]",
    ):  # fmt: skip
        found[f"run: {key}, series over mean wind"] = changing[key] / steady[key]
    return [{"quantity": key, "value": float(x)} for key, x in found.items()]


# ---- messages -------------------------------------------------------------------------------------


def messages_rows(file: Path, run: esail.Solution) -> list[dict[str, Any]]:
    """Exports a run file as OEM and AEM by `esail export`, reads them with `oem` and `ccsds-ndm`, and
    compares them with the run."""
    from ccsds_ndm.ndm_io import NdmIo
    from oem import OrbitEphemerisMessage
    from scipy.spatial.transform import Rotation

    from esail_jax.calendar.frames import attitude_to_equatorial

    said = {}
    for kind in (".oem", ".aem"):
        command = ["export", str(file), "-o", str(file.with_suffix(kind)), "--object", "SAIL 1"]
        call = [sys.executable, "-m", "esail_jax", *command, "--overwrite"]
        said[kind] = subprocess.run(call, check=True, capture_output=True, text=True).stdout.split("\n")[1]
    position, velocity = (
        to_equatorial(np.asarray(run[f"heliocentric_{name}"])) for name in ("position", "velocity")
    )
    states = list(next(iter(OrbitEphemerisMessage.open(file.with_suffix(".oem")))))
    seconds = np.array([(x.epoch - states[0].epoch).sec for x in states])
    read = {
        "oem": tuple(1e3 * np.array([getattr(x, key) for x in states]) for key in ("position", "velocity"))
    }
    (segment,) = NdmIo().from_path(file.with_suffix(".oem")).body.segment
    numbers = np.array([
        [float(getattr(x, key).value) for key in ("x", "y", "z", "x_dot", "y_dot", "z_dot")]
        for x in segment.data.state_vector
    ])  # fmt: skip
    read["ccsds-ndm"] = (1e3 * numbers[:, :3], 1e3 * numbers[:, 3:])
    (segment,) = NdmIo().from_path(file.with_suffix(".aem")).body.segment
    parts = [x.quaternion_state.quaternion for x in segment.data.attitude_state]
    turns = Rotation.from_quat(np.array([[x.q1, x.q2, x.q3, x.qc] for x in parts], float))
    exact = Rotation.from_matrix(attitude_to_equatorial(np.asarray(run["rotation_IB"])))
    rows = [{"message": "OEM", "reader": "oem", "what": "dates [s]",
             "largest difference": float(np.abs(seconds - run.time).max())}]  # fmt: skip
    for reader, found in read.items():
        for what, x, y in zip(("position [m]", "velocity [m/s]"), found, (position, velocity), strict=True):
            apart = float(np.abs(x - y).max())
            rows.append({"message": "OEM", "reader": reader, "what": what, "largest difference": apart})
    apart = float((turns * exact.inv()).magnitude().max())
    rows.append(
        {"message": "AEM", "reader": "ccsds-ndm", "what": "attitude [rad]", "largest difference": apart}
    )
    for kind in said:
        print(f"{kind}: {said[kind]}")
    return rows
