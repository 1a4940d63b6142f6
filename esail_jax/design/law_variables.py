"""The variables that a voltage law offers to a design."""

from typing import Any

import numpy as np

from esail_jax.design.objective import check_voltage
from esail_jax.design.problem import Variable
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene

HARMONICS = 2
"""Number of harmonics that a scene with constant voltage gets."""

SCALES = {
    "harmonic": {"cosine": 0.1, "sine": 0.1},
    "piecewise-linear": {"table": 1.0},
    "feedback": {"gain": 1.0},
    "on-off": {"on": 10.0, "rise_time": 10.0},
}
"""By voltage law: the keys of `[voltage]` that a design chooses, and their scales (seconds for `on` and
`rise_time`, otherwise without unit)."""


def with_free_law(scene: Scene) -> Scene:
    """The scene with a law that has variables: a constant voltage becomes a harmonic law of zero amplitude.

    Raises SceneError for a scene that is no sail with a voltage, and for a law without variables."""
    check_voltage(scene)
    if scene.voltage.law == "constant":
        zeros = [0.0] * HARMONICS
        return scene.replace({"voltage.law": "harmonic", "voltage.cosine": zeros, "voltage.sine": zeros})
    if scene.voltage.law not in SCALES:
        known = ", ".join(SCALES)
        raise SceneError("voltage.law", f"be one of {known} for a design", f'is "{scene.voltage.law}"')
    return scene


def law_variables(scene: Scene) -> dict[str, Variable]:
    """Variables of the scene's law, by scene key, which start at the scene's values.

    A table stays between 0 and the maximum voltage."""
    table, variables = scene.voltage, {}
    for name, scale in SCALES[table.law].items():
        start = getattr(table, name)
        bounds: dict[str, Any] = {}
        if name == "table":
            top = 1.0 if table.maximum is None else float(table.maximum / np.max(np.asarray(table.value)))
            bounds = {"lower": 0.0, "upper": top}
        if start is not None:
            variables[f"voltage.{name}"] = Variable(start, scale, **bounds)
    return variables
