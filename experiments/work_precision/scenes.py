"""The sails of the study, with the methods and settings that run on each."""

import dataclasses

import esail_jax as esail
from esail_jax.commands.benchmark import Curve

STEPS = (0.8, 0.4, 0.2, 0.1, 0.05, 0.025)
TOLERANCES = tuple(10.0**-k for k in range(6, 13))

ENGINEERING = {"tethers.strain": "engineering"}
"""Overrides for the strain measure of Exudyn's cable."""

UNEQUAL = ENGINEERING | {
    "tethers.count": 7,
    "tethers.length": [8e3, 9e3, 10e3, 8.5e3, 9.5e3, 10e3, 9e3],
    "remote_units.mass": [1.5, 1.2, 1.0, 1.4, 1.1, 1.3, 1.6],
    "voltage.value": [20e3, 18e3, 22e3, 15e3, 25e3, 19e3, 21e3],
}


@dataclasses.dataclass(frozen=True)
class Case:
    """A sail and its runs.

    curves: methods of the package with their settings; rk4: step [s] and span [s] of the explicit method;
    exudyn: steps [s] of Exudyn."""

    overrides: dict
    curves: tuple[Curve, ...]
    rk4: tuple[float, float]
    exudyn: tuple[float, ...] = ()

    @property
    def scene(self) -> esail.Scene:
        """The baseline with this case's overrides."""
        return esail.load_scene("baseline", self.overrides)


def curves(steps: tuple[float, ...], tolerances: tuple[float, ...] = TOLERANCES) -> tuple[Curve, ...]:
    """The package's methods with their settings; a new method is one more line."""
    return (
        ("generalized-alpha", "step", steps),
        ("energy-momentum", "step", steps[:3]),
        ("collocation", "tolerance", tolerances),
    )


CASES = {
    # 4710 s are a whole number of all steps.
    "peer": Case(
        ENGINEERING | {"integrator.t_end": 4710.0},
        curves(STEPS[1:5], TOLERANCES[:4]),
        rk4=(0.025, 100.0),
        exudyn=(0.2, 0.1, 0.05),
    ),
    "baseline": Case({}, curves(STEPS), rk4=(0.025, 1570.0)),
    "unequal": Case(
        UNEQUAL | {"integrator.t_end": 4710.0},
        curves(STEPS[1:5], TOLERANCES[:5]),
        rk4=(0.0125, 50.0),
        exudyn=(0.2, 0.1, 0.05),
    ),
    "fine": Case(
        ENGINEERING | {"tethers.elements": 20, "integrator.t_end": 785.0},
        curves(STEPS[1:5], TOLERANCES[:5]),
        rk4=(0.00125, 5.0),
        exudyn=(0.2, 0.1, 0.05),
    ),
}
"""All cases by name. Steps of the explicit method are half to all of the longest stable step."""
