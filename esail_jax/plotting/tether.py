"""Figures of tethers: motion and forces of one tether ([PGV] Fig. 6 and 7), motion and voltages of all
tethers."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from esail_jax.observables.rigid_pendulum import rigid_pendulum
from esail_jax.observables.saved_rows import observable, per_tether
from esail_jax.plotting.data import DEGREES, KILOMETRE, ROUNDING, readable
from esail_jax.plotting.modal_lines import ModalLine, modal_lines
from esail_jax.plotting.panels import Curve, Panel, assemble, components, history, spectrum, tether_colours
from esail_jax.plotting.style import ORANGE

KEY_TICKS = 12
"""Largest number of labels beside the colour bar of the tethers."""


def tether_motion(run: Any, tether: int = 0, modes: Any = None) -> Figure:
    """The figure of one tether's angles at tip and root and of its length, with spectra ([PGV] Fig.
    6).

    The tip angles of the rigid pendulum (`observables.rigid_pendulum`) under the run's moments are also
    drawn. modes: an `esail_jax.ModeTable`, whose modes are lines in the spectra; None for none.
    """
    number = tether + 1
    rigid = rigid_pendulum(run, tether)
    coning = lagging = None
    if rigid is not None:
        times, *angles = rigid
        coning, lagging = (
            Curve(DEGREES * angle, "rigid pendulum", ORANGE, "--", times=times) for angle in angles
        )
    across, within, along = (modal_lines(modes, kind) for kind in ("out-of-plane", "in-plane", "axial"))
    rows = [
        angle_row(run, tether, "coning_angle", rf"\gamma_{{{number}}}", across, coning),
        angle_row(run, tether, "lagging_angle", rf"\beta_{{{number}}}", within, lagging),
        length_row(run, tether, along),
        angle_row(run, tether, "root_coning_angle", rf"\gamma'_{{{number}}}", across),
        angle_row(run, tether, "root_lagging_angle", rf"\beta'_{{{number}}}", within),
    ]
    symbols = r"coning $\gamma$, lagging $\beta$ (primed: at the root), length $L$, spectral density PSD"
    return assemble(f"Motion of tether {number}", rows, symbols)


def angle_row(
    run: Any, tether: int, name: str, symbol: str, lines: Sequence[ModalLine], rigid: Curve | None = None
) -> list[Panel | None]:
    """Panels with the history of an angle, of that of the rigid tether if given, and with the
    spectrum and the modes in it."""
    angle = of_tether(observable(run, name, DEGREES), tether)
    curves = [Curve(angle)] if rigid is None else [Curve(angle, "simulated"), rigid]
    return [
        history(run, rf"${symbol}$ [deg]", *curves),
        spectrum(run, rf"PSD of ${symbol}$ [deg$^2$/Hz]", angle, lines),
    ]


def length_row(run: Any, tether: int, lines: Sequence[ModalLine]) -> list[Panel | None]:
    """Panels with history and spectrum of the ratio of length to undeformed length, and the modes
    in it."""
    undeformed = per_tether(run.scene.tethers.length, run.scene.tethers.count)[tether]
    ratio = of_tether(observable(run, "tether_length", 1.0 / undeformed), tether)
    return [
        history(run, r"$L/L_0$ [-]", Curve(ratio)),
        spectrum(run, r"PSD of $L/L_0$ [1/Hz]", ratio, lines),
    ]


def tether_forces(run: Any, tether: int = 0) -> Figure:
    """The figure of one tether's thrust, its moment about the root and the root reaction, in the
    body frame B ([PGV] Fig. 7)."""
    number = tether + 1
    quantities = (
        ("thrust_B", f"F_{{c,{number},AXIS}}^B", "N"),
        ("thrust_moment_B", f"M_{{c,{number},AXIS}}^B", "N m"),
        ("reaction_B", rf"\lambda_{{{number},AXIS}}^B", "N"),
    )
    rows = [
        components(run, of_tether(observable(run, name), tether), symbol, unit)
        for name, symbol, unit in quantities
    ]
    symbols = r"thrust $F_c$, its moment $M_c$ about the root, root reaction $\lambda$"
    return assemble(f"Forces on tether {number} in the body frame", rows, symbols)


def of_tether(values: np.ndarray | None, tether: int) -> np.ndarray | None:
    """The values of one tether from values (time, tether, ...)."""
    return None if values is None else values[:, tether]


def all_tethers(run: Any) -> Figure:
    """The figure of coning, lagging and largest strain of every tether, and of the smallest
    distance of a tip to another tether."""
    distance = observable(run, "smallest_tether_distance", 1.0 / KILOMETRE)
    rows = [
        [
            tether_lines(run, r"$\gamma_i$ [deg]", observable(run, "coning_angle", DEGREES)),
            tether_lines(run, r"$\beta_i$ [deg]", observable(run, "lagging_angle", DEGREES)),
        ],
        [
            tether_lines(run, r"$\epsilon_{max,i}$ [-]", observable(run, "max_axial_strain")),
            history(run, r"$d_{min}$ [km]", Curve(distance, colour="black")),
        ],
    ]
    symbols = (
        r"coning $\gamma_i$, lagging $\beta_i$, largest strain $\epsilon_{max,i}$, "
        r"smallest distance of a tip to another tether $d_{min}$"
    )
    return with_key(assemble("All tethers", rows, symbols), run.scene.tethers.count)


def deployment(run: Any) -> Figure:
    """The figure of tethers that are paid out: length, rate, lagging, and tension and power of their
    winches. It is empty for tethers of constant length."""
    length = observable(run, "deployed_length")
    if length is None:
        return assemble("Deployment", [])
    factor, unit = readable("m", length)
    rows = [
        [
            tether_lines(run, f"$l_i$ [{unit}]", factor * length),
            tether_lines(run, r"$\dot{l}_i$ [m/s]", observable(run, "payout_rate")),
        ],
        [
            tether_lines(run, r"$\beta_i$ [deg]", observable(run, "lagging_angle", DEGREES)),
            tether_lines(run, r"$|n_{0,i}|$ [N]", observable(run, "winch_tension")),
        ],
        [
            tether_lines(run, r"$P_{w,i}$ [W]", observable(run, "winch_power")),
            history(run, r"$W_w$ [J]", Curve(observable(run, "winch_work"), colour="black")),
        ],
    ]
    symbols = (
        r"deployed length $l_i$, lagging $\beta_i$, tension at the guide $|n_{0,i}|$, "
        r"power $P_{w,i}$ and work $W_w$ of the winches"
    )
    return with_key(assemble("Deployment", rows, symbols), run.scene.tethers.count)


def voltages(run: Any) -> Figure:
    """The figure of the voltage of every tether and of the electric power of all. It is empty if
    all tethers have one voltage that stays the same, and no power is reported."""
    volts, power = observable(run, "voltage"), observable(run, "electric_power")
    if volts is None or (power is None and is_constant(volts)):
        return assemble("Voltages", [])
    factor, unit = readable("V", volts)
    rows = [
        [tether_lines(run, f"$V_i$ [{unit}]", factor * volts)],
        [history(run, "$P_{el}$ [W]", Curve(power, colour="black"))],
    ]
    symbols = "voltage $V_i$" + ("" if power is None else ", electric power of all tethers $P_{el}$")
    return with_key(assemble("Voltages", rows, symbols), run.scene.tethers.count)


def is_constant(values: np.ndarray) -> bool:
    """Tells whether all finite values are the same but for rounding."""
    known = values[np.isfinite(values)]
    return bool(np.ptp(known) <= ROUNDING * np.abs(known).max())


def with_key(figure: Figure, count: int) -> Figure:
    """The figure with a bar that shows the colour of every tether, if there are several."""
    if count > 1 and figure.axes:
        norm = BoundaryNorm(np.arange(count + 1) + 0.5, count)
        key = ScalarMappable(norm, ListedColormap(tether_colours(count)))
        ticks = np.arange(1, count + 1, -(-count // KEY_TICKS))
        figure.colorbar(key, ax=figure.axes, label="tether $i$ [-]", ticks=ticks, aspect=40)
    return figure


def tether_lines(run: Any, ylabel: str, values: np.ndarray | None) -> Panel | None:
    """A panel with one thin line per tether, from values (time, tether)."""
    if values is None:
        return None
    lines = zip(values.T, tether_colours(values.shape[1]), strict=True)
    return history(run, ylabel, *(Curve(line, colour=colour, width=0.7) for line, colour in lines))
