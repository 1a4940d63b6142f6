"""Auxiliary tethers: exact cases, an independent simulator, conservation, and derivatives."""

import numpy as np
import pytest

from support.ring_sail import TIGHT, reference, ring_scene
import esail_jax as esail

REFERENCE = "independent NumPy code (`support/ring_reference.py`), Dormand & Prince 8(5,3)"

RINGS = {
    "trusses": {"auxiliary_tethers.elements": 2},
    "cables": {"auxiliary_tethers.element": "cable", "tethers.element": "cable", "tethers.elements": 1},
    "slack": {
        # Voltages that pull the tips apart by metres: two segments go slack and taut again.
        "auxiliary_tethers.slack_strain": [1e-4, 2e-4, 1e-4, 3e-4, 1e-4],
        "auxiliary_tethers.length": [1174.0, 1180.0, 1176.0, 1181.0, 1174.5],
        "auxiliary_tethers.strain": "green-lagrange",
    },
}


def range_errors(solution, exact):
    """Largest error of every signal over the range of that signal, over time and components."""
    return {
        name: np.abs(np.asarray(solution[name]) - values).max() / np.ptp(values)
        for name, values in exact.items()
    }


@pytest.mark.parametrize("ring", RINGS)
def test_run_follows_an_independent_integration(ring, validate):
    """Every signal of five unequal tethers with a ring agrees with the independent code to 1e-6 of its range.

    The tolerance of issue and of both codes: positions are good to 1e-9 m or better, ranges of elongation
    are a few millimetres."""
    scene = ring_scene(RINGS[ring] | TIGHT)
    solution = esail.simulate(scene)
    exact = reference(scene).run(np.asarray(solution.time))
    found = range_errors(solution, exact)
    worst = max(found, key=found.get)
    print(found)
    quantity = f"worst of {len(found)} signals / range"
    validate(f"RING-{ring}", f"five unequal tethers, ring of {ring}", REFERENCE, quantity, found[worst], 1e-6)
