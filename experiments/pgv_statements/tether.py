"""Statements of [PGV] Table 2 and Sec. 4.3.1: motion and forces of tether 1."""

import numpy as np
from judged import FAILS, HOLDS, IN_PART, Verdict, holds_if, listed, statement
from measures import SPIN, density_at, prominence
from signals import DEGREES, norm, peak_frequency, per_period, turns

from esail_jax.observables.rigid_pendulum import hinge_moments, inertia, rigid_pendulum

FACING, TILTED = "alpha-0", "alpha-10"
PRINTED_BENDING, AXIAL = 7.34e-3, 2.17e-2
"""Frequencies of Table 2 [Hz]."""


def first(run, name: str) -> np.ndarray:
    """An observable of tether 1."""
    return np.asarray(run[name])[:, 0]


def moments(run) -> tuple[np.ndarray, np.ndarray, float, float]:
    """The forcing terms of Eq. 83 and 85 [rad/s^2], the spin rate [rad/s], and eps."""
    total, eps = inertia(run.scene, 0)
    flap, lag = hinge_moments(np.asarray(run["thrust_moment_B"])[:, 0], 0.0)
    return flap / total, lag / total, float(run.scene.initial.spin_rate), eps


def rms(values) -> float:
    """The root of the mean square."""
    return float(np.sqrt(np.mean(np.asarray(values) ** 2)))


@statement("4.3", "Table 2", "The first axial frequency of the tether is 2.17e-2 Hz.")
def axial_line(runs):
    found = peak_frequency(runs.printed_start, first(runs.printed_start, "tether_length"), 1e-2, 4e-2)
    return holds_if(
        abs(found / AXIAL - 1) < 0.02, f"a start with a wrong stretch rings at {1e3 * found:.2f} mHz"
    )


@statement("4.3", "Table 2", "The first bending frequency of the tether is 7.34e-3 Hz.")
def bending_line(runs):
    found = peak_frequency(runs.cases[FACING], first(runs.cases[FACING], "root_coning_angle"), 3e-3, 9e-3)
    return holds_if(
        abs(found / PRINTED_BENDING - 1) < 0.02,
        f"the spectrum of the root coning angle has its line at {1e3 * found:.2f} mHz",
    )


@statement(
    "4.3.1", "Fig. 6(a1)", "Coning rises in the first half of a spin period and falls in the second."
)
def coning_phases(runs):
    run = runs.cases[FACING]
    angle, turn = DEGREES * first(run, "coning_angle"), turns(run)
    tops = [
        turn[(turn >= k) & (turn <= k + 1)][np.argmax(angle[(turn >= k) & (turn <= k + 1)])] - k
        for k in range(3)
    ]
    return holds_if(
        max(abs(np.array(tops) - 0.5)) < 0.05,
        f"maxima of {angle.max():.3f} deg at {listed(tops, '.2f')} T_s",
    )


@statement("4.3.1", "Fig. 6(a2)", "Coning follows the spin period.")
def coning_line(runs):
    run = runs.cases[FACING]
    angle = first(run, "coning_angle")
    at_spin = density_at(run, angle, SPIN)
    at_bending = density_at(run, angle, 4.5e-3)
    return holds_if(
        at_spin > 10 * at_bending,
        f"spectral density at 1/T_s {at_spin / at_bending:.0f} times that at 4.5 mHz",
    )


@statement("4.3.1", "Fig. 6(a1)", "The sailing angle changes coning only slightly.")
def coning_of_angle(runs):
    tops = [DEGREES * first(runs.cases[case], "coning_angle").max() for case in (FACING, TILTED)]
    every = DEGREES * np.asarray(runs.cases[TILTED]["coning_angle"]).max()
    return holds_if(
        abs(tops[1] / tops[0] - 1) < 0.05,
        f"tether 1 reaches {tops[0]:.3f} and {tops[1]:.3f} deg; but at 10 deg another tether reaches "
        f"{every:.3f} deg",
    )


@statement("4.3.1", "Fig. 6(a1)", "The rigid pendulum, Eq. 83, has the same coning.")
def rigid_coning(runs):
    gaps = []
    for case in (FACING, TILTED):
        _, coning, _ = rigid_pendulum(runs.cases[case], 0)
        angle = first(runs.cases[case], "coning_angle")
        gaps.append(100 * rms(angle - coning) / np.ptp(angle))
    return holds_if(max(gaps) < 5, f"rms differences {listed(gaps, '.1f')} % of the range at 0 and 10 deg")


@statement(
    "4.3.1", "Eq. 83", "The term of gamma is of the order 1e-8, the moment's term of 1e-4 and dominant."
)
def orders_of_coning(runs):
    run = runs.cases[FACING]
    flap, _, rate, eps = moments(run)
    restoring = rate**2 * (1 + eps) * first(run, "coning_angle")
    return holds_if(
        rms(flap) > 1e-5 and rms(restoring) < 1e-7,
        f"rms {rms(restoring):.1e} and {rms(flap):.1e} rad/s^2: equal orders, as a forced oscillation "
        "about "
        "an equilibrium must have",
    )


@statement("4.3.1", "Fig. 7(b3)", "The moment that raises coning stays remarkably steady.")
def steady_moment(runs):
    spans = []
    for case in (FACING, TILTED):
        flap = moments(runs.cases[case])[0]
        spans.append(100 * np.ptp(flap) / abs(flap.mean()))
    return holds_if(max(spans) < 5, f"range {listed(spans, '.2g')} % of the mean at 0 and 10 deg")


@statement("4.3.1", "Fig. 6(b1)", "Facing the Sun, lagging is one fast oscillation whose amplitude grows.")
def lagging_at_zero(runs):
    run = runs.cases[FACING]
    beta = DEGREES * first(run, "lagging_angle")
    return holds_if(
        np.all(np.diff(per_period(run, beta, np.ptp)) > 0),
        f"ranges in the three periods {listed(per_period(run, beta, np.ptp))} deg at "
        f"{1e3 * peak_frequency(run, beta, 2e-3):.2f} mHz. Over 300 periods it is beating "
        "(`pgv_long_runs`)",
    )


@statement(
    "4.3.1", "Fig. 6(b1)", "Facing the Sun, the mean of lagging starts at zero and grows moderately."
)
def mean_lagging(runs):
    run = runs.cases[FACING]
    means = per_period(run, DEGREES * first(run, "lagging_angle"), np.mean)
    rigid = per_period(run, DEGREES * rigid_pendulum(run, 0)[2], np.mean)
    return holds_if(
        means[-1] > means[0] + 0.02,
        f"means of the three periods {listed(means, '.1g')} deg. Only the rigid pendulum's mean grows "
        f"({listed(rigid, '.2f')} deg): its hub turns at a fixed rate, while the simulated hub, which "
        "is light, turns with "
        "the tethers",
    )


@statement(
    "4.3.1", "Fig. 6(b1)", "At 10 deg lagging is the sum of two oscillations with different frequencies."
)
def two_frequencies(runs):
    run = runs.cases[TILTED]
    beta = first(run, "lagging_angle")
    slow, fast = peak_frequency(run, beta, 4e-4, 2e-3), peak_frequency(run, beta, 2e-3)
    return holds_if(
        prominence(run, beta, SPIN) > 10 and prominence(run, beta, 4.5e-3) > 10,
        f"lines at {1e3 * slow:.2f} and {1e3 * fast:.2f} mHz",
    )


@statement("4.3.1", "Fig. 6(b2)", "The fast oscillation of lagging is at about 6e-2 Hz, the bending mode.")
def fast_lagging(runs):
    found = [
        peak_frequency(run, first(run, "lagging_angle"), 2e-3)
        for run in (runs.cases[FACING], runs.cases[TILTED])
    ]
    return holds_if(
        abs(found[0] / 6e-2 - 1) < 0.1,
        f"lines at {listed([1e3 * x for x in found], '.2f')} mHz at 0 and 10 deg",
    )


@statement("4.3.1", "Fig. 6(b2)", "It has a similar amplitude in both cases.")
def similar_lagging(runs):
    a, b = (
        density_at(runs.cases[c], first(runs.cases[c], "lagging_angle"), 4.5e-3) for c in (FACING, TILTED)
    )
    return holds_if(0.5 < b / a < 2.0, f"ratio of the spectral densities {b / a:.2f}")


@statement(
    "4.3.1", "Fig. 6(b2)", "The spin frequency, 6.37e-3 Hz, is in lagging only when the sail is inclined."
)
def spin_in_lagging(runs):
    a, b = (
        density_at(runs.cases[c], first(runs.cases[c], "lagging_angle"), SPIN) for c in (FACING, TILTED)
    )
    return Verdict(
        IN_PART if b > 100 * a else FAILS,
        f"density at 1/T_s {b / a:.0f} times that of the Sun-facing sail; but 1/T_s is {1e3 * SPIN:.3f} "
        "mHz, not 6.37",
    )


@statement("4.3.1", "Eq. 85", "The restoring term of lagging is of the order 1e-12.")
def restoring_of_lagging(runs):
    run = runs.cases[TILTED]
    *_, rate, eps = moments(run)
    found = rms(rate**2 * eps * first(run, "lagging_angle"))
    return holds_if(2e-13 < found < 2e-11, f"rms {found:.1e} rad/s^2 (tether 1, three periods)")


@statement("4.3.1", "Eq. 85", "The coupling term omega gamma gamma' is of the order 1e-8.")
def coupling(runs):
    run = runs.cases[FACING]
    gamma = first(run, "coning_angle")
    rate = np.gradient(gamma, np.asarray(run.time))
    found = rms(moments(run)[2] * gamma * rate)
    return holds_if(3e-9 < found < 3e-8, f"rms {found:.1e} rad/s^2; the right equation has twice this term")


@statement(
    "4.3.1", "Eq. 85", "The moment's term is of the order 1e-8 at 10 deg, and negligible facing the Sun."
)
def moment_of_lagging(runs):
    facing, tilted = (rms(moments(runs.cases[case])[1]) for case in (FACING, TILTED))
    return holds_if(3e-9 < tilted < 3e-8 and facing < 1e-10, f"rms {tilted:.1e} and {facing:.0e} rad/s^2")


@statement(
    "4.3.1", "Fig. 6(b1)", "The rigid pendulum is inadequate for lagging: it lacks the bending oscillation."
)
def rigid_lagging(runs):
    gaps = []
    for case in (FACING, TILTED):
        beta = first(runs.cases[case], "lagging_angle")
        gaps.append(100 * rms(beta - rigid_pendulum(runs.cases[case], 0)[2]) / np.ptp(beta))
    return holds_if(min(gaps) > 10, f"rms differences {listed(gaps, '.0f')} % of the range at 0 and 10 deg")


@statement(
    "4.3.1",
    "Fig. 6(c2)",
    "The dominant frequency of the length lies between first bending and first axial mode.",
)
def length_line(runs):
    run = runs.cases[FACING]
    length = first(run, "tether_length")
    high = peak_frequency(run, length)
    tilted = runs.cases[TILTED]
    other = first(tilted, "tether_length")
    ratio = density_at(tilted, other, SPIN) / density_at(tilted, other, high)
    return Verdict(
        IN_PART if PRINTED_BENDING < high < AXIAL and ratio > 1 else FAILS,
        f"facing the Sun the highest line is at {1e3 * high:.2f} mHz: twice the first bending, no mode "
        "of its own; at 10 deg "
        f"the line of the spin is {ratio:.0f} times higher than this one",
    )


@statement("4.3.1", "Fig. 6(c1)", "The tether's length, and so its tension, stay nearly constant.")
def constant_tension(runs):
    run = runs.cases[TILTED]
    tension = norm(np.asarray(run["reaction_B"])[:, 0])
    length = first(run, "tether_length") / 1e4
    return holds_if(
        np.ptp(tension) < 0.02 * tension.mean(),
        f"length within {np.ptp(length):.0e} of 10 km; root force {1e3 * tension.min():.1f} to "
        f"{1e3 * tension.max():.1f} mN",
    )


@statement("4.3.1", "Fig. 6(d1)", "The root coning angle does not depend on the sailing angle.")
def root_coning(runs):
    a, b = (first(runs.cases[case], "root_coning_angle") for case in (FACING, TILTED))
    gap = 100 * rms(a - b) / np.ptp(a)
    return holds_if(gap < 5, f"rms difference {gap:.1f} % of the range")


@statement("4.3.1", "Fig. 6(d2)", "The root coning angle has the spin and the first bending mode.")
def root_coning_lines(runs):
    run = runs.cases[TILTED]
    found = [prominence(run, first(run, "root_coning_angle"), f) for f in (SPIN, 4.5e-3)]
    return holds_if(min(found) > 10, f"densities {listed(found, '.0e')} times the surroundings")


@statement(
    "4.3.1",
    "Fig. 6(e2)",
    "The root lagging angle lacks the rigid mode, and has a low-frequency oscillation.",
)
def root_lagging(runs):
    run = runs.cases[TILTED]
    root, tip = (first(run, name) for name in ("root_lagging_angle", "lagging_angle"))
    shares = [density_at(run, x, SPIN) / density_at(run, x, 4.5e-3) for x in (tip, root)]
    low = np.asarray(run.time)[-1]
    ratio = density_at(run, root, 1.0 / low) / density_at(run, root, SPIN)
    return holds_if(
        shares[1] < 0.1 * shares[0] and ratio > 3,
        f"density at 1/T_s over that of the bending mode: tip {shares[0]:.2g}, root {shares[1]:.2g}; at "
        "the lowest "
        f"frequency of the run, 1/(3 T_s), the root has {ratio:.0f} times the density at 1/T_s",
    )


@statement(
    "4.3.1",
    "Fig. 7(a1)",
    "The axial thrust of a tether has a lower mean at 10 deg, and oscillates more there.",
)
def axial_thrust(runs):
    facing, tilted = (1e3 * np.asarray(runs.cases[case]["thrust_B"])[:, 0, 0] for case in (FACING, TILTED))
    return holds_if(
        tilted.mean() < facing.mean() and np.ptp(tilted) > np.ptp(facing),
        f"means {facing.mean():.4f} and {tilted.mean():.4f} mN, ranges {np.ptp(facing):.4f} and "
        f"{np.ptp(tilted):.4f} mN",
    )


@statement("4.3.1", "Fig. 7(a2)", "The thrust along the tether is insignificant.")
def radial_thrust(runs):
    force = np.asarray(runs.cases[FACING]["thrust_B"])[:, 0]
    share = 100 * np.abs(force[:, 1]).max() / np.abs(force[:, 0]).max()
    return holds_if(
        share < 3, f"at most {share:.1f} % of the thrust along the axis, where coning is largest"
    )


@statement(
    "4.3.1", "Fig. 7(a3)", "The tangential thrust depends on the sailing angle and follows the spin."
)
def tangential_thrust(runs):
    facing, tilted = (np.asarray(runs.cases[case]["thrust_B"])[:, 0, 2] for case in (FACING, TILTED))
    line = peak_frequency(runs.cases[TILTED], tilted)
    return holds_if(
        np.abs(tilted).max() > 100 * np.abs(facing).max() and abs(line / SPIN - 1) < 0.05,
        f"at most {1e3 * np.abs(facing).max():.1g} and {1e3 * np.abs(tilted).max():.3f} mN, at "
        f"{1e3 * line:.2f} mHz",
    )


@statement("4.3.1", "Fig. 7(c1, c3)", "Axial and tangential root reactions correlate with the root angles.")
def reactions_and_slopes(runs):
    run = runs.cases[TILTED]
    reaction = np.asarray(run["reaction_B"])[:, 0]
    pairs = ((0, "root_coning_angle"), (2, "root_lagging_angle"))
    found = [abs(np.corrcoef(reaction[:, k], first(run, name))[0, 1]) for k, name in pairs]
    return Verdict(
        HOLDS if min(found) > 0.9 else FAILS, f"coefficients of correlation {listed(found, '.4f')}"
    )
