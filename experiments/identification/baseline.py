"""Seconds of a fit of three parameters of the baseline to a thousand rows."""

import numpy as np
from common import HERE, Timer, table

import esail_jax as esail
from esail_jax.identification.fit import Problem

FREE = ["solar_wind.thrust_factor", "tethers.length", "hub.density"]
NOISE = {"spin_rate[1]": 1e-7, "coning_angle": 1e-4, "sailing_angle": 1e-4}
START = np.array([1.05, 1.002, 0.98])


def main():
    scene = esail.load_scene("baseline", {"solar_wind.thrust_factor": 0.18})
    times = np.linspace(0.0, 4712.0, 1001)[1:]
    run = esail.simulate(scene, save=("spin_rate", "coning_angle", "sailing_angle"), times=times.tolist())
    random, data = np.random.default_rng(11), {"time": times}
    for name, sd in NOISE.items():
        exact = np.asarray(run[name.partition("[")[0]])
        exact = exact[:, 0] if name.endswith("[1]") else exact
        data[name] = exact + sd * random.normal(size=exact.shape)
    timer = Timer()
    problem = Problem.of(scene, data, FREE, NOISE)
    truth = np.array([p.start for p in problem.parameters])
    problem.models[0](truth)
    compiling, timer = timer.read(), Timer()
    found = problem.solved(truth * START)
    fitting = timer.read()
    print(found)
    table(HERE / "baseline.csv", [{
        "rows": len(times), "cells": len(problem.cells[0].values), "steps of a run": run.steps,
        "compiling, wall [s]": compiling[0], "compiling, process [s]": compiling[1],
        "fitting, wall [s]": fitting[0], "fitting, process [s]": fitting[1],
        "runs with derivatives": found.evaluations,
        "estimates less truth, in sd": " ".join(f"{x:.2f}" for x in (found.values - truth) / found.sd),
        "chi squared": f"{found.chi_squared:.0f}", "degrees of freedom": found.degrees_of_freedom,
    }])  # fmt: skip
