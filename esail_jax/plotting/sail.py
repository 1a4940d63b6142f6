"""Figures of the whole sail: energies, forces and attitude ([PGV] Fig. 8, 9 and 10)."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from esail_jax.observables.saved_rows import observable
from esail_jax.plotting.data import DEGREES, change
from esail_jax.plotting.panels import Curve, Panel, assemble, components, history, unwrapped_degrees
from esail_jax.plotting.style import BLUE, ORANGE


def energies(run: Any) -> Figure:
    """The figure of energies, dissipated energy, external work and the error of their balance
    ([PGV] Fig. 8).

    The dissipated energy is the time integral of the power; the paper shows an average of the power.
    """
    kinetic, elastic = observable(run, "kinetic_energy"), observable(run, "elastic_energy")
    total = None if kinetic is None or elastic is None else kinetic + elastic
    dissipated, supplied = observable(run, "dissipated_energy"), observable(run, "external_work")
    error, winch = observable(run, "energy_balance_error"), observable(run, "winch_work")
    balance = r"\Delta E_T - W_{ext} + E_d" + ("" if winch is None else " - W_w")
    rows = [
        [
            history(run, r"$E_T - E_T(0)$ [J]", Curve(change(total))),
            history(run, r"$E_k - E_k(0)$ [J]", Curve(change(kinetic))),
            history(run, r"$E_e$ [J]", Curve(elastic)),
        ],
        [
            history(run, r"$E_d$ [J]", Curve(dissipated)),
            history(run, r"$W_{ext}$ [J]", Curve(supplied)),
            history(run, f"${balance}$ [J]", Curve(error)),
        ],
    ]
    symbols = "total $E_T$, kinetic $E_k$, elastic $E_e$, dissipated $E_d$, work of the loads $W_{ext}$"
    symbols += "" if winch is None else ", of the winches $W_w$"
    return assemble("Energies", rows, symbols)


def sail_forces(run: Any) -> Figure:
    """The figure of the thrust and of the hub's forces on the tethers: magnitudes, angles from Z_O
    and components in O ([PGV] Fig. 9)."""
    rows = [
        resultant_row(run, "thrust", "c"),
        resultant_row(run, "reaction", r"\lambda"),
        components(run, observable(run, "thrust_O"), r"F_{c,AXIS}^O", "N"),
        components(run, observable(run, "reaction_O"), r"F_{\lambda,AXIS}^O", "N"),
    ]
    symbols = r"thrust $F_c$, reactions $F_\lambda$, moments $M$, angles of the forces from $Z_O$: $\Gamma$"
    return assemble("Thrust and root reactions of the sail", rows, symbols)


def resultant_row(run: Any, kind: str, index: str) -> list[Panel | None]:
    """Panels with the norms of force and moment and with the angle of the force."""
    angle = observable(run, f"{kind}_angle", DEGREES)
    return [
        history(run, rf"$\|F_{index}\|$ [N]", Curve(norm(observable(run, f"{kind}_O")))),
        history(run, rf"$\|M_{index}\|$ [N m]", Curve(norm(observable(run, f"{kind}_moment_O")))),
        history(run, rf"$\Gamma_{index}$ [deg]", Curve(angle)),
    ]


def norm(vectors: np.ndarray | None) -> np.ndarray | None:
    """The norms of vectors (time, 3)."""
    return None if vectors is None else np.linalg.norm(vectors, axis=1)


def attitude(run: Any) -> Figure:
    """The figure of the hub's angular velocity, the Euler angles of hub and sail, and the sailing
    and precession angles ([PGV] Fig. 10)."""
    precession = unwrapped_degrees(observable(run, "precession_angle"))
    rows = [
        components(run, observable(run, "angular_velocity_B"), r"\omega_AXIS^B", "rad/s"),
        euler_row(run),
        [
            history(run, r"$\alpha$ [deg]", Curve(observable(run, "sailing_angle", DEGREES))),
            history(run, r"$\delta$ [deg]", Curve(precession)),
            None,
        ],
    ]
    symbols = (
        r"angular velocity $\omega$, Euler angles $\psi, \theta, \phi$, "
        r"sailing angle $\alpha$, precession angle $\delta$"
    )
    return assemble("Attitude", rows, symbols)


def euler_row(run: Any) -> list[Panel | None]:
    """Panels with psi, theta and phi of hub and sail, as far as they exist."""
    hub = unwrapped_degrees(observable(run, "euler_hub"))
    sail = unwrapped_degrees(observable(run, "euler_sail"))
    return [
        history(
            run,
            rf"${symbol}$ [deg]",
            Curve(None if hub is None else hub[:, k], "hub", BLUE),
            Curve(None if sail is None else sail[:, k], "sail", ORANGE, "--"),
        )
        for k, symbol in enumerate((r"\psi", r"\theta", r"\phi"))
    ]
