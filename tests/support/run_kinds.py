"""Scenes of the three kinds of method, for the tests of run files."""

from typing import Any, NamedTuple

import h5py

from esail_jax.steppers.collocation import Collocation
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.steppers.runge_kutta import RungeKutta
from support import small_chain, small_sail

OBSERVABLES = {
    "coning_angle": "tether", "lagging_angle": "tether", "root_coning_angle": "tether",
    "root_lagging_angle": "tether", "tether_length": "tether", "max_axial_strain": "tether",
    "angular_velocity_B": "3", "euler_hub": "3", "euler_sail": "3", "sailing_angle": "",
    "precession_angle": "", "tip_position_I": "tether 3", "hub_position_I": "3", "rotation_IB": "3 3",
    "thrust_O": "3", "thrust_moment_O": "3", "reaction_O": "3", "reaction_moment_O": "3",
    "thrust_B": "tether 3", "thrust_moment_B": "tether 3", "reaction_B": "tether 3",
    "thrust_angle": "", "reaction_angle": "", "kinetic_energy": "", "elastic_energy": "",
    "dissipated_power": "", "external_power": "", "dissipated_energy": "", "external_work": "",
    "energy_balance_error": "", "smallest_tether_distance": "",
}  # fmt: skip
"""Observables of a sail with a hub, and their axes after time."""

CHAIN = small_chain.TEXT.replace("[0.1, 0.2, 0.1]", "0.1").replace("interval = 0.02", "interval = 0.007")
CHAIN = CHAIN.replace("t_end = 1.0", 'method = "dopri8"\nt_end = 1.6')
"""The small chain with equal rods and an explicit method."""

AUTOMATIC = small_sail.TEXT.replace("t_end = 80.0\nstep = 0.1", "t_end = 4000.0").replace("0.35", "17.5")
"""The small sail with the default method, whose steps are about a hundred times as long."""


class Kind(NamedTuple):
    """A method: a scene with 230 saved instants, its stepper, and the factor to all times of the tests."""

    text: str
    stepper: Any
    scale: float


KINDS = {
    "generalized-alpha": Kind(small_sail.TEXT, GeneralizedAlpha, 1.0),
    "collocation": Kind(AUTOMATIC, Collocation, 50.0),
    "dopri8": Kind(CHAIN, RungeKutta, 0.02),
}

SHORT_CALLS = {"MAX_ATTEMPTS": 320, "MAX_INSTANTS": 100}
"""Limits of a compiled call in these tests, so that runs of 230 instants consist of several calls. A call
of generalized-alpha ends between two saved instants."""


def check_start_of(path, other):
    """Checks that a file is consistent: all datasets have equally many rows, which are bit-identical to
    `other`'s."""
    with h5py.File(path, "r") as a, h5py.File(other, "r") as b:
        rows = a["time"].shape[0]
        for group in ("observables", "numerics"):
            for name, data in a[group].items():
                assert data.shape[0] == rows
                assert data[()].tobytes() == b[group][name][:rows].tobytes(), f"{name} differs"
        assert a["time"][()].tobytes() == b["time"][:rows].tobytes()
        return rows
