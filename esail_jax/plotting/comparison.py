"""Figures that compare runs: every panel shows one quantity of all runs.

Of a sail they show tether 1, the whole sail and the energies; of a rod chain its tip and its energies.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from esail_jax.errors import InputError
from esail_jax.observables.saved_rows import observable, per_tether
from esail_jax.plotting.data import DEGREES, KILOMETRE, Mark, change, release_marks
from esail_jax.plotting.dates import dated_figures, epoch_of
from esail_jax.plotting.figure_files import Told, write_figures
from esail_jax.plotting.panels import Curve, Panel, against_time, assemble, time_unit, unwrapped_degrees
from esail_jax.plotting.sail import norm
from esail_jax.plotting.tether import of_tether
from esail_jax.scenes.key_reference import differing_keys

Runs = Mapping[str, Any]
"""Solutions or loaded run files, by the name that the legend shows."""

Signal = Callable[[Any], np.ndarray | None]
"""A function from a run to one of its signals (time); None if the run lacks it."""


class Quantity(NamedTuple):
    """What a panel shows. label: symbol with unit; words: what the symbol is, with the symbol, for the
    title; signal: of a run; logarithmic: whether the axis is."""

    label: str
    words: str
    signal: Signal
    logarithmic: bool = False


DASHES = ("-", "--", "-.", ":")
"""Line styles of the runs, in turn, so that lines on top of each other are seen."""

COLUMNS = 2
"""Panels in a row."""

MOST_WORDS = 3
"""Most quantities that a line of the title explains."""

MOST_KEYS = 2
"""Largest number of differing scene keys that the legend shows with their values."""


def compare(runs: Runs, calendar: bool = False) -> dict[str, Figure]:
    """Figures of several runs, by name.

    runs: solutions or loaded run files, by the name for the legend. The legend also shows the scene keys in
    which the runs differ, if there are at most two. Time is in spin periods or orbits if these are equal,
    and else in seconds, or with `calendar` a date. Panels for which no run has data are left out.

    Raises InputError if there is no run, or if there are runs of a sail and of a rod chain, and
    ArgumentError for dates of runs without an epoch or with several.

        weak = esail.simulate("baseline", {"voltage.value": 10e3})
        figures = compare({"20 kV": esail.simulate("baseline"), "10 kV": weak})
        figures["compare_tether"].savefig("tether.png")
    """
    if not runs:
        raise InputError("`runs` must have at least one run, but is empty")
    kinds = {name: run.scene.model for name, run in runs.items()}
    first = next(iter(kinds))
    for name, kind in kinds.items():
        if kind != kinds[first]:
            words = {"sail": "a sail", "chain": "a rod chain"}
            raise InputError(
                f"`{name}` must be of {words[kinds[first]]} like `{first}`, but is of {words[kind]}"
            )
    make = (compare_tether, compare_sail, compare_energies)
    if kinds[first] == "chain":
        make = (compare_tip, compare_chain_energies)
    made = {function.__name__: function(runs) for function in make}
    shown = {name: figure for name, figure in made.items() if figure.axes}
    if not calendar:
        return shown
    epoch = epoch_of(run.scene for run in runs.values())
    return dict(dated_figures(shown.items(), epoch, *common_time_unit(list(runs.values()))))


def write_comparison(
    runs: Runs, directory: str | Path, tell: Told = None, kind: str = "png", calendar: bool = False
) -> list[Path]:
    """Writes the figures of `compare` as DIRECTORY/<name>.<kind>; returns the paths, and tells each of them
    as soon as the file is written. kind: png, pdf or svg; calendar: as for `compare`. Raises
    what `compare` raises, before anything is written, and OSError."""
    return write_figures(compare(runs, calendar).items(), directory, tell, kind)


def compare_tether(runs: Runs) -> Figure:
    """The figure of the motion of tether 1."""

    def angle(name: str) -> Signal:
        return lambda run: of_tether(observable(run, name, DEGREES), 0)

    def strain(run: Any) -> np.ndarray | None:
        return of_tether(observable(run, "max_axial_strain"), 0)

    def length(run: Any) -> np.ndarray | None:
        undeformed = per_tether(run.scene.tethers.length, run.scene.tethers.count)[0]
        return of_tether(observable(run, "tether_length", 1.0 / undeformed), 0)

    quantities = [
        Quantity(r"$\gamma_1$ [deg]", r"coning $\gamma$", angle("coning_angle")),
        Quantity(r"$\beta_1$ [deg]", r"lagging $\beta$", angle("lagging_angle")),
        Quantity(r"$\gamma'_1$ [deg]", r"coning at the root $\gamma'$", angle("root_coning_angle")),
        Quantity(r"$\beta'_1$ [deg]", r"lagging at the root $\beta'$", angle("root_lagging_angle")),
        Quantity("$L/L_0$ [-]", "length $L$", length),
        Quantity(r"$\epsilon_1$ [-]", r"strain $\epsilon$", strain),
    ]
    return figure_of(runs, "Tether 1", quantities)


def compare_sail(runs: Runs) -> Figure:
    """The figure of the attitude, the spin and the forces of the whole sail."""

    def of(name: str, factor: float = 1.0) -> Signal:
        return lambda run: observable(run, name, factor)

    def size(name: str) -> Signal:
        return lambda run: norm(observable(run, name))

    def precession(run: Any) -> np.ndarray | None:
        return unwrapped_degrees(observable(run, "precession_angle"))

    distance = of("smallest_tether_distance", 1.0 / KILOMETRE)
    quantities = [
        Quantity(r"$\alpha$ [deg]", r"sailing angle $\alpha$", of("sailing_angle", DEGREES)),
        Quantity(r"$\delta$ [deg]", r"precession $\delta$", precession),
        Quantity(r"$\|\omega\|$ [rad/s]", r"hub's angular velocity $\omega$", size("angular_velocity_B")),
        Quantity("$d_{min}$ [km]", "smallest distance of a tip to another tether $d_{min}$", distance),
        Quantity(r"$\|F_c\|$ [N]", "thrust $F_c$", size("thrust_O")),
        Quantity(r"$\|M_c\|$ [N m]", "moment of the thrust $M_c$", size("thrust_moment_O")),
    ]
    return figure_of(runs, "The whole sail", quantities)


def compare_energies(runs: Runs) -> Figure:
    """The figure of the energies of a sail and of the error of their balance."""

    def kinetic(run: Any) -> np.ndarray | None:
        return change(observable(run, "kinetic_energy"))

    def error(run: Any) -> np.ndarray | None:
        return largest_so_far(observable(run, "energy_balance_error"))

    quantities = [
        Quantity("$E_k - E_k(0)$ [J]", "kinetic $E_k$", kinetic),
        Quantity("$E_e$ [J]", "elastic $E_e$", lambda run: observable(run, "elastic_energy")),
        Quantity(
            "$W_{ext}$ [J]", "work of the loads $W_{ext}$", lambda run: observable(run, "external_work")
        ),
        Quantity("$E_d$ [J]", "dissipated $E_d$", lambda run: observable(run, "dissipated_energy")),
        Quantity(r"$\max|\Delta E - W_{ext} + E_d|$ [J]", "error of the balance", error, logarithmic=True),
    ]
    return figure_of(runs, "Energies", quantities)


def compare_tip(runs: Runs) -> Figure:
    """The figure of the tip of a rod chain relative to its first joint, and of its tension."""

    def tip(axis: int) -> Signal:
        def coordinate(run: Any) -> np.ndarray | None:
            joints = observable(run, "joint_position")
            return None if joints is None else joints[:, -1, axis] - joints[:, 0, axis]

        return coordinate

    def tension(rod: int) -> Signal:
        def force(run: Any) -> np.ndarray | None:
            tensions = observable(run, "tension")
            return None if tensions is None else tensions[:, rod]

        return force

    where = "tip relative to the first joint"
    quantities = [
        Quantity("$x_{tip}$ [m]", where, tip(0)),
        Quantity("$y_{tip}$ [m]", where, tip(1)),
        Quantity("$z_{tip}$ [m]", where, tip(2)),
        Quantity("$N$, first rod [N]", "tension $N$", tension(0)),
        Quantity("$N$, last rod [N]", "tension $N$", tension(-1)),
    ]
    return figure_of(runs, "The chain", quantities)


def compare_chain_energies(runs: Runs) -> Figure:
    """The figure of the energies of a rod chain and of their errors."""

    def potential(run: Any) -> np.ndarray | None:
        return change(observable(run, "potential_energy"))

    def error(name: str) -> Signal:
        return lambda run: largest_so_far(observable(run, name))

    quantities = [
        Quantity("$T$ [J]", "kinetic $T$", lambda run: observable(run, "kinetic_energy")),
        Quantity("$U$ [J]", "elastic $U$", lambda run: observable(run, "elastic_energy")),
        Quantity("$V - V(0)$ [J]", "potential $V$", potential),
        Quantity(r"$\max|e_E|$ [-]", "relative change of their sum $e_E$", error("energy_error"), True),
        Quantity(
            r"$\max|\Delta(T + U) - W + E_d|$ [J]",
            "work of loads and fields $W$, dissipated $E_d$",
            error("energy_balance_error"),
            True,
        ),
    ]
    return figure_of(runs, "Energies", quantities)


def largest_so_far(values: np.ndarray | None) -> np.ndarray | None:
    """The largest absolute value of a signal (time) up to every instant. It is easier to read on a
    logarithmic axis than the signal, which passes through zero."""
    return None if values is None else np.maximum.accumulate(np.abs(values))


def figure_of(runs: Runs, title: str, quantities: Sequence[Quantity]) -> Figure:
    """A figure with one panel per quantity that a run has data for, two in a row, and one line per run; the
    legend lies below it."""
    unit, xlabel = common_time_unit(list(runs.values()))
    colours = colours_of(len(runs))
    marks = common_marks(runs, colours)
    bare = [mark._replace(label=None) for mark in marks]

    def panel(quantity: Quantity) -> Panel | None:
        curves = [
            Curve(
                quantity.signal(run), None, colours[i], DASHES[i % len(DASHES)], times=np.asarray(run.time)
            )
            for i, run in enumerate(runs.values())
        ]
        return against_time(unit, xlabel, quantity.label, curves, quantity.logarithmic, bare)

    made = [(quantity, panel(quantity)) for quantity in quantities]
    shown = [(quantity, drawn) for quantity, drawn in made if drawn is not None]
    panels: list[Panel | None] = [drawn for _, drawn in shown]
    panels += [None] * (len(panels) % COLUMNS)
    rows = [panels[i : i + COLUMNS] for i in range(0, len(panels), COLUMNS)]
    words = list(dict.fromkeys(quantity.words for quantity, _ in shown))
    lines_of_words = [", ".join(words[i : i + MOST_WORDS]) for i in range(0, len(words), MOST_WORDS)]
    figure = assemble(title, rows, ",\n".join(lines_of_words))
    lines = [
        Line2D([], [], color=colours[i], linestyle=DASHES[i % len(DASHES)], label=text)
        for i, text in enumerate(legend_texts(runs))
    ]
    lines += [
        Line2D([], [], color=mark.colour, linewidth=0.6, label=mark.label) for mark in marks if mark.label
    ]
    if figure.axes:
        figure.legend(handles=lines, loc="outside lower center", ncols=min(2, len(lines)), fontsize="small")
    return figure


def common_marks(runs: Runs, colours: Sequence[Any]) -> list[Mark]:
    """The instants at which tethers are released: once if they are the same in all runs, otherwise
    those of every run in its colour and with its name."""
    every = [release_marks(run) for run in runs.values()]
    if all(marks == every[0] for marks in every):
        return every[0]
    return [
        Mark(mark.time, mark.label and f"{name}: {mark.label}", colour)
        for name, marks, colour in zip(runs, every, colours, strict=True)
        for mark in marks
    ]


def common_time_unit(runs: Sequence[Any]) -> tuple[float, str]:
    """The unit of the time axis [s] and its label: that of all runs if it is the same, and else
    seconds."""
    units = {time_unit(run) for run in runs}
    return units.pop() if len(units) == 1 else (1.0, "time $t$ [s]")


def colours_of(count: int) -> Sequence[Any]:
    """One colour per run, from a scale that colour-blind readers can tell apart, without its pale
    end."""
    return list(colormaps["viridis"](np.linspace(0.0, 0.85, count)))


def legend_texts(runs: Runs) -> list[str]:
    """The name of every run, with the values of the keys in which the scenes differ if these are
    few."""
    keys = differing_keys([run.scene for run in runs.values()])
    shown = keys if len(keys) <= MOST_KEYS else {}
    values = [", ".join(f"{key} = {row[i]}" for key, row in shown.items()) for i in range(len(runs))]
    return [f"{name}: {text}" if text else name for name, text in zip(runs, values, strict=True)]
