"""Comparison with time-exact references of an independent code (`physics/golden/README.md`)."""

from pathlib import Path

import numpy as np

GOLDEN = Path(__file__).parents[1] / "physics" / "golden"

REFERENCE = "independent code, quaternion hub, Runge-Kutta of order 8"

FAST = ("root_coning_angle", "root_lagging_angle", "tether_length", "elastic_energy")
"""Signals that contain the fast modes. Their tolerance, like that of the reactions, is ten times larger."""

SUMS = ("reaction_O", "thrust_moment_O")
"""Sums over the tethers that cancel to one thousandth in the two symmetric sails. There only the values of
single tethers are compared."""


def errors(solution, reference):
    """The largest error of every signal divided by the signal's range.

    The range is taken over time and components, and is at least 1e-3 of the signal's magnitude.
    """
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
