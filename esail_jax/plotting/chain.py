"""Figures of a rod chain: shapes, tip, libration on an orbit, tension and energies ([MW] Fig. 2-4)."""

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

from esail_jax.observables.saved_rows import leading_finite, observable
from esail_jax.plotting.data import change, orbital_period, readable
from esail_jax.plotting.panels import Curve, assemble, components, history, time_unit, unwrapped_degrees
from esail_jax.plotting.style import BLUE, ORANGE, PURPLE, RED

TIME_COLOURS = ListedColormap(colormaps["viridis"](np.linspace(0.0, 0.92, 256)))
"""Colours from the first to the last instant, not close to white."""

FLAT = 1e-9
"""A chain counts as flat if its smallest extent, relative to the largest one, is at most this."""

SLENDER = 10.0
"""Axes have different scales if the ratio of extents is larger than this: equal scales would show a
line."""

JOINTS_MARKED = 40
"""Largest number of joints that are drawn as dots."""


# ---- shapes -----------------------------------------------------------------------------------


def chain_shapes(run: Any, instants: int = 10) -> Figure:
    """The figure of the chain at equally spaced instants and of the path of its tip.

    It shows the two coordinate planes in which the chain extends most, or one if the chain is flat."""
    joints = observable(run, "joint_position")
    known = 0 if joints is None else leading_finite(joints)
    if known == 0:
        return Figure()
    factor, unit = readable("m", joints[:known])
    frames = np.unique(np.linspace(0, known - 1, instants).round().astype(int))
    planes = widest_planes(joints[:known])
    figure = Figure(figsize=(4.6 * len(planes) + 2.4, 5.2), layout="constrained")
    figure.suptitle("The chain at equally spaced instants; grey: path of its tip")
    per_unit, label = time_unit(run)
    times = np.asarray(run.time) / per_unit
    scale = ScalarMappable(Normalize(times[0], times[frames[-1]]), TIME_COLOURS)
    for i, plane in enumerate(planes):
        ax = figure.add_subplot(1, len(planes), i + 1)
        draw_plane(ax, factor * joints[:known][..., plane], frames, scale.to_rgba(times[frames]))
        ax.set(xlabel=f"${'xyz'[plane[0]]}$ [{unit}]", ylabel=f"${'xyz'[plane[1]]}$ [{unit}]")
    figure.colorbar(scale, ax=figure.axes, label=label, aspect=40)
    return figure


def extents(points: np.ndarray) -> np.ndarray:
    """The extent of points (..., axis) along every axis."""
    return np.ptp(points.reshape(-1, points.shape[-1]), axis=0)


def widest_planes(joints: np.ndarray) -> list[list[int]]:
    """Pairs of axes: the axis of largest extent with the second, and with the third unless the
    chain is flat."""
    size = extents(joints)
    first, second, third = np.argsort(-size, kind="stable")
    flat = size[third] <= FLAT * size[first]
    return sorted(sorted([int(first), int(other)]) for other in ([second] if flat else [second, third]))


def draw_plane(ax: Axes, joints: np.ndarray, frames: np.ndarray, colours: np.ndarray) -> None:
    """Draws the chain at the frames from joints (time, joint, 2), with equal scales unless it is
    slender."""
    marker = "." if joints.shape[1] <= JOINTS_MARKED else ""
    ax.plot(*joints[:, -1].T, color="0.7", linewidth=0.7)
    for frame, colour in zip(frames, colours, strict=True):
        ax.plot(*joints[frame].T, marker, linestyle="-", color=colour, linewidth=1.0, markersize=3.5)
        ax.plot(*joints[frame, -1:].T, "o", color=colour, markersize=5)
    small, large = np.sort(extents(joints))
    if FLAT * large < small < large / SLENDER:
        ax.set_title("different scales", fontsize="medium")
    else:
        ax.set_aspect("equal", adjustable="datalim")
    ax.grid(alpha=0.3)


# ---- tip and libration ------------------------------------------------------------------------


def chain_tip(run: Any) -> Figure:
    """The figure of the tip's coordinates against time ([MW] Fig. 4), of a free chain relative to
    its first joint."""
    free = run.scene.chain.anchor == "free"
    title = "Tip of the chain" + (", relative to its first joint" if free else "")
    joints = observable(run, "joint_position")
    if joints is None:
        return assemble(title, [])
    tip = joints[:, -1] - joints[:, 0] if free else joints[:, -1]
    factor, unit = readable("m", tip)
    figure = assemble(title, [[panel] for panel in components(run, factor * tip, "AXIS_{tip}", unit)])
    for ax in figure.axes:  # the length of a taut chain hardly changes: full numbers, no offset
        ax.ticklabel_format(axis="y", useOffset=False)
    return figure


def chain_libration(run: Any) -> Figure:
    """The figure of the libration angles of a chain on an orbit."""
    title = "Libration: angles of the line from the first joint to the last"
    joints = observable(run, "joint_position")
    if joints is None or orbital_period(run) is None:
        return assemble(title, [])
    inside, across = (unwrapped_degrees(angle) for angle in libration_angles(joints))
    rows = [
        [history(run, r"in-plane $\theta$ [deg]", Curve(inside))],
        [history(run, r"out-of-plane $\phi$ [deg]", Curve(across))],
    ]
    return assemble(title, rows)


def libration_angles(joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The angles [rad] of the line from the first to the last joint of joints (time, joint, 3).

    The first angle lies in the orbital plane, from the vertical x towards the direction of motion y; the
    second is measured from this plane towards z."""
    x, y, z = (joints[:, -1] - joints[:, 0]).T
    return np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))


# ---- tension and energies ---------------------------------------------------------------------


def chain_tension(run: Any) -> Figure:
    """The figure of the axial force in the first, the middle and the last rod, and of the extremes
    over all rods."""
    tension, title = observable(run, "tension"), "Tension (negative: compression)"
    if tension is None:
        return assemble(title, [])
    factor, unit = readable("N", tension)
    tension, ylabel = factor * tension, f"$N$ [{unit}]"
    rods = tension.shape[1]
    shown = np.unique([0, (rods - 1) // 2, rods - 1])
    some = [
        Curve(tension[:, rod], f"rod {rod + 1}", colour, width=0.8)
        for rod, colour in zip(shown, (BLUE, ORANGE, RED), strict=False)
    ]
    extremes = [
        Curve(tension.max(1), "largest of all rods", RED, width=0.8),
        Curve(tension.min(1), "smallest of all rods", PURPLE, width=0.8),
    ]
    rows = [[history(run, ylabel, *some)], [history(run, ylabel, *extremes) if rods > 1 else None]]
    return assemble(title, rows)


def chain_deployment(run: Any) -> Figure:
    """The figure of a chain that is paid out: length, rate, tension of the first rod, and work of the
    winch. It is empty for a chain of constant length."""
    length, tension = observable(run, "deployed_length"), observable(run, "tension")
    if length is None:
        return assemble("Deployment", [])
    factor, unit = readable("m", length)
    first = None if tension is None else tension[:, 0]
    rows = [
        [
            history(run, f"$l$ [{unit}]", Curve(factor * length)),
            history(run, r"$\dot{l}$ [m/s]", Curve(observable(run, "payout_rate"))),
        ],
        [
            history(run, "$N_1$ [N]", Curve(first)),
            history(run, "$W_w$ [J]", Curve(observable(run, "winch_work"))),
        ],
    ]
    symbols = "deployed length $l$, tension of the first rod $N_1$, work of the winch $W_w$"
    return assemble("Deployment", rows, symbols)


def chain_energies(run: Any) -> Figure:
    """The figure of the energies ([MW] Fig. 2) and of the error of their sum ([MW] Fig. 3).

    With loads or damping it also shows their work and the error of the energy balance. The potential energy
    is drawn relative to its first value, because its zero is arbitrary."""
    names = ("kinetic_energy", "elastic_energy", "potential_energy")
    kinetic, elastic, height = (observable(run, name) for name in names)
    if kinetic is None or elastic is None or height is None:
        return assemble("Energies", [])
    potential = change(height)
    total = kinetic + elastic + potential
    factor, unit = readable("J", kinetic, elastic, potential, total)
    work, dissipated = observable(run, "external_work"), observable(run, "dissipated_energy")
    winch = observable(run, "winch_work")
    balance = r"$\Delta(T + U) - W + E_d$ [J]" if winch is None else r"$\Delta(T + U) - W - W_w + E_d$ [J]"
    rows = [
        [
            history(
                run,
                f"energy [{unit}]",
                Curve(factor * kinetic, "kinetic $T$", BLUE),
                Curve(factor * elastic, "elastic $U$", ORANGE),
                Curve(factor * potential, "potential $V - V(0)$", PURPLE),
                Curve(factor * total, "total $E$", "black", "--"),
            )
        ],
        [history(run, r"energy error $e_E$ [-]", Curve(observable(run, "energy_error")))],
        [
            history(
                run,
                "work [J]",
                Curve(work, "loads and fields"),
                Curve(dissipated, "dissipated", RED),
                Curve(winch, "winch", PURPLE),
            )
        ],
        [history(run, balance, Curve(observable(run, "energy_balance_error")))],
    ]
    symbols = "" if work is None else "work of loads and fields $W$, dissipated energy $E_d$"
    symbols += "" if winch is None else ", work of the winch $W_w$"
    return assemble("Energies", rows, symbols)
