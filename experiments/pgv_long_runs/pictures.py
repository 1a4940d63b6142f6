"""Figures of the long runs: histories, spectra with predicted lines, and 30 periods by other methods."""

import numpy as np
from analysis import envelope, in_plane, lines, slow_lines, turns, wave
from cases import INSTANTS, VARIED
from layout import BLACK, BLUE, GREEN, GREY, PURPLE, SKY, VERMILION, Line, Panel, draw
from matplotlib.figure import Figure
from signals import DEGREES

COLOURS = (BLACK, SKY, GREEN, VERMILION, PURPLE, GREY, BLUE)
XLABEL = "$t/T_s$ [-]"
SHOWN_TETHERS = (0, 3, 6, 9)
"""Tethers whose lagging is drawn, a quarter of a turn apart: 1, 4, 7 and 10."""


def histories(runs: dict) -> Figure:
    """The figure of 300 spin periods at 10 deg (left) and facing the Sun (right)."""
    columns = []
    for letter, name in (("10 deg", "long-alpha-10"), ("facing the Sun", "long-alpha-0")):
        run = runs[name]
        times, rates = turns(run), 1e3 * np.asarray(run["angular_velocity_B"])
        lag = DEGREES * np.asarray(run["lagging_angle"])
        lagging = [
            Line(times, lag[:, i], f"tether {i + 1}", colour, "-", 0.5)
            for i, colour in zip(SHOWN_TETHERS, (BLUE, VERMILION, GREEN, SKY), strict=True)
        ]
        if name == "long-alpha-0":
            lagging = [Line(times, lag[:, 0], "tether 1", BLUE, "-", 0.4)]
        across, distance = np.hypot(*rates[:, 1:].T), np.asarray(run["smallest_tether_distance"])
        panels = [Panel(f"lagging, {letter}", r"$\beta_i$ [deg]", lagging)]
        for ylabel, signal in (
            (r"$\omega_1^B$ [mrad/s]", rates[:, 0]),
            (r"$|\omega_{2,3}^B|$ [mrad/s]", across),
            ("smallest distance [m]", distance),
        ):
            panels.append(Panel(letter, ylabel, [Line(times, signal, "hub or sail", BLACK, "-", 0.3)]))
        columns.append(panels)
    return draw(
        "Three hundred spin periods without gravity",
        [list(row) for row in zip(*columns, strict=True)],
        width=5.2,
    )


def tilt(runs: dict) -> Figure:
    """The figure of 1000 spin periods: oscillation of the hub's axis and of the spin rate."""
    left, right = [], []
    for name, label, scale, colour, dashes in (
        ("longest-alpha-10", "10 deg", 10.0, VERMILION, "-"),
        ("longest-alpha-10-fine", "10 deg, tolerance 1e-11", 10.0, BLACK, ":"),
        ("longest-alpha-0.01", "0.01 deg", 0.01, BLUE, "-"),
    ):
        times, rates = turns(runs[name]), 1e3 * np.asarray(runs[name]["angular_velocity_B"])
        middle = np.arange(round(times[-1])) + 0.5
        across = envelope(times, np.hypot(rates[:, 1], rates[:, 2]), np.max) / scale
        left.append(Line(middle, across, label, colour, dashes, 0.7))
        right.append(Line(middle, envelope(times, rates[:, 0]), label, colour, dashes, 0.7))
    ylabel = r"largest $|\omega_{2,3}^B|$ / angle [mrad/s/deg]"
    panels = [
        Panel("a", ylabel, left, XLABEL, "y"),
        Panel("b", "range of the spin rate [mrad/s]", right, XLABEL),
    ]
    title = "One thousand spin periods, largest values of each period"
    return draw(title, [panels], width=5.2, height=2.8)


def spectrum(signal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [1 / spin period] in increasing order and amplitudes (Hann window)."""
    window = np.hanning(len(signal))
    size = np.abs(np.fft.fft((signal - signal.mean()) * window)) / window.sum()
    return np.fft.fftshift(np.fft.fftfreq(len(signal), 1.0 / INSTANTS)), np.fft.fftshift(size)


def spectra(runs: dict) -> Figure:
    """The figure of the spectra of the spin rate and of the first wave of lagging."""
    panels = []
    coning = lines(
        turns(runs["long-alpha-10"]),
        np.asarray(runs["long-alpha-10"]["coning_angle"]).mean(1),
        (1.0, 7.086),
    )
    upper = coning.frequency[1]
    marks = [
        (upper, "first mode out of the spin plane (from coning)", GREY, "--"),
        (in_plane(upper), "in the spin plane, predicted", GREEN, "--"),
    ]
    curves = []
    for name, colour, label in (
        ("long-alpha-0", BLUE, "facing the Sun"),
        ("long-alpha-10", VERMILION, "10 deg"),
    ):
        frequency, size = spectrum(1e3 * np.asarray(runs[name]["angular_velocity_B"])[:, 0])
        near = (frequency > 6.85) & (frequency < 7.25)
        curves.append(Line(frequency[near], 2 * size[near], label, colour, "-" if colour == BLUE else "--"))
    xlabel = "frequency [1/$T_s$]"
    panels.append(Panel("a", "amplitude of the spin rate [mrad/s]", curves, xlabel, "", marks))
    frequency, size = spectrum(wave(np.asarray(runs["long-alpha-10"]["lagging_angle"]), 1))
    near = np.abs(frequency) < 0.15
    slow = [(x, "slow lagging, predicted", GREEN, "--") for x in slow_lines(runs["long-alpha-10"].scene)]
    line = Line(frequency[near], DEGREES * size[near], "10 deg", VERMILION, "-")
    panels.append(Panel("b", "first wave of lagging [deg]", [line], xlabel, "", slow))
    return draw("Lines of the beating oscillations, 300 spin periods", [panels], width=5.2, height=2.8)


def variations(runs: dict) -> Figure:
    """The figure of 30 spin periods by other methods and with other numbers."""
    left, right = [], []
    for k, (name, run) in enumerate(runs.items()):
        times, colour = turns(run), COLOURS[k % len(COLOURS)]
        dashes = ("-", "--")[k // len(COLOURS)]
        spin = 1e3 * np.asarray(run["angular_velocity_B"])[:, 0]
        lag = DEGREES * np.abs(np.asarray(run["lagging_angle"])).max(1)
        middle = np.arange(round(times[-1])) + 0.5
        left.append(Line(middle, envelope(times, spin), VARIED[name].label, colour, dashes))
        right.append(Line(middle, envelope(times, lag, np.max), VARIED[name].label, colour, dashes))
    panels = [
        Panel("a", "range of the spin rate [mrad/s]", left, XLABEL),
        Panel("b", "largest lagging angle [deg]", right, XLABEL),
    ]
    return draw(
        "Thirty spin periods at 10 deg, by other methods and models", [panels], width=6.4, height=3.2
    )
