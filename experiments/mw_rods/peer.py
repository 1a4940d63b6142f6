"""Simulates the 11 steel rods of Ma and Wang's second experiment in Exudyn, in place of their ADAMS.

    pip install 'exudyn==1.13.6' scipy
    python experiments/mw_rods/peer.py           # references/exudyn_<model>_<direction>.csv (one minute)
    python experiments/mw_rods/peer.py --timing  # references/exudyn_timing.csv (three minutes)

Rods of 0.1 m hang along -Y from the origin, unstretched and at rest; gravity acts from t = 0, and the runs
cover 1 s. The paper does not print gravity's direction; here it is +X (across) and -Y (along). Models, in
SI units:

rigid    ObjectRigidBody in space, inertia of the cylinder, ObjectJointSpherical between them
tree     the same cylinders in relative angles about Z (ObjectKinematicTree): plane motion only
thin     `tree` without the radius in the inertia about Z: inertia m L^2 / 12
elastic  straight bars with axial stiffness EA and consistent mass, no other stiffness or inertia: the model
         of the paper. Their ends are the nodes; one ObjectGenericODE2 has gravity and the constant mass
         matrix (m/6) [2 1; 1 2] per bar, ObjectConnectorSpringDamper has the stiffness EA / L. The
         axial force is EA (l - L) / L for any length l, without damping. Unlike `rigid` it has no radius.
"""

import contextlib
import dataclasses
import functools
import itertools
import sys
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

sys.exudynFast = True  # the build without range checks, a quarter faster
import exudyn as exu  # noqa: E402
import exudyn.itemInterface as items  # noqa: E402
from exudyn.rigidBodyUtilities import RigidBodyInertia  # noqa: E402

REFERENCES = Path(__file__).parent / "references"
RODS, LENGTH, RADIUS, DENSITY, MODULUS = 11, 0.1, 1e-3, 7801.0, 207e9
MASS = DENSITY * np.pi * RADIUS**2 * LENGTH
STIFFNESS = MODULUS * np.pi * RADIUS**2 / LENGTH
GRAVITY = {"plus_x": (9.81, 0.0, 0.0), "minus_y": (0.0, -9.81, 0.0)}
END, INTERVAL = 1.0, 0.005
SAVED = dict(storeInternal=True, outputVariableType=exu.OutputVariableType.Position)


def inertia_of(radius: float) -> np.ndarray:
    """The inertia [kg m^2] of a rod along Y about its centre; `radius` [m] has an effect across
    the rod only."""
    across = MASS * (3 * radius**2 + LENGTH**2) / 12
    return np.diag([across, MASS * RADIUS**2 / 2, across])


def rigid(system, gravity: tuple) -> int:
    """Adds rigid cylinders and spherical joints; returns the number of the sensor at the tip."""
    last = system.CreateGround()
    for i in range(RODS):
        rod = system.CreateRigidBody(
            referencePosition=[0.0, -(i + 0.5) * LENGTH, 0.0],
            inertia=RigidBodyInertia(mass=MASS, inertiaTensor=inertia_of(RADIUS)),
            gravity=list(gravity),
        )
        system.CreateSphericalJoint(itemNumbers=[last, rod], position=[0.0, -i * LENGTH, 0.0], show=False)
        last = rod
    return system.AddSensor(items.SensorBody(bodyNumber=last, localPosition=[0, -LENGTH / 2, 0], **SAVED))


def tree(system, gravity: tuple, radius: float = RADIUS) -> int:
    """Adds rigid cylinders that rotate about Z, in relative angles; returns the number of the sensor at
    the tip."""
    values = ("referenceCoordinates", "initialCoordinates", "initialCoordinates_t")
    node = items.NodeGenericODE2(numberOfODE2Coordinates=RODS, **dict.fromkeys(values, [0.0] * RODS))
    links = items.ObjectKinematicTree(
        nodeNumber=system.AddNode(node),
        jointTypes=[exu.JointType.RevoluteZ] * RODS,
        linkParents=list(range(-1, RODS - 1)),
        jointTransformations=exu.Matrix3DList([np.eye(3)] * RODS),
        jointOffsets=exu.Vector3DList([[0.0, -LENGTH if i else 0.0, 0.0] for i in range(RODS)]),
        linkInertiasCOM=exu.Matrix3DList([inertia_of(radius)] * RODS),
        linkCOMs=exu.Vector3DList([[0.0, -LENGTH / 2, 0.0]] * RODS),
        linkMasses=[MASS] * RODS,
        gravity=list(gravity),
    )
    tip = dict(objectNumber=system.AddObject(links), linkNumber=RODS - 1, localPosition=[0.0, -LENGTH, 0.0])
    return system.AddSensor(items.SensorKinematicTree(**tip, **SAVED))


def elastic(system, gravity: tuple) -> int:
    """Adds bars with consistent mass and axial springs; returns the number of the sensor at the tip."""
    mass = np.zeros((RODS + 1, RODS + 1))
    nodes, last = [], system.AddMarker(items.MarkerBodyPosition(bodyNumber=system.CreateGround()))
    for i in range(RODS):
        mass[i : i + 2, i : i + 2] += MASS / 6 * np.array([[2.0, 1.0], [1.0, 2.0]])
        nodes.append(system.AddNode(items.NodePoint(referenceCoordinates=[0.0, -(i + 1) * LENGTH, 0.0])))
        ends = [last, system.AddMarker(items.MarkerNodePosition(nodeNumber=nodes[-1]))]
        spring = dict(referenceLength=LENGTH, stiffness=STIFFNESS)
        system.AddObject(items.ObjectConnectorSpringDamper(markerNumbers=ends, **spring))
        last = ends[1]
    free, weight = np.kron(mass[1:, 1:], np.eye(3)), np.kron(mass.sum(1)[1:], gravity)
    system.AddObject(items.ObjectGenericODE2(nodeNumbers=nodes, massMatrix=free, forceVector=weight))
    return system.AddSensor(items.SensorNode(nodeNumber=nodes[-1], **SAVED))


MODELS = {"rigid": rigid, "tree": tree, "thin": functools.partial(tree, radius=0.0), "elastic": elastic}


@dataclasses.dataclass(frozen=True)
class Method:
    """An integrator of Exudyn. tolerance: that of Newton's iteration, or of DOPRI5's local error; unused
    by RK."""

    solver: str
    tolerance: float = 1.0

    def __str__(self):
        return self.solver if self.tolerance == 1.0 else f"{self.solver} {self.tolerance:g}"

    def run(self, model: str, direction: str, substeps: int, rows: int = 1) -> tuple[np.ndarray, float]:
        """(instant, txyz) of the tip [s, m] and the run time [s]. Raises SolverError if Exudyn
        fails.

        Every INTERVAL has `substeps` steps (for DOPRI5: at least) and `rows` saved rows.
        """
        system = exu.SystemContainer().AddSystem()
        sensor = MODELS[model](system, GRAVITY[direction])
        system.Assemble()
        settings = exu.SimulationSettings()
        integration, newton = settings.timeIntegration, settings.timeIntegration.newton
        integration.numberOfSteps, integration.endTime = round(END / INTERVAL) * substeps, END
        integration.adaptiveStep = integration.automaticStepSize = self.solver == "DOPRI5"
        integration.relativeTolerance = integration.absoluteTolerance = self.tolerance
        newton.relativeTolerance, newton.absoluteTolerance = self.tolerance, 1e-2 * self.tolerance
        integration.generalizedAlpha.spectralRadius = 0.9
        integration.explicit.computeEndOfStepAccelerations = False
        solvers = exu.LinearSolverType  # the faster one for each
        settings.linearSolver.solverType = solvers.EigenSparse if model == "rigid" else solvers.EXUdense
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = INTERVAL / rows
        settings.parallel.numberOfThreads = 1
        exu.config.printToConsole = False
        began = time.perf_counter()
        system.SolveDynamic(settings, solverType=getattr(exu.DynamicSolverType, self.solver))
        return system.GetSensorStoredData(sensor), time.perf_counter() - began


def gap(path: np.ndarray, fine: np.ndarray) -> float:
    """The largest distance [m] of `path`, at its instants, from a spline through `fine`."""
    away = path[:, 1:] - CubicSpline(fine[:, 0], fine[:, 1:])(path[:, 0])
    return float(np.linalg.norm(away, axis=1).max())


FINEST = dict.fromkeys(("tree", "thin"), (Method("RK67"), 40, 6))
FINEST |= {"rigid": (Method("GeneralizedAlpha", 1e-10), 200, 2), "elastic": (Method("RK67"), 4000, 6)}
"""Method, substeps and order of the paths that are written."""

IMPLICIT = [Method(s, t) for s in ("GeneralizedAlpha", "TrapezoidalIndex2") for t in (1e-5, 1e-6)]
EXPLICIT = [Method("RK44"), Method("RK67"), *(Method("DOPRI5", 10.0**-k) for k in range(2, 8))]
TRIED = {"rigid": IMPLICIT, "tree": EXPLICIT, "elastic": IMPLICIT + EXPLICIT[:1]}
SUBSTEPS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 17, 20, 25, 30, 40, 50, 60, 70, 85, 100, 200, 325, 400)


def write_paths(direction: str, models: Iterable) -> None:
    """Writes the tip paths, with the effect of halving the step in their headers; prints their distances
    [m]."""
    known = REFERENCES.glob(f"exp2_{direction}.csv")  # written by reference.py
    paths = {path.stem: np.loadtxt(path, delimiter=",")[:, :4] for path in known}
    for model in models:
        method, substeps, order = FINEST[model]
        fine, seconds = method.run(model, direction, substeps)
        changed = gap(method.run(model, direction, substeps // 2)[0], fine)
        error = max(changed / (2**order - 1), 1e-12)  # not below rounding
        header = f"""Exudyn {exu.__version__}, `{model}` of peer.py, gravity {GRAVITY[direction]} m/s^2
{method}, step {INTERVAL / substeps:g} s (run in {seconds:.1f} s); halving the step to this one
moved the tip by at most {changed:.1e} m: estimated error {error:.0e} m at order {order}; s and m
t,x,y,z"""
        np.savetxt(REFERENCES / f"exudyn_{model}_{direction}.csv", fine, "%.14f", ",", header=header)
        paths[f"exudyn {model}"] = fine
        print(f"{direction} {model}: halving {changed:.1e} m, {seconds:.1f} s")
    for one, other in itertools.combinations(paths, 2):
        print(f"{direction}: {one} - {other}: {gap(paths[one], paths[other]):.2e} m")


def write_timing() -> None:
    """Writes, for +X, the fewest steps of every method within an error of the tip, and the best time of
    nine runs."""
    lines = ["model,method and tolerance,wanted_m,error_m,steps,us_per_step,run_s"]
    for model, methods in TRIED.items():
        exact = "tree" if model == "rigid" else model  # the same motion, with a smaller error
        fine, _ = FINEST[exact][0].run(exact, "plus_x", FINEST[exact][1], rows=20)
        for method, wanted in itertools.product(methods, (1e-4, 1e-6)):
            for substeps in SUBSTEPS[: 1 if method.solver == "DOPRI5" else None]:
                again = functools.partial(method.run, model, "plus_x", substeps)
                with contextlib.suppress(exu.SolverError), np.errstate(over="ignore"):
                    if (error := gap(again()[0], fine)) <= wanted:
                        seconds = min(again()[1] for _ in range(9))
                        steps = len(again(rows=10**6)[0]) - 1  # saves every step
                        times = f"{steps},{1e6 * seconds / steps:.1f},{seconds:.4f}"
                        lines.append(f"{model},{method},{wanted:g},{error:.1e},{times}")
                        break
    (REFERENCES / "exudyn_timing.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    if "--timing" in sys.argv[1:]:
        write_timing()
    else:
        write_paths("plus_x", FINEST)
        write_paths("minus_y", ("rigid", "elastic"))
