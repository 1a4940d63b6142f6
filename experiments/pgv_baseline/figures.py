"""Fig. 6 to 10 of [PGV] from the runs at 0 and 10 deg and without voltage."""

import numpy as np
from layout import BLACK, BLUE, GREEN, GREY, PURPLE, SKY, VERMILION, Line, Panel, draw
from matplotlib.figure import Figure
from signals import DEGREES, norm, power_spectrum, turns

from esail_jax.observables.rigid_pendulum import rigid_pendulum

STYLES = {"alpha-0": (r"$\alpha = 0$ deg", BLUE, "-"), "alpha-10": (r"$\alpha = 10$ deg", VERMILION, "-")}
"""Label, colour and dashes of a case."""

RIGID = {"alpha-0": ("rigid, 0 deg", SKY, "--"), "alpha-10": ("rigid, 10 deg", BLACK, "--")}
"""Label, colour and dashes of the rigid pendulum under the loads of a case."""

LINES = (
    (6.37e-4, "spin 6.37e-4 Hz", GREY, "--"),
    (4.51e-3, "first bending 4.51e-3 Hz", GREEN, "--"),
    (7.34e-3, "first bending as printed, 7.34e-3 Hz", PURPLE, ":"),
    (2.17e-2, "first axial 2.17e-2 Hz", GREY, "-."),
)
"""Vertical lines of the spectra: the frequencies of [PGV] Table 2. The second one is the correct value of
the third (`experiments/paper_errata`)."""

Runs = dict


def history(runs: Runs, letter: str, ylabel: str, signal, more: list[Line] | None = None) -> Panel:
    """A panel with a signal of both cases against time. signal: a function of a run."""
    lines = []
    for case, (label, colour, dashes) in STYLES.items():
        lines.append(Line(turns(runs[case]), signal(runs[case]), label, colour, dashes, 0.9))
    return Panel(letter, ylabel, lines + (more or []))


def spectrum(runs: Runs, letter: str, ylabel: str, signal) -> Panel:
    """A panel with the spectra of a signal in both cases and the lines of Table 2."""
    lines = []
    for case, (label, colour, dashes) in STYLES.items():
        frequency, density = power_spectrum(np.asarray(runs[case].time), signal(runs[case]))
        lines.append(Line(frequency, density, label, colour, dashes, 0.9))
    return Panel(letter, ylabel, lines, "frequency [Hz]", "xy", LINES)


def of_first(name: str, factor: float = 1.0):
    """A function of a run: an observable of tether 1."""
    return lambda run: factor * run[name][:, 0]


def component(name: str, k: int, factor: float = 1.0, tether: int | None = None):
    """A function of a run: a component of a vector, of one tether if given."""
    return lambda run: factor * (run[name][:, k] if tether is None else run[name][:, tether, k])


def motion(runs: Runs) -> Figure:
    """The figure after Fig. 6: motion of tether 1, with spectra."""
    rigid = {case: rigid_pendulum(runs[case], 0) for case in STYLES}
    rows = []
    for letter, name, symbol, index in (
        ("a", "coning_angle", r"\gamma", 1),
        ("b", "lagging_angle", r"\beta", 2),
        ("c", "tether_length", "L/L_0", None),
        ("d", "root_coning_angle", r"\gamma'", None),
        ("e", "root_lagging_angle", r"\beta'", None),
    ):
        length = name == "tether_length"
        factor = 1.0 / float(runs["alpha-0"].scene.tethers.length) if length else DEGREES
        more = []
        for case, (label, colour, dashes) in RIGID.items():
            if index is not None:
                times = turns(runs[case])
                more.append(Line(times, DEGREES * rigid[case][index], label, colour, dashes, 0.9))
        signal = of_first(name, factor)
        unit, density = ("-", "1/Hz") if length else ("deg", "deg$^2$/Hz")
        rows.append(
            [
                history(runs, f"{letter}1", f"${symbol}$ [{unit}]", signal, more),
                spectrum(runs, f"{letter}2", f"PSD of ${symbol}$ [{density}]", signal),
            ]
        )
    return draw("[PGV] Fig. 6: motion of tether 1", rows, width=5.6, height=1.9)


def forces_on_one(runs: Runs) -> Figure:
    """The figure after Fig. 7: thrust, its moment and the root reaction of tether 1, in B."""
    rows = []
    for letter, name, symbol, unit, factor in (
        ("a", "thrust_B", "F_{c1", "mN", 1e3),
        ("b", "thrust_moment_B", "M_{c1", "N m", 1.0),
        ("c", "reaction_B", r"\lambda_{1", "mN", 1e3),
    ):
        rows.append(
            [
                history(
                    runs,
                    f"{letter}{k + 1}",
                    f"${symbol},{axis}}}^B$ [{unit}]",
                    component(name, k, factor, 0),
                )
                for k, axis in enumerate("xyz")
            ]
        )
    return draw("[PGV] Fig. 7: forces and moments on tether 1 in body axes", rows)


def mean_power(run) -> np.ndarray:
    """The time average of the dissipated power since the start [W]; NaN at the start."""
    time, energy = np.asarray(run.time), run["dissipated_energy"]
    return np.divide(energy, time, out=np.full(len(time), np.nan), where=time > 0.0)


def energies(runs: Runs) -> Figure:
    """The figure after Fig. 8: energies. Panels (e) and (f) are not in the paper."""
    off = runs["voltage-off"]

    def total(run):
        return run["kinetic_energy"] + run["elastic_energy"]

    start = total(off)[0]
    silent = Line(turns(off), total(off), "voltage off", GREEN, "--", 0.9)
    change = Line(turns(off), total(off) / start - 1.0, "voltage off", GREEN, "-", 0.9)
    return draw(
        "[PGV] Fig. 8: energies; (e) and (f) are not in the paper",
        [
            [
                history(runs, "a", "$E_T$ [J]", total, [silent]),
                history(runs, "b", "$E_k$ [J]", lambda run: run["kinetic_energy"]),
            ],
            [
                history(runs, "c", "$E_e$ [J]", lambda run: run["elastic_energy"]),
                history(
                    runs,
                    "d",
                    "mean dissipated\npower [$\\mu$W]",
                    lambda run: 1e6 * mean_power(run),
                ),
            ],
            [
                history(
                    runs, "e", "dissipated\nenergy [mJ]", lambda run: 1e3 * run["dissipated_energy"]
                ),
                Panel("f", "$E_T / E_T(0) - 1$ [-]", [change]),
            ],
        ],
        width=5.2,
    )  # fmt: skip


def forces_on_sail(runs: Runs) -> Figure:
    """The figure after Fig. 9: thrust and reactions of the sail."""
    rows = []
    for letter, name, index in (("a", "thrust", "c"), ("b", "reaction", r"\lambda")):
        unit, factor = ("N m", 1.0) if name == "thrust" else ("mN m", 1e3)
        rows.append(
            [
                history(runs, f"{letter}1", rf"$\|F_{index}\|$ [mN]", norm_of(f"{name}_O", 1e3)),
                history(
                    runs, f"{letter}2", rf"$\|M_{index}\|$ [{unit}]", norm_of(f"{name}_moment_O", factor)
                ),
                history(runs, f"{letter}3", rf"$\Gamma_{index}$ [deg]", angle_of(f"{name}_angle")),
            ]
        )
    for letter, name, index in (("c", "thrust", "c"), ("d", "reaction", r"\lambda")):
        rows.append(
            [
                history(
                    runs,
                    f"{letter}{k + 1}",
                    rf"$F_{{{index},{axis}}}^O$ [mN]",
                    component(f"{name}_O", k, 1e3),
                )
                for k, axis in enumerate("xyz")
            ]
        )
    return draw("[PGV] Fig. 9: thrust and root reactions of the sail, in orbital axes", rows)


def norm_of(name: str, factor: float):
    """A function of a run: the norm of a vector."""
    return lambda run: factor * norm(run[name])


def angle_of(name: str):
    """A function of a run: an angle in degrees."""
    return lambda run: DEGREES * run[name]


def attitude(runs: Runs) -> Figure:
    """The figure after Fig. 10: angular rates and attitude of the hub, attitude of the sail."""
    names = (r"\psi", r"\theta", r"\phi")
    capitals = (r"\Psi", r"\Theta", r"\Phi")

    def euler(name: str, k: int):
        return lambda run: DEGREES * np.unwrap(run[name][:, k])

    tilted = runs["alpha-10"]
    compared = []
    for k in range(3):
        hub, sail = euler("euler_hub", k)(tilted), euler("euler_sail", k)(tilted)
        lines = [
            Line(turns(tilted), hub, "hub (B frame), 10 deg", VERMILION, "-", 0.9),
            Line(turns(tilted), sail, "sail (E frame), 10 deg", BLACK, "-", 0.9),
        ]
        compared.append(Panel(f"c{k + 1}", f"${names[k]}$, ${capitals[k]}$ [deg]", lines))
    return draw(
        "[PGV] Fig. 10: angular rates of the hub, attitude of hub and sail",
        [
            [
                history(
                    runs,
                    f"a{k + 1}",
                    rf"$\omega_{k + 1}^B$ [mrad/s]",
                    component("angular_velocity_B", k, 1e3),
                )
                for k in range(3)
            ],
            [history(runs, f"b{k + 1}", f"${names[k]}$ [deg]", euler("euler_hub", k)) for k in range(3)],
            compared,
        ],
    )


FIGURES = {
    "fig-06": motion,
    "fig-07": forces_on_one,
    "fig-08": energies,
    "fig-09": forces_on_sail,
    "fig-10": attitude,
}
"""Figures of the paper by file name."""
