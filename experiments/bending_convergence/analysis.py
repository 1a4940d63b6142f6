"""Computes signals of a run, errors relative to a finer run, and orders of convergence."""

import numpy as np
from models import Lane, Run
from modes import LENGTH
from scipy.interpolate import CubicHermiteSpline

SIGNALS = {
    "coning": "coning angle",
    "lagging": "lagging angle",
    "root coning": "root coning",
    "root lagging": "root lagging",
    "chord coning": "coning of the first L/n",
    "chord lagging": "lagging of the first L/n",
    "length": "tether length",
    "strain": "largest strain",
    "thrust": "thrust",
    "reaction": "reaction at the root",
    "spin": "spin of the hub",
    "mid": "middle of the tether",
}
"""Compared signals: key and name. The angles of the first L/n are those of its chord; a truss has no
others."""


def angles(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coning and lagging of vectors (time, xyz) of tether 1 in the hub's frame."""
    x, y, z = vectors.T
    return np.arctan2(x, np.hypot(y, z)), np.arctan2(z, y)


def at(run: Run, x: float) -> np.ndarray:
    """The position of the material point x [m] from the root, in the hub's frame: (time, xyz)."""
    shape = run.seen["shape_B"]
    nodes = np.linspace(0.0, LENGTH, run.elements + 1)
    if shape.shape[1] == 2:
        return CubicHermiteSpline(nodes, shape[:, 0], shape[:, 1], axis=2)(x)
    k = min(int(x / LENGTH * run.elements), run.elements - 1)
    part = x / LENGTH * run.elements - k
    return (1.0 - part) * shape[:, 0, :, k] + part * shape[:, 0, :, k + 1]


def signals(run: Run, chord: float) -> dict[str, np.ndarray]:
    """All signals (time, component); chord [m]: length of the chord at the root."""
    seen = run.seen
    chord_coning, chord_lagging = angles(at(run, chord))
    found = {
        "coning": seen["coning_angle"][:, 0],
        "lagging": seen["lagging_angle"][:, 0],
        "root coning": seen["root_coning_angle"][:, 0],
        "root lagging": seen["root_lagging_angle"][:, 0],
        "chord coning": chord_coning,
        "chord lagging": chord_lagging,
        "length": seen["tether_length"][:, 0],
        "strain": seen["max_axial_strain"][:, 0],
        "thrust": seen["thrust_O"],
        "reaction": seen["reaction_B"][:, 0],
        "spin": seen["angular_velocity_B"][:, 0],
        "mid": at(run, 0.5 * LENGTH)[:, [0, 2]],
    }
    return {key: value.reshape(len(value), -1) for key, value in found.items()}


def errors(run: Run, reference: Run) -> dict[str, tuple[float, float]]:
    """The largest and the rms error of every signal, relative to the reference's range (largest
    component)."""
    chord = LENGTH / run.elements
    mine, true = signals(run, chord), signals(reference, chord)
    found = {}
    for key in SIGNALS:
        span = np.ptp(true[key], axis=0).max()
        miss = np.linalg.norm(mine[key] - true[key], axis=1)
        found[key] = (miss.max() / span, np.sqrt((miss**2).mean()) / span)
    return found


def ranges(run: Run) -> dict[str, float]:
    """The range of every signal."""
    return {key: float(np.ptp(value, axis=0).max()) for key, value in signals(run, LENGTH).items()}


def order(elements: list[int], error: list[float]) -> float:
    """The order of convergence, -d log(error) / d log(elements), by least squares."""
    return float(-np.polyfit(np.log(elements), np.log(error), 1)[0])


def elements_for(elements: list[int], error: list[float], wanted: float) -> float:
    """The number of elements at which the error first falls below `wanted`; interpolates
    logarithms."""
    logs = np.log(error)
    for k in range(1, len(elements)):
        if logs[k] <= np.log(wanted) < logs[k - 1]:
            part = (logs[k - 1] - np.log(wanted)) / (logs[k - 1] - logs[k])
            return float(np.exp(np.log(elements[k - 1]) * (1 - part) + np.log(elements[k]) * part))
    return float("nan")


class Study:
    """The runs of one scene, by variant, elements, parameters and refinement of the step."""

    def __init__(self, runs: list[Run]):
        self.runs = {(r.variant, r.elements, r.lane, r.refine): r for r in runs}

    def get(self, variant: str, elements: int, lane: Lane | None = None, refine: int = 1) -> Run:
        """One run."""
        return self.runs[(variant, elements, lane or Lane(), refine)]

    def meshes(self, variant: str, lane: Lane | None = None) -> list[int]:
        """The available numbers of elements."""
        lane = lane or Lane()
        return sorted(n for v, n, at, f in self.runs if v == variant and at == lane and f == 1)

    def reference(self, lane: Lane | None = None) -> Run:
        """The run of the finest cable with these parameters."""
        for variant in ("nonlinear", "none"):
            if meshes := self.meshes(variant, lane):
                return self.get(variant, meshes[-1], lane)
        raise KeyError(lane)

    def errors(self, variant: str, elements: int, lane: Lane | None = None) -> dict:
        """The errors relative to the reference."""
        return errors(self.get(variant, elements, lane), self.reference(lane))

    def curve(self, variant: str, key: str, kind: int = 1, lane: Lane | None = None) -> tuple:
        """Elements and errors of one signal (kind 0: largest, 1: rms), without the reference."""
        last = self.reference(lane)
        meshes = [n for n in self.meshes(variant, lane) if self.get(variant, n, lane) is not last]
        return meshes, [self.errors(variant, n, lane)[key][kind] for n in meshes]

    def cost(self, variant: str, elements: int) -> float:
        """The time per step [us] of the fastest run with the scene's EI."""
        chosen = [
            r.microseconds
            for (v, n, lane, f), r in self.runs.items()
            if v == variant and n == elements and lane.stiffness == 1.0 and f == 1
        ]
        return min(chosen)
