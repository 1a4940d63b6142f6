"""Differentiable simulation of electric solar-wind sails and tethered satellites.

    M q'' + Phi_q(q)^T lam = Q(t, q, q'),    Phi(q) = 0,    Q = -dU/dq - dR/dq' + Q_load

Inertias give M (`elements/tether.py`, `elements/rigid_body.py`), energies give U and dissipation
functions R (`elements/axial.py`, `elements/bending.py`), loads give Q_load (`loads/`), rigidity and
joints give Phi (`elements/rigid_body.py`, `joints/`). A *system* is the sum of the terms a scene
lists (`system.py`); `iteration_matrix.py` assembles the matrix of its implicit steps. A chain of rods is
a system too, with coordinates of its own (`rod_chain.py`). A *stepper* advances it
(`steppers/`), *observables* are evaluated at saved instants (`observables/`), and a *solution* contains
them (`simulation/simulate.py`).
"""

from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

from esail_jax.compiler import jit  # noqa: E402
from esail_jax.files.run_file import RunFileError, load, save  # noqa: E402
from esail_jax.scenes.chain_tables import Chain, ChainInitial, ChainVoltage, ChainWind, Orbit  # noqa: E402
from esail_jax.scenes.common_tables import Gravity, Integrator, Output  # noqa: E402
from esail_jax.scenes.rules import SceneError  # noqa: E402
from esail_jax.scenes.sail_tables import (  # noqa: E402
    Event,
    Hub,
    Initial,
    RemoteUnits,
    SolarWind,
    Tethers,
    Voltage,
)
from esail_jax.scenes.scene import Scene, load_scene  # noqa: E402
from esail_jax.simulation.results import SimulationError  # noqa: E402
from esail_jax.simulation.simulate import run, simulate  # noqa: E402
from esail_jax.simulation.solution import Solution  # noqa: E402
from esail_jax.steppers.results import RESULTS  # noqa: E402

__version__ = "0.1.0"

__all__ = [
    "RESULTS",
    "Chain",
    "ChainInitial",
    "ChainVoltage",
    "ChainWind",
    "Event",
    "Gravity",
    "Hub",
    "Initial",
    "Integrator",
    "Orbit",
    "Output",
    "RemoteUnits",
    "RunFileError",
    "Scene",
    "SceneError",
    "SimulationError",
    "SolarWind",
    "Solution",
    "Tethers",
    "Voltage",
    "jit",
    "load",
    "load_scene",
    "plot",
    "run",
    "save",
    "simulate",
]


def __getattr__(name: str) -> Any:
    """Imports `plot` when it is first used, so that `import esail_jax` does not import matplotlib."""
    if name == "plot":
        from esail_jax.plotting import plot

        return plot
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
