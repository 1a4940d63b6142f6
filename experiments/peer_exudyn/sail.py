"""Builds and runs the sail of an esail_jax scene in Exudyn.

It shares with esail_jax only the numbers of the scene and the initial state (`inputs.py`). Cable elements,
rigid hub, joints and integrator are Exudyn's; the Coulomb load is implemented here a second time, in NumPy.
"""

import dataclasses
import itertools
import time

import exudyn as exu
import exudyn.itemInterface as items
import numpy as np
from exudyn.rigidBodyUtilities import (
    AngularVelocity2EulerParameters_t,
    RotationMatrix2EulerParameters,
    RotationMatrix2RotationVector,
)
from inputs import POINTS, WEIGHTS, XI, Sail, hermite


class Thrust:
    """Coulomb force of a sail, integrated consistently over all elements at once.

    f = (sigma/u) (u - (r_x . u) r_x / r_x^2) [N/m of undeformed length], u radial from the Sun. The
    four vectors of an element, three components each, are columns of one matrix, so that a call takes two
    products and a dozen array operations: Exudyn calls this function for every residual.
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
        """The generalized forces; coordinates and forces are flat, in the layout of
        `Sail.position`."""
        fields = self.table @ (coordinates[self.index] * self.scale)
        away = (fields[:POINTS] + self.origin).reshape(POINTS, -1, 3)
        along = fields[POINTS:].reshape(POINTS, -1, 3)  # l r_x: only the direction is used
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
        angle = np.asarray(RotationMatrix2RotationVector(rotation))
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
        for pair in itertools.pairwise(mine):
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
    """One Exudyn object over all tether nodes that only applies the load, by one Python call per
    residual.

    Its Jacobian is zero, because the load's tangent is a millionth of the stiffness.
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
    """A run at its saved instants, time first.

    It has nodal position and velocity as in `Sail`, the hub's centre, attitude, velocity and angular
    velocity (in B), the force of the hub on every tether (in I), and the run time [s]."""

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
    """Settings for generalized-alpha with a fixed step, index 3 and spectral radius 0.25."""
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
    """Runs `steps` steps of length `step` [s]; saves the first state and every `every`-th one.

    Raises RuntimeError if Exudyn's solver fails.
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

    def after(system, time):  # Exudyn calls this before the first step, too
        nonlocal calls
        if calls % every == 0:
            keep(time)
        calls += 1
        return True

    system.SetPostStepUserFunction(after)
    exu.config.printToConsole = False  # Exudyn warns of memory allocations of the Python load
    began = time.perf_counter()
    done = system.SolveDynamic(settings_of(step, steps, tolerance))
    seconds = time.perf_counter() - began
    if not done:
        raise RuntimeError(f"Exudyn stopped after {calls - 1} steps of {step} s")
    return History(*(np.array(column) for column in zip(*rows, strict=True)), seconds=seconds)
