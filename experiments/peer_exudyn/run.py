"""Compares the baseline sail in esail_jax and in Exudyn, signal by signal.

    pip install '.[peers]'
    python experiments/peer_exudyn/run.py [--check] [--t-end 200] [--timing]

Writes differences.csv and figures/*.png beside this file and prints the tables of the README. With --check
the exit status is 1 when a difference exceeds its bound; --timing measures the time per step instead.
"""

import argparse
import csv
import dataclasses
import sys
from pathlib import Path

import figures
import numpy as np
import sail
from inputs import sail_of
from signals import signals

import esail_jax as esail
from esail_jax.observables.sail import OBSERVABLES

HERE = Path(__file__).parent

CASES = ((0.1, 5), (0.05, 5), (0.1, 10), (0.05, 10))
"""Step [s] and elements per tether."""

INTERVAL, T_END = 5.0, 4710.0
"""Saved interval and end time [s]: three spin periods less 2.39 s. Every saved instant is the end of a
step of both codes, so no output is interpolated."""

BOUND = 1e-3
"""Largest difference, relative to the range of a signal, that passes --check."""

LOOSER = {name: 1e-2 for name in ("root_coning_angle", "root_lagging_angle", "reaction_B")}
"""Signals with another bound: those of the root contain axial vibrations of the first element."""

FLOOR = 1e-3
"""Smallest range, relative to the largest magnitude: a nearly constant signal is not divided by its
noise."""

UNITS = {entry.name: entry.unit for entry in OBSERVABLES}


def scene_of(step: float, elements: int, t_end: float) -> esail.Scene:
    """The baseline with the strain measure of Exudyn's cable."""
    return esail.load_scene(
        "baseline",
        {
            "tethers.strain": "engineering",
            "tethers.elements": elements,
            "integrator.step": step,
            "integrator.t_end": t_end,
            "output.interval": INTERVAL,
        },
    )


def both(step: float, elements: int, t_end: float) -> dict[str, dict[str, np.ndarray]]:
    """Runs one case in both codes; returns signals by code, with the same names and shapes."""
    scene = scene_of(step, elements, t_end)
    ours = esail.simulate(scene)
    given = sail_of(scene)
    every = round(INTERVAL / step)
    history = sail.simulate(given, step, round(t_end / step), every)
    theirs = signals(given, history)
    return {
        "esail_jax": {name: np.asarray(ours[name]) for name in theirs} | {"time": np.asarray(ours.time)},
        "exudyn": theirs | {"time": history.time},
    }


@dataclasses.dataclass(frozen=True)
class Difference:
    """The difference of one signal between two runs.

    largest: maximum of |x - y| over time and components; range: range in time of the component that varies
    most, at least FLOOR times the magnitude."""

    compared: str
    against: str
    signal: str
    largest: float
    range: float

    @property
    def relative(self) -> float:
        """Largest difference, relative to the range."""
        return self.largest / self.range

    @property
    def bound(self) -> float:
        """Largest relative difference that passes --check."""
        return LOOSER.get(self.signal, BOUND)

    def row(self) -> list:
        """The row of differences.csv."""
        numbers = [f"{x:.3g}" for x in (self.largest, self.range, self.relative, self.bound)]
        return [self.compared, self.against, self.signal, UNITS[self.signal], *numbers]


def differences(name: str, x: dict, against: str, y: dict) -> list[Difference]:
    """The differences of every signal between runs `x` and `y`; the ranges are those of `y`."""
    if not np.allclose(x["time"], y["time"], rtol=1e-12):
        raise ValueError(f"{name} and {against} are not saved at the same instants")
    found = []
    for signal in (key for key in x if key != "time"):
        a, b = x[signal], y[signal]
        width = max((b.max(0) - b.min(0)).max(), FLOOR * abs(b).max())
        found.append(Difference(name, against, signal, abs(a - b).max(), width))
    return found


def compare(runs: dict) -> list[Difference]:
    """The differences between the codes in every case, then of each code from itself at half the
    step."""
    found = []
    for (step, elements), case in runs.items():
        label = f"{step:g} s, {elements} elements"
        found += differences(f"esail_jax {label}", case["esail_jax"], f"exudyn {label}", case["exudyn"])
    for (step, elements), case in runs.items():
        half = runs.get((step / 2, elements))
        for code in ("esail_jax", "exudyn") if half else ():
            names = [f"{code} {h:g} s, {elements} elements" for h in (step, step / 2)]
            found += differences(names[0], case[code], names[1], half[code])
    return found


def write(found: list[Difference]) -> None:
    """Writes differences.csv."""
    with open(HERE / "differences.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["run", "against", "signal", "unit", "largest", "range", "relative", "bound"])
        writer.writerows(entry.row() for entry in found)


def show(found: list[Difference]) -> None:
    """Prints relative differences, with a row per signal and a column per pair of runs."""
    pairs = list(dict.fromkeys((entry.compared, entry.against) for entry in found))
    table = {(entry.compared, entry.against, entry.signal): entry.relative for entry in found}
    for number, (compared, against) in enumerate(pairs):
        print(f"({number}) {compared} against {against}")
    print(f"{'':20s}" + "".join(f"{f'({number})':>9s}" for number in range(len(pairs))))
    for signal in dict.fromkeys(entry.signal for entry in found):
        print(f"{signal:20s}" + "".join(f"{table[(*pair, signal)]:9.1e}" for pair in pairs))


def timing(repeats: int = 5, t_end: float = 100.0) -> None:
    """Prints the time per step, medians of alternating runs, without compiling and assembling."""
    for step, elements in ((0.1, 5), (0.1, 10)):
        scene, steps = scene_of(step, elements, t_end), round(t_end / step)
        given = sail_of(scene)
        calm = dataclasses.replace(given, load=0.0 * given.load)
        taken = {"esail_jax": [], "exudyn": [], "exudyn without wind (no Python function)": []}
        for _ in range(repeats):
            ours = esail.simulate(scene)
            times = [ours.stats["wall_time"] / ours.steps]
            times += [sail.simulate(x, step, steps, steps).seconds / steps for x in (given, calm)]
            for name, seconds in zip(taken, times, strict=True):
                taken[name].append(1e6 * seconds)
        for name, times in taken.items():
            spread = f"{min(times):.0f} to {max(times):.0f}"
            print(
                f"{elements:3d} elements  {name:42s} {np.median(times):7.0f} us per step ({spread})",
                flush=True,
            )


def main(t_end: float, check: bool) -> int:
    """Runs, writes, prints, and returns the exit status."""
    runs = {case: both(*case, t_end) for case in CASES}
    found = compare(runs)
    write(found)
    figures.draw_signals(runs[0.1, 5], runs[0.05, 5], HERE / "figures")
    figures.draw_differences(found, HERE / "figures")
    show(found)
    worse = [
        x for x in found if x.compared.split(" ")[0] != x.against.split(" ")[0] and x.relative > x.bound
    ]
    for x in worse:
        print(f"{x.signal}: {x.relative:.1e} exceeds {x.bound:.0e} ({x.compared} against {x.against})")
    return 1 if check and worse else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="exit 1 when a difference exceeds its bound")
    parser.add_argument(
        "--t-end", type=float, default=T_END, help="end time of a shorter run [s], a multiple of 5"
    )
    parser.add_argument(
        "--timing", action="store_true", help="only measure the time per step of both codes"
    )
    options = parser.parse_args()
    if options.timing:
        timing()
    else:
        sys.exit(main(options.t_end, options.check))
