"""Comparison with the time-exact references of an independent code (`physics/golden/README.md`)."""

from pathlib import Path

import numpy as np

GOLDEN = Path(__file__).parents[1] / "physics" / "golden"

REFERENCE = "independent code, quaternion hub, Runge-Kutta of order 8"

FAST = ("root_coning_angle", "root_lagging_angle", "tether_length", "elastic_energy")
"""Signals that carry the fast modes: like the reactions, ten times the tolerance of the others."""

SUMS = ("reaction_O", "thrust_moment_O")
"""Cancel to one thousandth between the opposite tethers of the two symmetric sails, where only the
tethers' own are compared."""


def errors(solution, reference):
    """Largest difference of every signal over its range; the range is over time and components,
    and at least 1e-3 of the signal's magnitude."""
    found = {}
    picked = np.searchsorted(solution.time, reference["time"] - 1e-6)
    for name in reference.files:
        if name in ("time", "hub_position_I") or name not in solution.observables:
            continue
        exact, ours = reference[name], np.asarray(solution[name])[picked]
        difference = ours - exact
        if name == "euler_hub":
            difference = (difference + np.pi) % (2 * np.pi) - np.pi
        magnitude = np.abs(exact).max()
        found[name] = np.abs(difference).max() / max(np.ptp(exact), 1e-3 * magnitude, 1e-12)
    return found
