"""A small ensemble, and the command that computes it."""

import numpy as np

from esail_jax.ensembles import Ensemble

SMALL = {
    "tethers.count": 3,
    "tethers.elements": 2,
    "integrator.t_end": 200.0,
    "output.interval": 20.0,
}
VARY = ("tethers.length[*]=normal:10e3:10", "initial.spin_rate=uniform:3.9e-3:4.1e-3")


def arguments(folder, members=12, seed=3, vary=VARY, **more):
    found = ["ensemble", "baseline", "-o", str(folder), "--members", str(members), "--seed", str(seed)]
    for text in vary:
        found += ["--vary", text]
    for key, value in SMALL.items():
        found += ["--set", f"{key}={value}"]
    for name, value in more.items():
        found += [f"--{name}"] + ([] if value is True else [str(value)])
    return [*found, "--quiet"]


def same(a, b):
    """Tells whether two ensembles are bit-identical; NaN equals NaN."""
    return all(np.array_equal(a[name], b[name], equal_nan=True) for name in a.observables)


def made_up(scene, members, inputs, messages=None, complete=None):
    """An ensemble without a run: the coning angle is the number of the member [rad]."""
    numbers = np.asarray(members)
    rows = {"coning_angle": np.broadcast_to(numbers[:, None, None] + 0.0, (len(numbers), 11, 3))}
    complete = np.ones(len(numbers), bool) if complete is None else np.array(complete)
    messages = tuple(messages or [""] * len(numbers))
    return Ensemble(
        scene, numbers, np.linspace(0.0, 200.0, 11), inputs, rows, complete, messages, 10.0 + 0.0 * numbers
    )
