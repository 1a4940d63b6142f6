"""Fits to data of other models: an independent code, and tethers that bend in the wind."""

from pathlib import Path

import numpy as np
from common import HERE, NOISE, small, table

import esail_jax as esail
from esail_jax.identification import fit

GOLDEN = Path(__file__).parents[2] / "tests" / "physics" / "golden"
SEEDS = 4


def independent():
    """Fits to the motion that `reference.py` of the golden tests has integrated, with noise added."""
    exact = dict(np.load(GOLDEN / "unequal.npz"))
    scene = esail.load_scene(str(GOLDEN / "unequal.toml"), {
        "integrator.method": None, "integrator.step": None, "integrator.spectral_radius": None,
        "solar_wind.thrust_factor": 0.18,
    })  # fmt: skip
    noise = {"angular_velocity_B": 1e-7, "coning_angle": 1e-5, "lagging_angle": 1e-5}
    free = ["solar_wind.thrust_factor", "tethers.length[*]", "hub.density"]
    random = np.random.default_rng(7)
    rows, problem = [], None
    for seed in range(SEEDS):
        data = {"time": exact["time"].astype(float)}
        data |= {k: exact[k] + s * random.normal(size=exact[k].shape) for k, s in noise.items()}
        if problem is None:
            found = fit(scene, data, free, noise)
            problem = found.problem
            truth = np.array([p.start for p in problem.parameters])
        else:
            values = np.concatenate([data[k].reshape(len(data["time"]), -1) for k in noise], axis=1)
            found = problem.with_values([values.ravel()]).solved()
        print(found, flush=True)
        pulls = (found.values - truth) / found.sd
        rows += [
            {"fit": seed + 1, "parameter": name, "truth": truth[k],
             "estimate less truth": found.values[k] - truth[k], "sd": found.sd[k],
             "pull": pulls[k], "chi squared": f"{found.chi_squared:.0f}",
             "degrees of freedom": found.degrees_of_freedom}
            for k, name in enumerate(found.parameters)
        ]  # fmt: skip
    table(HERE / "independent.csv", rows)


def straight():
    """Fits of tethers of one straight, nearly inextensible truss to data of tethers of eight trusses."""
    random = np.random.default_rng(8)
    times = np.arange(2.5, 150.1, 2.5)
    truth = esail.simulate(
        small({"tethers.elements": 8}), save=tuple(n.partition("[")[0] for n in NOISE), times=times.tolist()
    )
    data = {"time": times}
    for name, sd in NOISE.items():
        exact = np.asarray(truth[name.partition("[")[0]])
        exact = exact[:, 0] if name.endswith("[1]") else exact
        data[name] = exact + sd * random.normal(size=exact.shape)
    rigid = small(
        {"tethers.elements": 1, "tethers.youngs_modulus": 7e12, "tethers.axial_damping_time": 0.05}
    )
    free = ["solar_wind.thrust_factor", "tethers.length", "hub.torque[1]", "hub.inertia[1,1]"]
    found = fit(rigid, data, free, NOISE)
    print(found)
    start = np.array([p.start for p in found.problem.parameters])
    table(HERE / "straight.csv", [
        {"parameter": name, "truth": start[k], "estimate less truth": found.values[k] - start[k],
         "relative [%]": 100.0 * (found.values[k] / start[k] - 1.0), "sd": found.sd[k],
         "in standard deviations": (found.values[k] - start[k]) / found.sd[k],
         "chi squared": f"{found.chi_squared:.0f}", "degrees of freedom": found.degrees_of_freedom}
        for k, name in enumerate(found.parameters)
    ])  # fmt: skip


def main():
    independent()
    straight()
