"""A small ensemble, and the command that computes it."""

import numpy as np

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
