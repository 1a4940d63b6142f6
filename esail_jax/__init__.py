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

import importlib
import importlib.util
import os
import sys
from typing import TYPE_CHECKING, Any

from esail_jax.compilation.workaround import set_flag

set_flag()
if "jax" in sys.modules:
    sys.modules["jax"].config.update("jax_enable_x64", True)
else:
    os.environ["JAX_ENABLE_X64"] = "1"  # JAX reads it when it is imported

if TYPE_CHECKING:
    from esail_jax.compilation.jit import jit
    from esail_jax.compilation.kept import clear_caches
    from esail_jax.errors import SceneError, SimulationError
    from esail_jax.files.export import export
    from esail_jax.files.opening import RunFileError
    from esail_jax.files.run_file import load, save
    from esail_jax.modal.sail_modes import modes
    from esail_jax.modal.table import ModeTable
    from esail_jax.plotting import plot
    from esail_jax.scenes.chain import Chain
    from esail_jax.scenes.deployment import ChainDeployment, Deployment
    from esail_jax.scenes.hub import Hub
    from esail_jax.scenes.integration import Integrator, Output
    from esail_jax.scenes.loading import load_scene
    from esail_jax.scenes.plasma import ChainWind, PlasmaBrake, SolarWind
    from esail_jax.scenes.scene import Scene
    from esail_jax.scenes.start_and_place import ChainInitial, Gravity, HeliocentricOrbit, Initial, Orbit
    from esail_jax.scenes.tethers import AuxiliaryTethers, Event, RemoteUnits, Tethers, Thermal, TipThrust
    from esail_jax.scenes.voltage import ChainVoltage, Voltage
    from esail_jax.simulation.simulate import run, simulate
    from esail_jax.simulation.solution import Solution
    from esail_jax.steppers.results import RESULTS
    from esail_jax.viewing.showing import animate, view
    from esail_jax.wind_files.tables import wind

__version__ = "0.2.0"

__all__ = [
    "RESULTS",
    "AuxiliaryTethers",
    "Chain",
    "ChainDeployment",
    "ChainInitial",
    "ChainVoltage",
    "ChainWind",
    "Deployment",
    "Event",
    "Gravity",
    "HeliocentricOrbit",
    "Hub",
    "Initial",
    "Integrator",
    "ModeTable",
    "Orbit",
    "Output",
    "PlasmaBrake",
    "RemoteUnits",
    "RunFileError",
    "Scene",
    "SceneError",
    "SimulationError",
    "SolarWind",
    "Solution",
    "Tethers",
    "Thermal",
    "TipThrust",
    "Voltage",
    "animate",
    "clear_caches",
    "export",
    "jit",
    "load",
    "load_scene",
    "modes",
    "plot",
    "run",
    "save",
    "simulate",
    "view",
    "wind",
]


MODULES = {
    "compilation.jit": ("jit",),
    "compilation.kept": ("clear_caches",),
    "errors": ("SceneError", "SimulationError"),
    "files.export": ("export",),
    "files.opening": ("RunFileError",),
    "files.run_file": ("load", "save"),
    "modal.sail_modes": ("modes",),
    "modal.table": ("ModeTable",),
    "plotting": ("plot",),
    "scenes.chain": ("Chain",),
    "scenes.deployment": ("ChainDeployment", "Deployment"),
    "scenes.hub": ("Hub",),
    "scenes.integration": ("Integrator", "Output"),
    "scenes.plasma": ("ChainWind", "PlasmaBrake", "SolarWind"),
    "scenes.loading": ("load_scene",),
    "scenes.scene": ("Scene",),
    "scenes.start_and_place": ("ChainInitial", "Gravity", "HeliocentricOrbit", "Initial", "Orbit"),
    "scenes.tethers": ("AuxiliaryTethers", "Event", "RemoteUnits", "Tethers", "Thermal", "TipThrust"),
    "scenes.voltage": ("ChainVoltage", "Voltage"),
    "simulation.simulate": ("run", "simulate"),
    "simulation.solution": ("Solution",),
    "steppers.results": ("RESULTS",),
    "viewing.showing": ("animate", "view"),
    "wind_files.tables": ("wind",),
}
"""The modules that define the public names."""

HOME = {name: module for module, names in MODULES.items() for name in names}
"""The module of every public name."""


def __getattr__(name: str) -> Any:
    """Imports a public name, or a package such as `design`, when it is first used: a command that computes
    nothing imports no JAX."""
    module = f"{__name__}.{HOME.get(name, name)}"
    if name not in HOME and (name.startswith("_") or importlib.util.find_spec(module) is None):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = importlib.import_module(module)
    if name in HOME:
        found = getattr(found, name)
        globals()[name] = found
    return found


PACKAGES = ("control", "design", "ensembles", "identification", "loads", "modal", "plotting", "terms")
"""Packages and modules that users import: `esail.design`, for example."""


def __dir__() -> list[str]:
    return sorted({*__all__, *PACKAGES, "__version__"})
