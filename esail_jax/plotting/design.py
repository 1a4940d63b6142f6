"""Figure of a design: the objective by iteration, and the runs before and after the optimisation."""

import numpy as np
from matplotlib.figure import Figure

from esail_jax.plotting.style import styled
from esail_jax.simulation.solution import Solution


def axis_angle(run: Solution) -> np.ndarray:
    """The angle [deg] of the spin axis from its initial direction."""
    axes = np.asarray(run["rotation_IB"])[:, :, 0]
    return np.rad2deg(2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(axes - axes[0], axis=1), 0.0, 1.0)))


PANELS = (
    ("voltage of tether 1 [kV]", lambda run: run["voltage"][:, 0] / 1e3),
    ("thrust [N]", lambda run: np.linalg.norm(run["thrust_O"], axis=1)),
    ("angle of the spin axis from its start [deg]", axis_angle),
    ("lagging angle of tether 1 [deg]", lambda run: np.rad2deg(run["lagging_angle"][:, 0])),
    ("coning angle of tether 1 [deg]", lambda run: np.rad2deg(run["coning_angle"][:, 0])),
)
"""Panels: the label, and the function of a run that is drawn."""


@styled
def design_figure(before: Solution, after: Solution, values: np.ndarray) -> Figure:
    """The figure of a design.

    before, after: runs with constant voltage and with the designed one
    values: objective (iteration, start), where `start` counts the initial guesses"""
    figure = Figure(figsize=(11.0, 6.0), layout="constrained")
    axes = figure.subplots(2, 3)
    first, *others = axes.ravel()
    first.semilogy(np.maximum(values, 1e-30), "o-", ms=3.0)
    first.set_xlabel("iteration")
    first.set_ylabel("objective [-]")
    for axis, (label, function) in zip(others, PANELS, strict=True):
        axis.plot(np.asarray(before.time) / 60.0, function(before), "k--", lw=1.0, label="constant voltage")
        axis.plot(np.asarray(after.time) / 60.0, function(after), lw=1.2, label="designed")
        axis.set_xlabel("t [min]")
        axis.set_ylabel(label)
    others[0].legend(fontsize=7)
    for axis in axes.ravel():
        axis.grid(alpha=0.3)
    return figure
