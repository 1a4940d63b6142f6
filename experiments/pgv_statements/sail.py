"""Statements of [PGV] Sec. 4.3.2: energy, forces and attitude of the sail."""

import numpy as np
from judged import FAILS, HOLDS, IN_PART, Verdict, holds_if, listed, statement
from measures import SPIN, density_at, prominence, swing_of_spin
from signals import DEGREES, norm, peak_frequency, per_period, turns

FACING, TILTED = "alpha-0", "alpha-10"


def total_energy(run) -> np.ndarray:
    """Kinetic plus elastic energy [J]."""
    return np.asarray(run["kinetic_energy"]) + np.asarray(run["elastic_energy"])


@statement("4.3.2", "Fig. 8(a)", "Without voltage the total energy is constant.")
def no_drift(runs):
    energy = total_energy(runs.cases["voltage-off"])
    loss = 1.0 - energy[-1] / energy[0]
    return holds_if(
        loss < 1e-8, f"it falls by {loss:.1e} of itself: the dissipation of generalized-alpha at 0.1 s"
    )


@statement(
    "4.3.2",
    "Fig. 8(a)",
    "With voltage the total energy rises, with the spin and the first bending frequency.",
)
def energy_rises(runs):
    run = runs.cases[FACING]
    energy = total_energy(run)
    means = per_period(run, energy - energy[0], np.mean)
    found = [prominence(run, energy, f) for f in (SPIN, 4.5e-3)]
    return holds_if(
        np.all(np.diff(means) > 0) and min(found) > 10,
        f"mean gains of the three periods {listed(means)} J; lines of spin and bending "
        f"{listed(found, '.0f')} times "
        "their surroundings",
    )


@statement(
    "4.3.2", "Fig. 8(b)", "Kinetic energy is the main part, and remote units and hub make its variation."
)
def kinetic_part(runs):
    run = runs.cases[FACING]
    kinetic = np.asarray(run["kinetic_energy"])
    velocity = np.gradient(np.asarray(run["hub_position_I"]), np.asarray(run.time), axis=0)
    hub = run.scene.hub
    mass = float(hub.density) * np.pi * float(hub.radius) ** 2 * float(hub.height)
    moving = 0.5 * mass * np.sum(velocity**2, axis=1)
    share = moving.max() / np.ptp(kinetic)
    return holds_if(
        kinetic[0] / total_energy(run)[0] > 0.99,
        f"{100 * kinetic[0] / total_energy(run)[0]:.2f} % of the total; it varies by "
        f"{np.ptp(kinetic):.1f} J, of which the "
        f"hub's translation has up to {100 * share:.0f} %",
    )


@statement("4.3.2", "Fig. 8(a)", "In the second half of the period the Sun-facing sail is more efficient.")
def efficiency(runs):
    gap = total_energy(runs.cases[FACING]) - total_energy(runs.cases[TILTED])
    phase = turns(runs.cases[FACING]) % 1.0
    early, late = gap[(phase < 0.5)].mean(), gap[(phase >= 0.5)].mean()
    return holds_if(
        late > early and late > 0,
        f"lead of its energy: first halves {early:.3f} J, second halves {late:.3f} J",
    )


@statement(
    "4.3.2",
    "Fig. 8(c)",
    "Elastic energy does not depend on the sailing angle and stays about a steady value.",
)
def elastic_energy(runs):
    means = [np.asarray(runs.cases[case]["elastic_energy"]).mean() for case in (FACING, TILTED)]
    rows = per_period(runs.cases[FACING], np.asarray(runs.cases[FACING]["elastic_energy"]), np.mean)
    return holds_if(
        abs(means[0] / means[1] - 1) < 1e-3 and np.ptp(rows) < 1e-3 * means[0],
        f"means {listed(means, '.4f')} J at 0 and 10 deg; of the three periods {listed(rows, '.4f')} J",
    )


@statement("4.3.2", "Fig. 8(c)", "Its frequency shows that it comes from longitudinal vibration.")
def elastic_line(runs):
    run = runs.cases[FACING]
    energy = np.asarray(run["elastic_energy"])
    found = peak_frequency(run, energy)
    ratio = density_at(run, energy, found) / density_at(run, energy, 2.17e-2)
    return holds_if(
        abs(found / 2.17e-2 - 1) < 0.1,
        f"its highest line is at {1e3 * found:.2f} mHz, {ratio:.0f} times the density at the axial "
        "mode, 21.7 mHz: the "
        "stretch follows the transverse waves, whose frequencies it has, singly and doubled",
    )


@statement("4.3.2", "Fig. 8(d)", "The energy lost by damping, E_d, is marginal and decreases with time.")
def lost_energy(runs):
    run = runs.cases[TILTED]
    lost = np.asarray(run["dissipated_energy"])
    means = per_period(run, np.asarray(run["dissipated_power"]), np.mean)
    return Verdict(
        IN_PART if np.all(np.diff(means) < 0) and lost[-1] < 1e-6 * total_energy(run)[0] else FAILS,
        f"marginal: {1e3 * lost[-1]:.2f} mJ. Lost energy only grows; what decreases is the mean power, "
        "which the paper calls "
        f"E_d: {listed([1e6 * x for x in means], '.3f')} uW in the three periods",
    )


@statement("4.3.2", "Fig. 9(a1)", "The thrust is lower at 10 deg.")
def thrust_of_angle(runs):
    facing, tilted = (1e3 * norm(runs.cases[case]["thrust_O"]).mean() for case in (FACING, TILTED))
    return holds_if(
        tilted < facing, f"{facing:.3f} and {tilted:.3f} mN, {100 * (1 - tilted / facing):.2f} % less"
    )


@statement("4.3.2", "Fig. 9(a3)", "The thrust angle is about half of the sailing angle.")
def half_angle(runs):
    angle = DEGREES * np.asarray(runs.cases[TILTED]["thrust_angle"])
    return holds_if(abs(angle.mean() - 5) < 0.1, f"{angle.min():.3f} to {angle.max():.3f} deg")


@statement(
    "4.3.2", "Fig. 9(a1)", "The thrust has its minimum at half of the period, where coning is largest."
)
def least_thrust(runs):
    run = runs.cases[FACING]
    force, turn = norm(run["thrust_O"]), turns(run)
    places = [
        turn[(turn >= k) & (turn < k + 1)][np.argmin(force[(turn >= k) & (turn < k + 1)])] - k
        for k in range(3)
    ]
    return holds_if(
        max(abs(np.array(places) - 0.5)) < 0.1,
        f"minima at {listed(places, '.2f')} T_s, {100 * np.ptp(force) / force.mean():.2f} % below the "
        "largest value",
    )


@statement("4.3.2", "Fig. 9(a2)", "At 10 deg the moment of the thrust oscillates with the spin and grows.")
def thrust_moment(runs):
    run = runs.cases[TILTED]
    moment = norm(run["thrust_moment_O"])
    tops = per_period(run, moment, np.max)
    return holds_if(
        np.all(np.diff(tops) > 0),
        f"maxima of the three periods {listed(tops)} N m: it grows as the tethers' lagging angles spread",
    )


@statement("4.3.2", "Fig. 9(b1)", "At 10 deg the lower limit of the root reactions rises.")
def least_reaction(runs):
    found = []
    for case in (FACING, TILTED):
        run = runs.cases[case]
        turn, force = turns(run), 1e3 * norm(run["reaction_O"])
        found.append(
            [force[(turn > k + 0.75) & (turn <= k + 1.25)].min() for k in range(2)]
            + [force[turn > 2.75].min()]
        )
    return holds_if(
        np.all(np.diff(found[1]) > 0),
        f"minima about 1, 2, 3 T_s: {listed(found[1])} mN at 10 deg, {listed(found[0])} mN facing the Sun",
    )


@statement("4.3.2", "Fig. 9(d3)", "The axial root reaction always pushes the hub away from the Sun.")
def axial_reaction(runs):
    tops = [1e3 * np.asarray(runs.cases[case]["reaction_O"])[1:, 2].max() for case in (FACING, TILTED)]
    return holds_if(
        max(tops) < 0, f"force of the hub on the tethers: at most {listed(tops, '.1f')} mN at 0 and 10 deg"
    )


@statement(
    "4.3.2",
    "Fig. 9(c3, d3)",
    "Tether dynamics turns a smooth thrust into a fast, large oscillation at the hub.",
)
def smooth_thrust(runs):
    run = runs.cases[FACING]
    smooth, rough = (1e3 * np.ptp(np.asarray(run[name])[:, 2]) for name in ("thrust_O", "reaction_O"))
    return holds_if(
        rough > 100 * smooth,
        f"range of the axial thrust {smooth:.3f} mN, of the axial reaction {rough:.0f} mN",
    )


@statement(
    "4.3.2",
    "Fig. 9(d1)",
    "At 10 deg the transverse reaction F_x oscillates, and its mean per period is negative.",
)
def transverse_reaction(runs):
    run = runs.cases[TILTED]
    means = per_period(run, 1e3 * np.asarray(run["reaction_O"])[:, 0], np.mean)
    thrust = 1e3 * np.asarray(run["thrust_O"])[:, 0].mean()
    return holds_if(
        np.all(means < 0), f"means of the three periods {listed(means)} mN; the thrust has {thrust:.2f} mN"
    )


@statement(
    "4.3.2", "Fig. 9(d2)", "At 10 deg F_y oscillates with growing amplitude and a very low mean per period."
)
def sideways_reaction(runs):
    run = runs.cases[TILTED]
    force = 1e3 * np.asarray(run["reaction_O"])[:, 1]
    means, ranges = (per_period(run, force, f) for f in (np.mean, np.ptp))
    return holds_if(
        np.all(np.diff(ranges) > 0) and np.abs(means / ranges).max() < 0.05,
        f"ranges {listed(ranges)} mN, means {listed(means, '.2g')} mN",
    )


@statement(
    "4.3.2", "Fig. 10(b1, c1)", "The sail slowly yaws out of the orbital plane, in the negative sense."
)
def yaw(runs):
    run = runs.cases[TILTED]
    means = per_period(run, DEGREES * np.unwrap(np.asarray(run["euler_sail"])[:, 0]), np.mean)
    return holds_if(
        np.all(np.diff(means) < 0) and means[-1] < 0,
        f"mean Psi of the three periods {listed(means, '.2g')} deg",
    )


@statement("4.3.2", "Fig. 9(b2)", "The moment of the reactions on the hub rises steadily.")
def hub_moment(runs):
    tops = [
        per_period(runs.cases[case], 1e3 * norm(runs.cases[case]["reaction_moment_O"]), np.max)
        for case in (FACING, TILTED)
    ]
    return holds_if(
        all(np.all(np.diff(x) > 0) for x in tops),
        f"maxima {listed(tops[0])} mN m facing the Sun, {listed(tops[1])} mN m at 10 deg. Over 300 "
        "periods it is beating "
        "(`pgv_long_runs`)",
    )


@statement(
    "4.3.2",
    "Fig. 9(b2)",
    "Facing the Sun it is a moment about the spin axis alone; at 10 deg all components grow.",
)
def moment_components(runs):
    parts = [
        1e3 * np.abs(np.asarray(runs.cases[case]["reaction_moment_O"])).max(0) for case in (FACING, TILTED)
    ]
    return holds_if(
        parts[0][:2].max() < 1e-6 * parts[0][2] and parts[1].min() > 1,
        f"largest x, y, z components: {listed(parts[0], '.2g')} and {listed(parts[1], '.2g')} mN m",
    )


@statement("4.3.2", "Fig. 10(a1)", "The spin rate oscillates with growing amplitude about a steady mean.")
def spin_oscillation(runs):
    run = runs.cases[FACING]
    spin = 1e3 * np.asarray(run["angular_velocity_B"])[:, 0]
    means, ranges = (per_period(run, spin, f) for f in (np.mean, np.ptp))
    return holds_if(
        np.all(np.diff(ranges) > 0) and np.ptp(means) < 0.05 * ranges.max(),
        f"ranges {listed(ranges)} mrad/s, means {listed(means, '.4f')} mrad/s",
    )


@statement(
    "4.3.2",
    "Fig. 10(a1)",
    "The sailing angle has very little effect on it; only a slight spin acceleration is seen.",
)
def spin_of_angle(runs):
    facing, tilted = (
        1e3 * np.asarray(runs.cases[case]["angular_velocity_B"])[:, 0] for case in (FACING, TILTED)
    )
    means = [
        per_period(runs.cases[c], 1e3 * np.asarray(runs.cases[c]["angular_velocity_B"])[:, 0], np.mean)
        for c in (FACING, TILTED)
    ]
    gap = np.sqrt(np.mean((facing - tilted) ** 2)) / np.ptp(facing)
    return Verdict(
        HOLDS if gap < 0.05 and means[1][-1] > means[0][-1] + 1e-3 else IN_PART if gap < 0.05 else FAILS,
        f"rms difference {100 * gap:.1f} % of the range, ranges "
        f"{1e3 * swing_of_spin(runs.cases[FACING]):.4f} and "
        f"{1e3 * swing_of_spin(runs.cases[TILTED]):.4f} mrad/s. No acceleration: the mean of the last "
        "period is "
        f"{1e6 * (means[1][-1] - means[0][-1]):+.1g} nrad/s from that of the Sun-facing sail",
    )


@statement(
    "4.3.2",
    "Fig. 10(a2, a3)",
    "The other two rates are zero facing the Sun, and oscillate with growing amplitude at 10 deg.",
)
def other_rates(runs):
    run = runs.cases[TILTED]
    rates = 1e6 * np.asarray(run["angular_velocity_B"])
    ranges = [per_period(run, rates[:, k], np.ptp) for k in (1, 2)]
    rest = np.abs(np.asarray(runs.cases[FACING]["angular_velocity_B"])[:, 1:]).max()
    return holds_if(
        all(np.all(np.diff(x) > 0) for x in ranges) and rest < 1e-12,
        f"facing the Sun below {rest:.0e} rad/s; at 10 deg ranges {listed(ranges[0])} and "
        f"{listed(ranges[1])} urad/s",
    )


@statement(
    "4.3.2",
    "Fig. 10(a)",
    "High-frequency oscillations of bending and axial modes are in the angular rates.",
)
def modes_in_rates(runs):
    run = runs.cases[TILTED]
    found = []
    for frequency in (4.5e-3, 2.17e-2):
        found.append(
            [density_at(run, np.asarray(run["angular_velocity_B"])[:, k], frequency) for k in range(3)]
        )
    ratios = np.array(found[0]) / np.array(found[1])
    line = 1e3 * peak_frequency(run, np.asarray(run["angular_velocity_B"])[:, 0])
    return Verdict(
        IN_PART if ratios.min() > 1e3 else HOLDS,
        f"bending is there ({line:.2f} mHz); the density at "
        f"the axial mode is {listed(ratios, '.0e')} times smaller",
    )


@statement("4.3.2", "Fig. 10(c)", "The plane of the remote units moves more slowly than the hub.")
def slow_plane(runs):
    run = runs.cases[TILTED]
    speeds = []
    for name in ("euler_hub", "euler_sail"):
        angle = DEGREES * np.unwrap(np.asarray(run[name])[:, 0])
        speeds.append(np.sqrt(np.mean(np.gradient(angle, np.asarray(run.time)) ** 2)))
    return holds_if(
        speeds[0] > 5 * speeds[1], f"rms rate of psi {speeds[0] / speeds[1]:.0f} times that of Psi"
    )


@statement(
    "5", "-", "Lagging angles at tip and root have a growing tendency that depends on the sailing angle."
)
def growing_lagging(runs):
    found = []
    for case in (FACING, TILTED):
        beta = DEGREES * np.abs(np.asarray(runs.cases[case]["lagging_angle"])).max(1)
        found.append(per_period(runs.cases[case], beta, np.max))
    each = DEGREES * np.abs(np.asarray(runs.cases[TILTED]["lagging_angle"])).max(0)
    return Verdict(
        HOLDS if all(np.all(np.diff(x) > 0) for x in found) else FAILS,
        f"largest angle of all tethers in the three periods: {listed(found[0], '.2f')} deg facing the Sun, "
        f"{listed(found[1], '.2f')} deg at 10 deg. Tether 1, which the paper shows, reaches "
        f"{each[0]:.2f} deg, the least of all is "
        f"{each.min():.2f} deg (tether {each.argmin() + 1}). Over 300 periods it is a slow oscillation "
        "(`pgv_long_runs`)",
    )
