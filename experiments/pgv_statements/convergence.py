"""Statements of [PGV] Sec. 4.1 and 4.2: the start, and the convergence of cables and trusses."""

import numpy as np
from judged import FAILS, HOLDS, IN_PART, Verdict, holds_if, listed, statement
from kept_runs import ELEMENTS
from measures import (
    change,
    line_of_spin,
    rms_error,
    run_time,
    strain_of_first,
    swing_of_spin,
    thrust,
    thrust_angle,
)

FINEST = max(ELEMENTS)


@statement(
    "4.1", "Eq. 79", "The initial elongation is the steady solution of a rotating cable with a tip mass."
)
def elongation(runs):
    printed, steady = (np.asarray(run["tether_length"])[:, 0] for run in (runs.printed_start, runs.still))
    return holds_if(
        np.ptp(printed) < 0.1,
        f"with Eq. 79 as printed and the voltage off, tether 1 starts {steady[0] - printed[0]:.2f} m "
        "too short and "
        f"its length rings over {np.ptp(printed):.2f} m; from the steady solution over "
        f"{np.ptp(steady):.0e} m",
    )


@statement("4.2", "Fig. 4(a)", "One element per tether gives the thrust with an error below 1 %.")
def thrust_of_one(runs):
    errors = [abs(change(thrust, runs, model, 1)) for model in ("cable", "truss")]
    return holds_if(max(errors) < 0.01, f"error of one cable {errors[0]:.0e}, of one truss {errors[1]:.0e}")


@statement("4.2", "Fig. 4(b)", "The same for the thrust angle.")
def angle_of_one(runs):
    errors = [abs(change(thrust_angle, runs, model, 1)) for model in ("cable", "truss")]
    return holds_if(max(errors) < 0.01, f"error of one cable {errors[0]:.0e}, of one truss {errors[1]:.0e}")


@statement(
    "4.2", "Fig. 4(c)", "The elements matter moderately, but not negligibly, for the largest strain."
)
def strain_of_elements(runs):
    errors = [100 * change(strain_of_first, runs, model, n) for model, n in (("cable", 1), ("truss", 1))]
    return holds_if(
        0.1 < max(map(abs, errors)) < 10.0,
        f"one cable {errors[0]:+.2f} %, one truss {errors[1]:+.2f} %, relative to nine cables",
    )


@statement("4.2", "Fig. 4(c)", "For cables the largest strain has converged with five elements.")
def strain_of_cables(runs):
    values = [100 * change(strain_of_first, runs, "cable", n) for n in (3, 5, 7)]
    return holds_if(abs(values[1]) < 0.1, f"3, 5, 7 cables: {listed(values)} % from nine")


@statement("4.2", "Fig. 4(c)", "For trusses it has converged with nine elements.")
def strain_of_trusses(runs):
    values = [100 * change(strain_of_first, runs, "truss", n) for n in (5, 7, 9)]
    return holds_if(abs(values[-1]) < 0.1, f"5, 7, 9 trusses: {listed(values)} % from nine cables")


@statement("4.2", "Fig. 4(d)", "Cables take notably more computing time than trusses.")
def time_of_cables(runs):
    ratios = [run_time(runs, "cable", n) / run_time(runs, "truss", n) for n in (1, 5, 9)]
    return holds_if(
        min(ratios) > 1.3, f"1, 5, 9 elements: {listed(ratios, '.1f')} times a truss of the same number"
    )


@statement(
    "4.2", "Fig. 4(d)", "Relative to one cable, five cables take 5.64 and nine trusses 2.15 times as long."
)
def normalised_times(runs):
    five, nine = (
        run_time(runs, model, n) / run_time(runs, "cable", 1) for model, n in (("cable", 5), ("truss", 9))
    )
    word = HOLDS if abs(five - 5.64) < 0.6 and abs(nine - 2.15) < 0.3 else FAILS
    return Verdict(
        word, f"here {five:.1f} and {nine:.1f}: a property of the implementation, not of the elements"
    )


@statement("4.2", "Fig. 4(d)", "Only with one element per tether is the computation close to real time.")
def real_time(runs):
    seconds = [run_time(runs, "cable", n) for n in (1, 5, 9)]
    faster = [4712.0 / x for x in seconds]
    return holds_if(
        faster[1] < 1.0,
        f"1, 5, 9 cables: {listed(faster, '.0f')} times faster than real time (a statement about the "
        "paper's program)",
    )


@statement("4.2", "Fig. 5", "Bending stiffness and its modes give cables their higher rate of convergence.")
def bending(runs):
    names = ("thrust_O", "coning_angle", "lagging_angle", "max_axial_strain", "angular_velocity_B")
    with_it, without = runs.models["cable", 5], runs.models["cable, no bending", 5]
    largest = max(float(np.abs(with_it[k] - without[k]).max() / np.ptp(without[k])) for k in names)
    return holds_if(
        largest > 1e-3,
        f"five cables without bending give the same signals to {largest:.0e} of their range; the cubic "
        "interpolation converges faster, not the bending (`experiments/bending_convergence`)",
    )


@statement("4.2", "Fig. 5(b1)", "For the spin rate more than five cables do not matter at all.")
def spin_of_five(runs):
    five, seven = (rms_error(runs, "cable", n, 0) for n in (5, 7))
    return holds_if(
        five < 5e-3, f"five cables differ from nine by {five:.1e} of the range (rms), seven by {seven:.0e}"
    )


@statement("4.2", "Fig. 5(b1)", "Three cables have the frequency of the spin oscillation.")
def frequency_of_three(runs):
    three, finest = (line_of_spin(runs.models["cable", n]) for n in (3, FINEST))
    return holds_if(
        abs(three / finest - 1.0) < 1e-3,
        f"{1e3 * three:.4f} mHz with three, {1e3 * finest:.4f} mHz with nine",
    )


@statement(
    "4.2",
    "Fig. 5(b2, b3)",
    "The other two angular rates are several orders of magnitude below the spin rate.",
)
def small_rates(runs):
    rates = np.abs(runs.models["cable", 5]["angular_velocity_B"]).max(0)
    swing = swing_of_spin(runs.models["cable", 5])
    ratios = rates[0] / rates[1:]
    return holds_if(
        min(ratios) > 1e3,
        f"they are {listed(ratios, '.0f')} times smaller than the spin rate: two orders of magnitude; and "
        f"{listed(0.5 * swing / rates[1:], '.1f')} times smaller than the oscillation of the spin rate",
    )


@statement("4.2", "Fig. 5(b2, b3)", "The other two angular rates have converged with three cables.")
def rates_of_three(runs):
    errors = [rms_error(runs, "cable", 3, k) for k in (1, 2)]
    return holds_if(
        max(errors) < 0.02,
        f"rms differences of three from nine cables: {listed(errors, '.1e')} of the range",
    )


@statement("4.2", "Fig. 5(c1)", "One truss does not capture the oscillation of the spin rate.")
def one_truss(runs):
    one, true = (swing_of_spin(runs.models[key]) for key in (("truss", 1), ("cable", FINEST)))
    return holds_if(one < 0.05 * true, f"range {one:.1e} rad/s in place of {true:.1e}")


@statement("4.2", "Fig. 5(d1)", "The frequency changes with the number of trusses until nine are reached.")
def frequency_of_trusses(runs):
    lines = [1e3 * line_of_spin(runs.models["truss", n]) for n in (3, 5, 7, 9)]
    true = 1e3 * line_of_spin(runs.models["cable", FINEST])
    errors = np.array(lines) / true - 1.0
    power = np.log(errors[0] / errors[-1]) / np.log(9 / 3)
    return Verdict(
        HOLDS if errors[-1] < 1e-3 else IN_PART,
        f"3, 5, 7, 9 trusses: {listed(lines, '.3f')} mHz; cables {true:.3f} mHz. It still changes at "
        "nine: the error, "
        f"{100 * errors[-1]:.1f} %, decreases with the power {power:.1f} of the number",
    )


@statement(
    "4.2",
    "Fig. 5(d1)",
    "Nine trusses have converged for the spin rate, up to a moderate error of the amplitude.",
)
def nine_trusses(runs):
    errors = [rms_error(runs, "truss", FINEST, k) for k in range(3)]
    ratio = swing_of_spin(runs.models["truss", FINEST]) / swing_of_spin(runs.models["cable", FINEST])
    times = errors[0] / rms_error(runs, "cable", 5, 0)
    return holds_if(
        max(errors) < 0.02,
        f"range within {100 * abs(ratio - 1):.1f} %, but rms differences of the three rates from nine "
        "cables "
        f"{listed(errors, '.2f')} of their range: the phase is wrong, and the error of the spin rate is "
        f"{times:.0f} times that of five "
        "cables (all signals: `pgv_truss/differences.csv`)",
    )
