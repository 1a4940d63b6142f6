"""The inputs of both codes: numbers and initial state of an esail_jax scene, as NumPy arrays."""

import dataclasses

import jax
import numpy as np

from esail_jax import Scene, constants
from esail_jax.scenes.build import build
from esail_jax.scenes.structure import split

POINTS = 5
"""Gauss points per element of the load; Exudyn's cable has as many for its axial force."""

XI, WEIGHTS = (0.5 * (1.0 + np.polynomial.legendre.leggauss(POINTS)[0]),
               0.5 * np.polynomial.legendre.leggauss(POINTS)[1])  # fmt: skip


def hermite(xi: np.ndarray, derivative: int = 0) -> np.ndarray:
    """Cubic shape functions of (r_i, l r_x,i, r_j, l r_x,j), or their derivatives in xi: (point,
    4)."""
    powers = np.array([[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]], float)
    polynomials = [np.polynomial.Polynomial(row).deriv(derivative) for row in powers]
    return np.stack([p(np.asarray(xi)) for p in polynomials], axis=-1)


@dataclasses.dataclass(frozen=True)
class Sail:
    """A sail in SI units.

    position, velocity: nodal vectors (tether, node, 2, xyz), r and r_x; hub_*: position and velocity of
    the hub's centre, its attitude C_B^I and angular velocity in I; inertia about X_B, Y_B, Z_B; anchors
    (tether, xyz) in B. load: sigma/u [N s/m^2] per tether, zero without wind; origin R_0 [m] from the Sun.
    """

    position: np.ndarray
    velocity: np.ndarray
    hub_position: np.ndarray
    hub_rotation: np.ndarray
    hub_velocity: np.ndarray
    hub_spin: np.ndarray
    hub_mass: float
    inertia: np.ndarray
    anchors: np.ndarray
    length: np.ndarray
    line_density: np.ndarray
    tip_mass: np.ndarray
    axial_stiffness: np.ndarray
    bending_stiffness: np.ndarray
    axial_time: np.ndarray
    bending_time: np.ndarray
    load: np.ndarray
    wind_speed: float
    origin: np.ndarray

    @property
    def tethers(self) -> int:
        """Number of tethers."""
        return self.position.shape[0]

    @property
    def elements(self) -> int:
        """Number of elements per tether."""
        return self.position.shape[1] - 1

    @property
    def element_length(self) -> np.ndarray:
        """Element length l [m] per tether."""
        return self.length / self.elements

    def element_vectors(self, nodal: np.ndarray) -> np.ndarray:
        """Gathers nodal (..., tether, node, 2, xyz) into (..., tether, elem, 4, xyz); slopes are
        multiplied by l."""
        scaled = nodal.copy()
        scaled[..., 1, :] *= self.element_length[:, None, None]
        return np.concatenate([scaled[..., :-1, :, :], scaled[..., 1:, :, :]], axis=-2)

    def slopes(self, nodal: np.ndarray, xi: np.ndarray = XI) -> np.ndarray:
        """r_x at points xi of every element: (..., tether, elem, point, xyz)."""
        return hermite(xi, 1) @ self.element_vectors(nodal) / self.element_length[:, None, None, None]


def sail_of(scene: Scene) -> Sail:
    """The sail of a scene. Raises ValueError for parts that this adapter does not support."""
    structure, numbers = split(scene)
    wanted = {"tethers.strain": "engineering", "tethers.element": "cable", "tethers.root": "pinned"}
    for key, value in wanted.items():
        if structure[key] != value:
            raise ValueError(f"`{key}` must be {value!r} here, but is {structure[key]!r}")
    if not structure.has("hub") or structure.has("gravity"):
        raise ValueError("the scene must have a hub and no gravity")
    n = {key: np.asarray(value) for key, value in numbers.items()}
    start = jax.jit(build, static_argnums=0)(structure, numbers)
    p = structure["tethers.count"]
    height, radius = n["hub.height"], n["hub.radius"]
    mass = float(n["hub.density"] * np.pi * radius**2 * height)
    points, rates = np.asarray(start.q.hub), np.asarray(start.v.hub)
    centre, rate = points[:2].mean(0), rates[:2].mean(0)
    arms = np.array([height, radius, radius])  # A to B, centre to C, centre to D
    rotation = np.stack([points[1] - points[0], points[2] - centre, points[3] - centre], 1) / arms
    spin = np.stack([rates[1] - rates[0], rates[2] - rate, rates[3] - rate], 1) / arms @ rotation.T
    azimuth = 2.0 * np.pi * np.arange(p) / p
    nothing = np.zeros(p)
    plasma = np.sqrt(
        constants.VACUUM_PERMITTIVITY * constants.PROTON_MASS * n.get("solar_wind.number_density", 0.0)
    )
    excess = np.maximum(0.0, n.get("voltage.value", nothing) - n.get("solar_wind.cutoff_voltage", 0.0))
    bending = float(structure["tethers.bending"])
    modulus = n["tethers.youngs_modulus"]
    return Sail(
        position=np.asarray(start.q.tether).transpose(3, 2, 0, 1),
        velocity=np.asarray(start.v.tether).transpose(3, 2, 0, 1),
        hub_position=centre,
        hub_rotation=rotation,
        hub_velocity=rate,
        hub_spin=np.array([spin[2, 1], spin[0, 2], spin[1, 0]]),
        hub_mass=mass,
        inertia=mass * np.array([radius**2 / 2, *[(3 * radius**2 + height**2) / 12] * 2]),
        anchors=radius * np.stack([nothing, np.cos(azimuth), np.sin(azimuth)], 1),
        length=n["tethers.length"],
        line_density=n["tethers.density"] * n["tethers.area"],
        tip_mass=n.get("remote_units.mass", nothing),
        axial_stiffness=modulus * n["tethers.area"],
        bending_stiffness=bending * modulus * n.get("tethers.second_moment", nothing),
        axial_time=n.get("tethers.axial_damping_time", nothing),
        bending_time=n.get("tethers.bending_damping_time", nothing),
        load=constants.THRUST_FACTOR * excess * plasma,
        wind_speed=float(n.get("solar_wind.speed", 1.0)),
        origin=n["initial.heliocentric_position_au"] * constants.ASTRONOMICAL_UNIT,
    )
