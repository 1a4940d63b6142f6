"""The system whose equilibrium the modes of a scene refer to: its loads, averaged over one turn.

In the frame that turns with the sail, the part of a uniform wind across the spin axis rotates once a turn.
The thrust is linear in the wind's velocity, hence its mean over a turn at a fixed shape is that of the part
along the axis, u cos(alpha). At alpha = 0 nothing is left out. Weight accelerates a free sail as a whole
and has no effect on its shape; of the weight on a sail without a hub the part along the axis is kept.

Axial and radial forces on the remote units turn with the sail and are steady. Two loads leave no steady
state, because they have a moment about the spin axis: tangential forces on the remote units, sum F_i rho_i
with the distance rho from the axis, and a wind that is felt relative to the tethers, -(sigma/u) Omega times
the integral of rho^2 along them, at any sailing angle.
"""

import dataclasses

import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Rotation
from esail_jax.environment.solar_wind import SteadyWind
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.fields import UniformGravity
from esail_jax.scenes.deployment import check_starts_at_rest
from esail_jax.scenes.own_terms import OWN_TERMS, kind_of
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.tethers import TipThrust
from esail_jax.system import System
from esail_jax.terms import Field, find_term


def check_has_modes(scene: Scene) -> None:
    """Raises SceneError, with one line, if the scene has no steady spinning state."""
    for name in ("chain", "event", "orbit"):
        if getattr(scene, name) is not None:
            raise SceneError(name, "be left out of a scene whose modes are asked for", "is given")
    if scene.deployment is not None:
        check_starts_at_rest(scene.deployment)
    for i, term in enumerate(scene.terms):
        if kind_of(term) not in ("Energy", "Dissipation"):
            must = "be an Energy or a Dissipation for modes, as they need a steady load"
            raise SceneError(f"{OWN_TERMS}[{i}]", must, f"{type(term).__name__} is a {kind_of(term)}")
    if scene.tip_thrust is not None:
        check_steady_push(scene.tip_thrust)
    if scene.hub is not None and scene.hub.torque is not None:
        must = "be left out for modes, as a torque on the hub changes the spin for ever"
        raise SceneError("hub.torque", must, "is given")
    if scene.solar_wind is not None and scene.solar_wind.relative:
        must = "be false for modes, as such a wind slows the spin down and leaves no steady state"
        raise SceneError("solar_wind.relative", must, "is true")
    if scene.solar_wind is not None and scene.solar_wind.time is not None:
        raise SceneError("solar_wind.time", "be absent, as modes need a steady wind", "is given")
    if scene.thermal is not None and scene.thermal.time is not None:
        raise SceneError("thermal.time", "be absent, as modes need a steady temperature", "is given")
    if scene.solar_wind is not None and scene.solar_wind.thrust_law != "linear":
        law = scene.solar_wind.thrust_law
        raise SceneError("solar_wind.thrust_law", "be linear, as modes are of that law", f'is "{law}"')
    if scene.voltage is not None and scene.voltage.law != "constant":
        raise SceneError(
            "voltage.law", 'be "constant", as modes need a steady load', f'is "{scene.voltage.law}"'
        )
    if float(np.asarray(scene.initial.spin_rate)) == 0.0:
        raise SceneError("initial.spin_rate", "not be zero, as modes refer to a spinning sail", "is 0")


def check_steady_push(table: TipThrust) -> None:
    """Raises SceneError, with one line, if forces on the remote units leave the sail no steady state.

    Axial and radial forces on equal tethers have no moment about the spin axis and belong to the
    equilibrium. Forces on unequal tethers tilt the hub against the axis of the spin and then have one:
    unless it is all but zero, no equilibrium is found, which `modes` says."""
    if table.on is not None:
        raise SceneError("tip_thrust.on", "be absent, as modes need a steady load", "is given")
    if table.direction == "tangential":
        must = 'be "axial" or "radial" for modes, as a tangential force changes the spin for ever'
        raise SceneError("tip_thrust.direction", must, 'is "tangential"')


def check_has_orbit(scene: Scene) -> None:
    """Raises SceneError, with one line, if the scene has no periodic orbit in the wind."""
    for name in ("hub", "solar_wind"):
        if getattr(scene, name) is None:
            raise SceneError(name, "be given for Floquet multipliers", "is missing")


def with_mean_loads(system: System, axes: Rotation) -> System:
    """The system under the mean of its loads over a turn about X_B, the first column of `axes`.

    Raises SceneError for a load whose mean is not known."""
    axis = axes[:, 0]
    loads = []
    for load in system.loads:
        if not isinstance(load, CoulombThrust):
            raise SceneError(load.name, "be left out of a scene whose modes are asked for", "is given")
        wind = load.wind
        distance = jnp.linalg.norm(wind.origin)
        cosine = axis @ wind.origin / distance
        origin = jnp.where(cosine < 0.0, -distance, distance) * axis
        about = wind.number_density, wind.cutoff_voltage, origin
        mean = SteadyWind(wind.speed * jnp.abs(cosine), *about, thrust_factor=wind.thrust_factor)
        loads.append(dataclasses.replace(load, wind=mean))
    gravity = find_term(system.fields, UniformGravity)
    fields: tuple[Field, ...] = ()
    if gravity is not None and system.hub is None:
        fields = (UniformGravity((gravity.vector @ axis) * axis),)
    return dataclasses.replace(system, loads=tuple(loads), fields=fields)
