"""Figures of the whole sail: energies, forces and attitude ([PGV] Fig. 8, 9 and 10)."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from esail_jax.observables.saved_rows import observable
from esail_jax.plotting.data import DEGREES, change
from esail_jax.plotting.panels import Curve, Panel, assemble, components, history, unwrapped_degrees


def energies(run: Any) -> Figure:
    """Energies, what was lost and supplied, and the balance of all ([PGV] Fig. 8).

    The dissipated energy is the time integral of the power, not the paper's average of it.
    """
    kinetic, elastic = observable(run, "kinetic_energy"), observable(run, "elastic_energy")
    total = None if kinetic is None or elastic is None else kinetic + elastic
    lost, supplied = observable(run, "dissipated_energy"), observable(run, "external_work")
    error = observable(run, "energy_balance_error")
    rows = [
        [
            history(run, r"$E_T - E_T(0)$ [J]", Curve(change(total))),
            history(run, r"$E_k - E_k(0)$ [J]", Curve(change(kinetic))),
            history(run, r"$E_e$ [J]", Curve(elastic)),
        ],
        [
            history(run, r"$E_d$ [J]", Curve(lost)),
            history(run, r"$W_{ext}$ [J]", Curve(supplied)),
            history(run, r"$\Delta E_T - W_{ext} + E_d$ [J]", Curve(error)),
        ],
    ]
    return assemble("Energies", rows)


def sail_forces(run: Any) -> Figure:
    """Thrust, and forces of the hub on the tethers: sizes, angles from Z_O and components in O
    ([PGV] Fig. 9)."""
    rows = [
        resultant_row(run, "thrust", "c"),
        resultant_row(run, "reaction", r"\lambda"),
        components(run, observable(run, "thrust_O"), r"F_{c,AXIS}^O", "N"),
        components(run, observable(run, "reaction_O"), r"F_{\lambda,AXIS}^O", "N"),
    ]
    return assemble("Thrust and root reactions of the sail", rows)


def resultant_row(run: Any, kind: str, index: str) -> list[Panel | None]:
    """Norms of force and moment, and the angle of the force."""
    angle = observable(run, f"{kind}_angle", DEGREES)
    return [
        history(run, rf"$\|F_{index}\|$ [N]", Curve(norm(observable(run, f"{kind}_O")))),
        history(run, rf"$\|M_{index}\|$ [N m]", Curve(norm(observable(run, f"{kind}_moment_O")))),
        history(run, rf"$\Gamma_{index}$ [deg]", Curve(angle)),
    ]


def norm(vectors: np.ndarray | None) -> np.ndarray | None:
    """Lengths of vectors (time, 3)."""
    return None if vectors is None else np.linalg.norm(vectors, axis=1)


def attitude(run: Any) -> Figure:
    """Angular velocity of the hub, Euler angles of hub and sail, sailing and precession angle
    ([PGV] Fig. 10)."""
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
    return assemble("Attitude", rows)


def euler_row(run: Any) -> list[Panel | None]:
    """psi, theta, phi of hub and sail, those that there are."""
    hub = unwrapped_degrees(observable(run, "euler_hub"))
    sail = unwrapped_degrees(observable(run, "euler_sail"))
    return [
        history(
            run,
            rf"${symbol}$ [deg]",
            Curve(None if hub is None else hub[:, k], "hub", "tab:blue"),
            Curve(None if sail is None else sail[:, k], "sail", "tab:orange", "--"),
        )
        for k, symbol in enumerate((r"\psi", r"\theta", r"\phi"))
    ]
