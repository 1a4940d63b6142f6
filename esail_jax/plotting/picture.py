"""Three-dimensional pictures of the sail."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D

from esail_jax.constants import ASTRONOMICAL_UNIT
from esail_jax.observables.saved_rows import leading_finite, observable
from esail_jax.plotting.data import KILOMETRE, spin_period
from esail_jax.plotting.panels import LEAST_WIDTH, tether_colours
from esail_jax.plotting.style import RED
from esail_jax.scenes.scene import released

VIEW_OFF_WIND_DEG, VIEW_ELEVATION_DEG = 25.0, 25.0
"""Direction of the view: close to the wind, so that the sail's disc is visible, but not along it, which
would hide the coning."""

ARROW = 0.8
"""Length of the wind's arrow, as a multiple of the picture's half width."""

FRAME_MARGIN = 1.05
"""Half width of the picture, as a multiple of that of its contents."""


def sail_picture(run: Any, instants: int = 3) -> Figure:
    """Pictures of the sail at equally spaced instants in the inertial frame: its tethers, the paths
    of the tips up to the instant, and the direction of the wind, Z_O."""
    tips = observable(run, "tip_position_I")
    frames = np.zeros(0, int)
    if tips is not None:
        last = leading_finite(tips) - 1
        frames = np.unique(np.linspace(0, last, instants).round().astype(int))
    columns = max(1, len(frames))
    figure = Figure(figsize=(max(LEAST_WIDTH, 4.8 * columns), 4.8), layout="constrained")
    figure.suptitle("The sail in the inertial frame; arrow: direction of the wind, $Z_O$")
    for i, frame in enumerate(frames):
        draw_sail(figure.add_subplot(1, columns, i + 1, projection="3d"), run, int(frame))
    return figure


def draw_sail(ax: Axes3D, run: Any, frame: int) -> None:
    """Draws the sail at one saved instant, in km."""
    tips = np.asarray(run["tip_position_I"])[: frame + 1] / KILOMETRE
    hub, lines = hub_centre(run, frame) / KILOMETRE, tether_lines(run, frame)
    for k, colour in enumerate(tether_colours(tips.shape[1])):
        path, tip = tips[:, k], tips[-1, k]
        ax.plot(*path.T, color=colour, linewidth=0.6, alpha=0.6)
        ax.plot(*lines[k].T / KILOMETRE, color="0.3", linewidth=0.8)
        ax.plot(*tip[:, None], color=colour, marker="o", markersize=4)
    ax.plot(*hub[:, None], color="black", marker="s", markersize=4)
    shown = np.concatenate([tips.reshape(-1, 3), lines.reshape(-1, 3) / KILOMETRE, hub[None]])
    half = frame_cube(ax, shown[np.isfinite(shown).all(axis=1)])
    draw_wind(ax, run, frame, hub, ARROW * half)
    period = spin_period(run)
    turns = "" if period is None else f", $t/T_s$ = {run.time[frame] / period:.3g}"
    ax.set_title(f"$t$ = {run.time[frame]:.4g} s{turns}", fontsize="medium", y=1.03)


def tether_lines(run: Any, frame: int) -> np.ndarray:
    """The tethers at a saved instant as lines (tether, point, 3) [m]: through all nodes if the run
    has them, otherwise from the hub to the tips. The place of a released tether is then not known but for
    its tip, and its line is NaN."""
    nodes = observable(run, "node_position_I")
    if nodes is not None:
        return nodes[frame]
    tips = np.asarray(run["tip_position_I"])[frame]
    lines = np.stack([np.broadcast_to(hub_centre(run, frame), tips.shape), tips], axis=1)
    lines[released(run.scene, run.time[frame : frame + 1])[0]] = np.nan
    return lines


def hub_centre(run: Any, frame: int) -> np.ndarray:
    """The hub centre [m]; without a hub the origin, which lies on the axis of the rotating
    frame."""
    path = observable(run, "hub_position_I")
    return np.zeros(3) if path is None else path[frame]


def frame_cube(ax: Axes3D, points: np.ndarray) -> float:
    """Sets equal scales around the points (point, 3). Returns half the width of the picture."""
    low, high = points.min(0), points.max(0)
    middle, half = (low + high) / 2.0, FRAME_MARGIN * (high - low).max() / 2.0
    limits = np.stack([middle - half, middle + half], axis=1)
    ax.set(xlim=limits[0], ylim=limits[1], zlim=limits[2])
    ax.set(xlabel="$X_I$ [km]", ylabel="$Y_I$ [km]", zlabel="$Z_I$ [km]")
    ax.locator_params(nbins=5)
    ax.set_box_aspect((1.0, 1.0, 1.0))
    return half


def heliocentric(run: Any, frame: int, hub: np.ndarray) -> np.ndarray:
    """The heliocentric position of the hub [km], of which the direction counts. On an orbit it is
    the saved one, or without it that of the start."""
    path = observable(run, "heliocentric_position")
    if path is not None:
        return path[frame] / KILOMETRE
    orbit = run.scene.orbit
    start = run.scene.initial.heliocentric_position_au if orbit is None else orbit.position_au
    return np.asarray(start, float) * ASTRONOMICAL_UNIT / KILOMETRE + hub


def draw_wind(ax: Axes3D, run: Any, frame: int, hub: np.ndarray, length: float) -> None:
    """Draws an arrow along Z_O at the hub [km] and sets an oblique view of the sail."""
    outward = heliocentric(run, frame, hub)
    arrow = length * outward / np.linalg.norm(outward)
    ax.quiver(*hub, *arrow, color=RED, linewidth=1.5, arrow_length_ratio=0.15)
    azimuth = np.degrees(np.arctan2(arrow[1], arrow[0]))
    ax.view_init(elev=VIEW_ELEVATION_DEG, azim=azimuth - VIEW_OFF_WIND_DEG)
