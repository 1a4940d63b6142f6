"""Measures of long runs: lines of beating oscillations, envelopes, and what theory predicts for both."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from cases import TURN
from scipy.optimize import least_squares

from esail_jax.observables.rigid_pendulum import inertia


def turns(run) -> np.ndarray:
    """The saved instants in spin periods."""
    return np.asarray(run.time) / TURN


def wave(values: np.ndarray, number: int) -> np.ndarray:
    """The complex amplitude (time) of a wave over the tethers, from values (time, tether).

    A wave of number 1 has one maximum around the sail. Number 0 is the mean."""
    count = values.shape[1]
    turning = np.exp(-2j * np.pi * number * np.arange(count) / count)
    return (1.0 if number == 0 else 2.0) * (values * turning).mean(1)


class Lines(NamedTuple):
    """Lines of a signal: frequencies per spin period, amplitudes, and the share of the rms outside them."""

    frequency: np.ndarray
    amplitude: np.ndarray
    rest: float


def lines(times: np.ndarray, signal: np.ndarray, guess: tuple[float, ...]) -> Lines:
    """The lines of a signal near guessed frequencies [1 / spin period], by least squares.

    A real signal is fitted by a mean and cosines, a complex one by a mean and rotating numbers. The
    amplitudes follow linearly from the frequencies.
    """
    whole = np.iscomplexobj(signal)

    def basis(frequency):
        rotating = np.exp(2j * np.pi * np.outer(times, frequency))
        parts = [rotating] if whole else [rotating.real, rotating.imag]
        return np.hstack([np.ones((len(times), 1)), *parts])

    def fitted(frequency):
        return basis(frequency) @ np.linalg.lstsq(basis(frequency), signal, rcond=None)[0]

    def misfit(frequency):
        gap = signal - fitted(frequency)
        return np.concatenate([gap.real, gap.imag]) if whole else gap

    found = least_squares(misfit, guess, x_scale=1e-3).x
    weights = np.linalg.lstsq(basis(found), signal, rcond=None)[0][1:]
    sizes = np.abs(weights) if whole else np.hypot(*weights.reshape(2, len(found)))
    rest = np.sqrt(np.mean(np.abs(misfit(found)) ** 2) * (2 if whole else 1)) / np.std(signal)
    return Lines(found, sizes, float(rest))


def envelope(times: np.ndarray, signal: np.ndarray, measure=np.ptp) -> np.ndarray:
    """A measure of a real signal within each whole spin period."""
    count = round(times[-1])
    edges = np.searchsorted(times, np.arange(count + 1) - 1e-9)
    return np.array([measure(signal[a : b + 1]) for a, b in pairwise(edges)])


def in_plane(out_of_plane: float) -> float:
    """The frequency [1 / spin period] of the first transverse mode in the spin plane.

    Out of the plane the tension alone restores. In the plane the centrifugal force, which is radial, takes
    the square of the spin rate from the square of this frequency.
    """
    return float(np.sqrt(out_of_plane**2 - 1.0))


def slow_lines(scene) -> np.ndarray:
    """The two frequencies [1 / spin period] of the slow lagging wave of rigid tethers.

    The hub (mass M) moves against the tethers. With q = p S^2 / (2 I (M + p m)), where S and I are the
    first and second moments of a tether with its remote unit about the root and m is their mass, and with
    eps of [PGV] Eq. 84, the complex amplitude W of the first wave of lagging (`wave`) obeys, in units of
    the spin rate,

        W'' + eps W = q (d/dt - i)^2 W,

    so that a motion exp(i f t) has f^2 - eps = q (f - 1)^2.
    """
    tethers, hub = scene.tethers, scene.hub
    total, eps = inertia(scene, 0)
    unit = float(scene.remote_units.mass)
    mass = float(tethers.density) * float(tethers.area) * float(tethers.length)
    first = (unit + 0.5 * mass) * float(tethers.length)
    body = float(hub.density) * np.pi * float(hub.radius) ** 2 * float(hub.height)
    q = tethers.count * first**2 / (2.0 * total * (body + tethers.count * (unit + mass)))
    return np.sort(np.roots([1.0 - q, 2.0 * q, -q - eps]).real)


def single_line(scene) -> float:
    """The frequency sqrt(eps) [1 / spin period] of a tether's lagging about a fixed hub."""
    return float(np.sqrt(inertia(scene, 0)[1]))


def slow_amplitudes(scene, forced: float) -> np.ndarray:
    """The amplitudes of both slow lines from that of the forced line at the spin frequency.

    The tethers start undeflected and at rest: the sum of the three has W(0) = W'(0) = 0."""
    below, above = slow_lines(scene)
    return np.abs(np.linalg.solve([[1.0, 1.0], [below, above]], [-forced, -forced]))
