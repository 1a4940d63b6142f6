"""Runs of the study of growth: 300 and 1000 spin periods, and 30 by other methods and other models."""

import math
from typing import Any, NamedTuple

from kept_runs import kept_run

TURN = 2.0 * math.pi / 4e-3
"""Spin period of the baseline [s]."""

INSTANTS = 40
"""Saved instants per spin period. The fastest motion that matters, the first bending, has a seventh of a
period."""

SAVED = (
    "coning_angle", "lagging_angle", "angular_velocity_B", "sailing_angle", "smallest_tether_distance",
    "kinetic_energy", "elastic_energy", "external_work", "dissipated_energy", "energy_balance_error",
    "euler_sail", "reaction_moment_O", "thrust_moment_O",
)  # fmt: skip

LONGEST, LONG, SHORT = 1000, 300, 30
"""Spin periods."""


class Case(NamedTuple):
    """One run: what is varied, scene, overrides of it, and spin periods."""

    label: str
    scene: str
    overrides: dict[str, Any]
    periods: int


def alpha(step: float, radius: float = 0.25) -> dict[str, Any]:
    """The overrides for generalized-alpha."""
    return {
        "integrator.method": "generalized-alpha",
        "integrator.step": step,
        "integrator.spectral_radius": radius,
    }


def conserving(step: float) -> dict[str, Any]:
    """The overrides for the energy-momentum method."""
    return {"integrator.method": "energy-momentum", "integrator.step": step}


REFERENCE = "collocation, default tolerance"

LONG_CASES = {
    "long-alpha-10": Case(REFERENCE, "baseline", {}, LONG),
    "long-alpha-0": Case(REFERENCE, "sun-facing", {}, LONG),
    "long-alpha-0.01": Case(REFERENCE, "appendix-d", {}, LONG),
    "longest-alpha-0": Case(REFERENCE, "sun-facing", {}, LONGEST),
    "longest-alpha-0.01": Case(REFERENCE, "appendix-d", {}, LONGEST),
    "longest-alpha-10": Case(REFERENCE, "baseline", {}, LONGEST),
    "longest-alpha-10-fine": Case(
        "collocation, tolerance 1e-11", "baseline", {"integrator.tolerance": 1e-11}, LONGEST
    ),
    "long-alpha-10-fine": Case(
        "collocation, tolerance 1e-11", "baseline", {"integrator.tolerance": 1e-11}, LONG
    ),
    "long-alpha-10-paper": Case("generalized-alpha, 0.1 s", "baseline", alpha(0.1), LONG),
    "long-alpha-10-conserving": Case("energy-momentum, 0.5 s", "baseline", conserving(0.5), LONG),
}
"""Runs over 300 or 1000 spin periods by file name."""

VARIED = {
    "short-reference": Case(REFERENCE, "baseline", {}, SHORT),
    "short-fine": Case("collocation, tolerance 1e-11", "baseline", {"integrator.tolerance": 1e-11}, SHORT),
    "short-step-0.2": Case("generalized-alpha, 0.2 s", "baseline", alpha(0.2), SHORT),
    "short-step-0.1": Case("generalized-alpha, 0.1 s", "baseline", alpha(0.1), SHORT),
    "short-step-0.05": Case("generalized-alpha, 0.05 s", "baseline", alpha(0.05), SHORT),
    "short-radius-0.9": Case(
        "generalized-alpha, 0.1 s, spectral radius 0.9", "baseline", alpha(0.1, 0.9), SHORT
    ),
    "short-radius-0": Case(
        "generalized-alpha, 0.1 s, spectral radius 0", "baseline", alpha(0.1, 0.0), SHORT
    ),
    "short-conserving": Case("energy-momentum, 0.1 s", "baseline", conserving(0.1), SHORT),
    "short-elements-9": Case("9 elements per tether", "baseline", {"tethers.elements": 9}, SHORT),
    "short-elements-2": Case("2 elements per tether", "baseline", {"tethers.elements": 2}, SHORT),
    "short-damping-10": Case(
        "axial damping time 10 s", "baseline", {"tethers.axial_damping_time": 10.0}, SHORT
    ),
    "short-damping-0": Case(
        "axial damping time 1e-6 s", "baseline", {"tethers.axial_damping_time": 1e-6}, SHORT
    ),
}
"""Runs over 30 spin periods by file name; the first is what the others are compared with."""


def run(name: str, case: Case):
    """The solution of a case, from its file if there is one."""
    overrides = case.overrides | {
        "integrator.t_end": case.periods * TURN,
        "output.interval": TURN / INSTANTS,
    }
    return kept_run(name, case.scene, overrides, SAVED)
