"""The sail of an esail_jax scene, built and run in Exudyn.

Shared with esail_jax: the numbers of the scene and the initial state. Everything else is Exudyn's:
cable elements, rigid hub, joints, integrator; the Coulomb load is written here once more, in NumPy.
"""

import dataclasses
import time

import exudyn as exu
import exudyn.itemInterface as items
import numpy as np
from exudyn.rigidBodyUtilities import AngularVelocity2EulerParameters_t, RotationMatrix2EulerParameters

from esail_jax import Scene, constants
from esail_jax.scenes.build import build_jitted, split

POINTS = 5
"""Gauss points per element of the load: as many as Exudyn's cable has for its axial force."""

XI, WEIGHTS = (0.5 * (1.0 + np.polynomial.legendre.leggauss(POINTS)[0]),
               0.5 * np.polynomial.legendre.leggauss(POINTS)[1])  # fmt: skip


def hermite(xi: np.ndarray, derivative: int = 0) -> np.ndarray:
    """Cubic shape functions of (r_i, l r_x,i, r_j, l r_x,j), or a derivative in xi: (point, 4)."""
    powers = np.array([[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]], float)
    polynomials = [np.polynomial.Polynomial(row).deriv(derivative) for row in powers]
    return np.stack([p(np.asarray(xi)) for p in polynomials], axis=-1)


@dataclasses.dataclass(frozen=True)
class Sail:
    """What both codes are given, in SI units.

    position, velocity: nodal vectors (tether, node, 2, xyz), r and r_x; hub_*: of the hub's centre,
    its attitude C_B^I and angular velocity in I; inertia about X_B, Y_B, Z_B; anchors (tether, xyz) in B.
    load: sigma/u [N s/m^2] per tether, zero without wind; origin R_0 [m] from the Sun.
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
        return self.position.shape[0]

    @property
    def elements(self) -> int:
        return self.position.shape[1] - 1

    @property
    def element_length(self) -> np.ndarray:
        """l [m] per tether."""
        return self.length / self.elements

    def element_vectors(self, nodal: np.ndarray) -> np.ndarray:
        """(..., tether, node, 2, xyz) to (..., tether, elem, 4, xyz), slopes times l."""
        scaled = nodal.copy()
        scaled[..., 1, :] *= self.element_length[:, None, None]
        return np.concatenate([scaled[..., :-1, :, :], scaled[..., 1:, :, :]], axis=-2)

    def slopes(self, nodal: np.ndarray, xi: np.ndarray = XI) -> np.ndarray:
        """r_x at points xi of every element: (..., tether, elem, point, xyz)."""
        return hermite(xi, 1) @ self.element_vectors(nodal) / self.element_length[:, None, None, None]


def sail_of(scene: Scene) -> Sail:
    """Numbers and initial state of a scene; raises ValueError for what this adapter lacks."""
    structure, numbers = split(scene)
    wanted = {"tethers.strain": "engineering", "tethers.element": "cable", "tethers.root": "pinned"}
    for key, value in wanted.items():
        if structure[key] != value:
            raise ValueError(f"`{key}` must be {value!r} here, but is {structure[key]!r}")
    if not structure.has("hub") or structure.has("gravity"):
        raise ValueError("the scene must have a hub and no gravity")
    n = {key: np.asarray(value) for key, value in numbers.items()}
    start = build_jitted(structure, numbers)
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


class Thrust:
    """Coulomb force of a sail, consistently integrated over all elements at once.

    f = (sigma/u) (u - (r_x . u) r_x / r_x^2) [N/m of undeformed length], u radial from the Sun. An
    element's four vectors, three components each, are columns of one matrix: two products and a
    dozen array operations in all, because Exudyn calls this once per residual.
    """

    def __init__(self, sail: Sail):
        shape = (sail.tethers, sail.elements, 3)
        number = np.arange(sail.position.size).reshape(sail.position.shape)
        ends = np.concatenate([number[:, :-1], number[:, 1:]], axis=2)  # tether, elem, 4, xyz
        self.index = np.moveaxis(ends, 2, 0).reshape(4, -1)
        length = np.broadcast_to(sail.element_length[:, None, None], shape).ravel()
        self.scale = np.stack([length**0, length, length**0, length])
        self.table = np.concatenate([hermite(XI), hermite(XI, 1)])
        self.back = (WEIGHTS[:, None] * hermite(XI)).T
        self.strength = np.broadcast_to((sail.load * sail.element_length)[:, None], shape[:2]).ravel()
        self.origin = np.broadcast_to(sail.origin, shape).ravel()
        self.speed, self.size = sail.wind_speed, sail.position.size

    def __call__(self, coordinates: np.ndarray) -> np.ndarray:
        """Generalized forces of all nodal coordinates, both flat in the layout of `Sail.position`."""
        fields = self.table @ (coordinates[self.index] * self.scale)
        away = (fields[:POINTS] + self.origin).reshape(POINTS, -1, 3)
        along = fields[POINTS:].reshape(POINTS, -1, 3)  # l r_x: only its direction is used
        along_along, along_away, away_away = (
            np.einsum("gec,gec->ge", *pair) for pair in ((along, along), (along, away), (away, away))
        )
        strength = self.strength * self.speed / np.sqrt(away_away)
        force = strength[..., None] * (away - (along_away / along_along)[..., None] * along)
        forces = (self.back @ force.reshape(POINTS, -1)) * self.scale
        return np.bincount(self.index.ravel(), forces.ravel(), self.size)


def assemble(sail: Sail, lie_group: bool = False):
    """An Exudyn system with this sail, and the numbers of its spherical joints.

    Coordinates are displacements from the initial state. The hub's node comes first (Euler
    parameters, or a rotation vector with the Lie group integrator), then the nodes of tether after
    tether.
    """
    system = exu.SystemContainer().AddSystem()
    rotation = sail.hub_rotation
    if lie_group:
        angle = np.asarray(exu.rigidBodyUtilities.RotationMatrix2RotationVector(rotation))
        node = items.NodeRigidBodyRotVecLG(
            referenceCoordinates=[*sail.hub_position, *angle],
            initialVelocities=[*sail.hub_velocity, *(rotation.T @ sail.hub_spin)],
        )
    else:
        parameters = RotationMatrix2EulerParameters(rotation)
        node = items.NodeRigidBodyEP(
            referenceCoordinates=[*sail.hub_position, *parameters],
            initialVelocities=[
                *sail.hub_velocity,
                *AngularVelocity2EulerParameters_t(sail.hub_spin, parameters),
            ],
        )
    hub = system.AddObject(
        items.ObjectRigidBody(
            mass=sail.hub_mass, inertia=[*sail.inertia, 0.0, 0.0, 0.0], nodeNumber=system.AddNode(node)
        )
    )
    joints, nodes = [], []
    for i in range(sail.tethers):
        mine = [
            system.AddNode(
                items.NodePointSlope1(referenceCoordinates=q.ravel(), initialVelocities=v.ravel())
            )
            for q, v in zip(sail.position[i], sail.velocity[i], strict=True)
        ]
        for pair in zip(mine[:-1], mine[1:], strict=True):
            system.AddObject(
                items.ObjectANCFCable(
                    length=sail.element_length[i],
                    massPerLength=sail.line_density[i],
                    axialStiffness=sail.axial_stiffness[i],
                    bendingStiffness=sail.bending_stiffness[i],
                    axialDamping=sail.axial_time[i] * sail.axial_stiffness[i],
                    bendingDamping=sail.bending_time[i] * sail.bending_stiffness[i],
                    nodeNumbers=list(pair),
                )
            )
        system.AddObject(items.ObjectMassPoint(mass=sail.tip_mass[i], nodeNumber=mine[-1]))
        anchor = system.AddMarker(items.MarkerBodyPosition(bodyNumber=hub, localPosition=sail.anchors[i]))
        root = system.AddMarker(items.MarkerNodePosition(nodeNumber=mine[0]))
        joints.append(system.AddObject(items.ObjectJointSpherical(markerNumbers=[root, anchor])))
        nodes += mine
    if sail.load.any():
        system.AddObject(load_object(sail, nodes))
    system.Assemble()
    return system, joints


def load_object(sail: Sail, nodes: list):
    """One object over all tether nodes that does nothing but push: a Python call per residual.

    Its Jacobian is given as zero: the load's tangent is a millionth of the stiffness.
    """
    size = sail.position.size

    def nothing():
        matrix = exu.MatrixContainer()
        matrix.Initialize(size, size, useDenseMatrix=False)
        return matrix

    start, thrust = sail.position.ravel(), Thrust(sail)

    def force(system, t, number, displacement, velocity):
        return thrust(start + displacement)

    def jacobian(system, t, number, displacement, velocity, factor, factor_t):
        return nothing()

    return items.ObjectGenericODE2(
        nodeNumbers=nodes, massMatrix=nothing(), forceUserFunction=force, jacobianUserFunction=jacobian
    )


@dataclasses.dataclass(frozen=True)
class History:
    """Saved instants, time first: nodal position and velocity as in `Sail`, the hub's centre,
    attitude, velocity and angular velocity (in B), force of the hub on every tether (in I)."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    hub_position: np.ndarray
    hub_rotation: np.ndarray
    hub_velocity: np.ndarray
    hub_spin_B: np.ndarray
    reaction: np.ndarray
    seconds: float


def settings_of(step: float, steps: int, tolerance: float):
    """Generalized-alpha for index 3 at spectral radius 0.25, fixed step."""
    settings = exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.numberOfSteps = steps
    integration.endTime = steps * step
    integration.verboseMode = 0
    integration.adaptiveStep = False
    integration.generalizedAlpha.spectralRadius = 0.25
    integration.generalizedAlpha.useIndex2Constraints = False
    integration.generalizedAlpha.useNewmark = False
    integration.generalizedAlpha.computeInitialAccelerations = True
    integration.newton.useModifiedNewton = True
    integration.newton.relativeTolerance = tolerance
    integration.newton.absoluteTolerance = 1e-2 * tolerance
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = settings.timeIntegration.endTime
    settings.parallel.numberOfThreads = 1
    return settings


def simulate(
    sail: Sail, step: float, steps: int, every: int, tolerance: float = 1e-9, lie_group: bool = False
) -> History:
    """Run `steps` steps [s], keeping every `every`-th state and the first.

    Raises RuntimeError when Exudyn gives up.
    """
    system, joints = assemble(sail, lie_group)
    data, output = system.systemData, exu.OutputVariableType
    rows = []

    def keep(time):
        rows.append(
            (
                time,
                sail.position
                + data.GetODE2Coordinates()[-sail.position.size :].reshape(sail.position.shape),
                data.GetODE2Coordinates_t()[-sail.position.size :].reshape(sail.position.shape),
                system.GetNodeOutput(0, output.Position),
                np.reshape(system.GetNodeOutput(0, output.RotationMatrix), (3, 3)),
                system.GetNodeOutput(0, output.Velocity),
                system.GetNodeOutput(0, output.AngularVelocityLocal),
                [system.GetObjectOutput(joint, output.Force) for joint in joints],
            )
        )

    calls = 0

    def after(system, time):  # Exudyn calls this before the first step too
        nonlocal calls
        if calls % every == 0:
            keep(time)
        calls += 1
        return True

    system.SetPostStepUserFunction(after)
    exu.config.printToConsole = False  # it warns of the allocations of the Python load
    began = time.perf_counter()
    done = system.SolveDynamic(settings_of(step, steps, tolerance))
    seconds = time.perf_counter() - began
    if not done:
        raise RuntimeError(f"Exudyn stopped after {calls - 1} steps of {step} s")
    return History(*(np.array(column) for column in zip(*rows, strict=True)), seconds=seconds)
