"""Computes reference solutions of two experiments with chains of elastic rods, and their uncertainty.

    python experiments/mw_rods/reference.py soft growth stiff    # any of the three

soft:   n = 20, EA = 1000 N, T = 5 s, gravity along +-X, +-Y, +-Z: paths of the tip.
growth: the same chain, starts that differ slightly: growth rate of their distance, and when rods go slack.
stiff:  n = 11 rods of steel, T = 1 s, gravity along +X: path of the tip; +Z must be its mirror image.

The script uses no code of esail_jax: chains.py has the equations and the two integrators. The reference is
Gauss with the shorter step; each file of references/ states the distance to Gauss with the longer step and
to DOP853 with two tolerances. Constants are the double-precision numbers nearest to the decimal ones.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from chains import DIRECTIONS, Chain, dop853, gauss, tip

FOLDER = Path(__file__).parent / "references"
SOFT = Chain(rods=20, mass=0.1, length=1.0, stiffness=1000.0, duration=5.0, saved=0.05, speed=1.0)
AREA = np.pi * 1e-6  # [m^2]
STEEL = Chain(
    rods=11,
    mass=7801.0 * AREA * 0.1,
    length=0.1,
    stiffness=207e9 * AREA,
    duration=1.0,
    saved=0.005,
    speed=0.0,
)


def write(name, columns, table, notes):
    """Writes references/<name>.csv: comments, then rows of 17 digits."""
    FOLDER.mkdir(exist_ok=True)
    header = "\n".join(
        ("made by experiments/mw_rods/reference.py", *notes, "columns: " + ", ".join(columns))
    )
    np.savetxt(FOLDER / f"{name}.csv", np.asarray(table, float), "%.16e", ",", header=header)
    print(name, *notes, sep="\n    ", flush=True)


def path(name, chain, direction, steps, tolerances):
    """Integrates in four ways, writes the path of the tip with their differences, and returns the path."""
    methods = {f"Gauss, step {step:g} s": (gauss, *chain.start(), step) for step in steps}
    methods |= {f"DOP853, tolerance {tolerance:g}": (dop853, tolerance) for tolerance in tolerances}
    labels, runs, seconds = list(methods), [], []
    for method, *options in methods.values():
        begin = time.perf_counter()
        runs.append(method(chain, DIRECTIONS[direction], *options))
        seconds.append(time.perf_counter() - begin)
    (x, v), times, kept = runs[1], chain.times(), tip(runs[1][0])
    energy = chain.energy(x, v, DIRECTIONS[direction])
    strain = np.sqrt((x * x).sum(-1)) / chain.length - 1
    off = np.array([np.abs(tip(run[0]) - kept).max(-1) for run in runs], float)
    notes = [
        f"path of the free end, gravity {direction}; kept: {labels[1]}, long double",
        "largest difference of a coordinate from what is kept [m], at all times and at the end:",
        *(f"  {labels[k]}: {off[k].max():.1e}, {off[k, -1]:.1e}" for k in (0, 2, 3)),
        f"energy drifts by {np.abs(energy - energy[0]).max():.1e} J; "
        f"strains at these times from {strain.min():.2e} to {strain.max():.2e}",
    ]
    columns, table = ["t [s]", "x [m]", "y [m]", "z [m]"], [times, *kept.T]
    if off[0].max() > 1e-10:  # chaotic: the errors are written row by row
        columns += [f"error of {labels[k]} [m]" for k in (0, 3)]
        table += [off[0], off[3]]
        for k in (0, 3):
            late = [
                f"{limit:g} m from {times[np.argmax(off[k] > limit)]:.2f} s"
                for limit in (1e-12, 1e-10, 1e-8)
            ]
            notes.append(f"{labels[k]} is off by more than {', '.join(late)} on")
    write(name, columns, np.column_stack(table), notes)
    print(f"    end: {', '.join(np.format_float_positional(u, 17) for u in kept[-1])} m")
    print(f"    seconds: {np.round(seconds, 1)}", flush=True)
    return kept


def separations(direction, size, step=0.0025):
    """Integrates nine starts: the original, and eight with each component of each x_i changed by +-size
    [m].

    Returns, over time, the largest distance between two tips [m], and the largest distance from the
    original over all rods [m] (root of the sum of squares)."""
    x, v = SOFT.start()
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (8, SOFT.rods, 3))
    starts = x + np.concatenate([np.zeros((1, SOFT.rods, 3)), signs]) * np.longdouble(size)
    x, _ = gauss(SOFT, DIRECTIONS[direction], starts, np.broadcast_to(v, starts.shape), step)
    tips = np.linalg.norm((tip(x)[:, :, None] - tip(x)[:, None]).astype(float), axis=-1).max((1, 2))
    rods = np.linalg.norm((x[:, 1:] - x[:, :1]).astype(float).reshape(len(x), 8, -1), axis=-1).max(1)
    return tips, rods


def slope(times, distance, window):
    """The growth rate [1/s], the slope of ln(distance) by least squares."""
    inside = (times > window[0] - 1e-9) & (times < window[1] + 1e-9)
    return np.polyfit(times[inside], np.log(distance[inside]), 1)[0]


def growth_rates(size=1e-14, large=1e-9):
    """Writes a table of the growth of a change of the start for the six directions."""
    times, rows, window = SOFT.times(), [], (3.0, 4.5)
    for name in DIRECTIONS:
        tips, rods = separations(name, size)
        mean = np.log(rods[-1] / rods[0]) / times[-1]
        late, end = slope(times, rods, window), separations(name, large)[0][-1]
        rows.append([tips[-1] / size, rods[-1] / size, mean, late, end])
        print(f"    {name}:", *(f"{value:.3g}" for value in rows[-1]), flush=True)
    columns = [f"distance of tips at 5 s / {size:g} m", f"distance over all rods at 5 s / {size:g} m"]
    columns += ["mean rate of the latter [1/s]", "its rate from {} to {} s [1/s]".format(*window)]
    columns += [f"distance of tips at 5 s from starts moved by {large:g} m [m]"]
    moved = f"starts with each component of each x_i moved by +-{size:g} m (last column {large:g} m)"
    write("exp1_growth", columns, rows, [f"rows: gravity {', '.join(DIRECTIONS)}", moved])


def slack(direction):
    """Sentences that say when rods of the soft chain are in compression."""
    chain = replace(SOFT, saved=0.001)
    x, _ = gauss(chain, DIRECTIONS[direction], *chain.start(), 0.001)
    strain, times = np.sqrt((x * x).sum(-1)).astype(float) / chain.length - 1, chain.times()
    first = [times[np.argmax((strain < limit).any(-1))] for limit in (-1e-9, -0.01, -0.05)]
    parts = np.split(strain[1:], 5)
    shares = ", ".join(f"{(part < 0).mean():.2f} ({part.min():.3f})" for part in parts)
    return [
        "a rod is in compression first at {:.3f} s, by 1 % at {:.3f} s, by 5 % at {:.3f} s".format(*first),
        f"share of the rods in compression, and the least strain, in each second: {shares}",
    ]


def spread(direction="minus_x", size=1e-12, window=(3.0, 4.5)):
    """Writes the distance over time between starts that differ by `size` [m], for the chaotic direction."""
    times, (tips, rods) = SOFT.times(), separations(direction, size)
    notes = [
        f"gravity {direction}: nine starts, eight with each component of each x_i moved by +-{size:g} m",
        f"from {window[0]} to {window[1]} s the tips part as exp({slope(times, tips, window):.2f} t), "
        f"all rods as exp({slope(times, rods, window):.2f} t), t in s",
        *slack(direction),
    ]
    columns = ["t [s]", "largest distance between two tips [m]", "largest distance over all rods [m]"]
    write(f"exp1_{direction}_spread", columns, np.column_stack([times, tips, rods]), notes)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("experiments", nargs="+", choices=("soft", "growth", "stiff"))
    chosen = parser.parse_args().experiments
    if "soft" in chosen:
        for name in DIRECTIONS:
            path(f"exp1_{name}", SOFT, name, (0.0025, 0.00125), (1e-12, 2.3e-14))
    if "growth" in chosen:
        growth_rates()
        spread()
    if "stiff" in chosen:
        fastest = np.sqrt(np.linalg.eigvals(STEEL.matrices(np.float64)[1]).real.max())
        print(f"fastest frequency of the steel chain: {fastest:.3e} rad/s")
        kept = path("exp2_plus_x", STEEL, "plus_x", (2e-5, 1e-5), (1e-8, 1e-10))
        x, _ = gauss(STEEL, DIRECTIONS["plus_z"], *STEEL.start(), 1e-5)
        print(f"    gravity plus_z, x and z exchanged: off by {np.abs(tip(x)[:, ::-1] - kept).max():.1e} m")


if __name__ == "__main__":
    main()
