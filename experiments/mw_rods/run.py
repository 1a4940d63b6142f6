"""Repeats Ma and Wang's two experiments with esail_jax: energies, tips, Exudyn, error against time.

    python experiments/mw_rods/run.py                        # everything (about nine minutes)
    python experiments/mw_rods/run.py energy tips steel ode45 steps precision    # or some of these

energy:     Figs. 2 and 3 of the paper for gravity along +-X, +-Y, +-Z; energy.csv
tips:       tip of the first experiment compared with references/; tips.csv, chaos.csv
steel:      Figs. 4 and 5, the second experiment compared with references/ and Exudyn; steel.csv
ode45:      both experiments with ode45.py, without code of esail_jax; ode45.csv (one and a half minutes)
steps:      fixed explicit steps in the second experiment; steps.csv
precision:  error against run time of several methods (precision.py); work_precision.csv

Figures are written to figures/. References come from reference.py (no code of esail_jax) and peer.py
(Exudyn).
"""

import argparse

import figures
import numpy as np
import precision
from chains import DIRECTIONS as UNIT
from common import (
    DEFAULT,
    DIRECTIONS,
    METHODS,
    distance,
    energies,
    reference_error,
    reference_name,
    relative_error,
    table_of,
    tip,
    write,
)
from ode45 import ode45
from reference import SOFT, STEEL

import esail_jax as esail

BOUND_ENERGY, BOUND_TIP = 6e-6, 8e-3  # bounds of the paper, from its Figs. 3 and 5 [-, m]
MODELS = {"rigid": "plus_x", "tree": "plus_x", "thin": "plus_x", "elastic": "plus_x"}


def hanging(direction: str, **options) -> esail.Solution:
    """Simulates the first experiment, saved every 0.01 s."""
    return esail.simulate("hanging-chain", {"gravity.acceleration": DIRECTIONS[direction], **options})


def energy() -> None:
    """Computes energies and their errors in the first experiment, for all directions and four methods."""
    runs = {(d, name): hanging(d, **options) for d in DIRECTIONS for name, options in METHODS.items()}
    rows = []
    for (direction, name), run in runs.items():
        parts = energies(run)
        rows.append(
            {
                "gravity": direction,
                "method": name,
                "steps": run.stats["steps"],
                "energy_error": float(np.abs(run["energy_error"]).max()),
                "eq31": float(np.abs(relative_error(run)).max()),
                "E0_J": float(parts["total"][0]),
                "largest_T_J": float(parts["kinetic"].max()),
                "smallest_V_J": float(parts["potential"].min()),
                "largest_V_J": float(parts["potential"].max()),
                "largest_U_J": float(parts["elastic"].max()),
                "largest_z_m": float(np.abs(np.asarray(run["joint_position"])[..., 2]).max()),
            }
        )
    write("energy.csv", rows)
    figures.energies({d: runs[d, DEFAULT] for d in DIRECTIONS})
    figures.energy_errors(runs, BOUND_ENERGY)


def tips() -> None:
    """Compares the tip of the first experiment, with the default method, with the references."""
    rows, away = [], {}
    for direction in DIRECTIONS:
        name = reference_name(direction)
        reference, run = table_of(name), hanging(direction)
        away[direction] = (reference[:, 0], distance(run, reference))
        last = tip(run)[-1]
        rows.append(
            {
                "gravity": direction,
                **{f"{axis}_m": f"{value:.12f}" for axis, value in zip("xyz", last, strict=True)},
                "off_at_5_s_m": float(away[direction][1][-1]),
                "largest_off_m": float(away[direction][1].max()),
                "reference_error_m": reference_error(name),
                "digits": float(np.log10(np.linalg.norm(reference[-1, 1:4]) / away[direction][1][-1])),
            }
        )
    write("tips.csv", rows)
    write("chaos.csv", chaos(*away["-X"]))
    figures.tips(away, table_of("exp1_minus_x_spread"))


def chaos(times: np.ndarray, off: np.ndarray) -> list[dict]:
    """For gravity along -X, the times when errors exceed limits, and the growth rate of small
    changes."""
    spread, growth = table_of("exp1_minus_x_spread"), table_of("exp1_growth")
    rows = []
    for limit in (1e-10, 1e-9, 1e-8, 1e-6, 1e-4, 1e-2):
        late = times[np.argmax(off > limit)] if (off > limit).any() else np.nan
        rows.append(
            {"quantity": f"error of the package exceeds {limit:g} m from [s]", "value": float(late)}
        )
    inside = (spread[:, 0] > 3.0 - 1e-9) & (spread[:, 0] < 4.5 + 1e-9)
    for name, column in (("tips", 1), ("all rods", 2)):
        rate = np.polyfit(spread[inside, 0], np.log(spread[inside, column]), 1)[0]
        rows.append(
            {"quantity": f"growth rate of the spread, {name}, 3 to 4.5 s [1/s]", "value": float(rate)}
        )
    rows.append(
        {"quantity": "spread of tips at 5 s, starts 1e-12 m apart [m]", "value": float(spread[-1, 1])}
    )
    for direction, row in zip(UNIT, growth, strict=True):
        rows.append(
            {"quantity": f"tips at 5 s per distance at the start, {direction}", "value": float(row[0])}
        )
    return rows


def steel() -> None:
    """Computes the path of the tip in the second experiment, and its distance from references and
    Exudyn."""
    run, reference = esail.simulate("steel-chain"), table_of("exp2_plus_x")
    off = {"reference": distance(run, reference)}
    off |= {
        f"exudyn {model}": distance(run, table_of(f"exudyn_{model}_{d}")) for model, d in MODELS.items()
    }
    rows = [
        {"against": name, "largest_m": float(d.max()), "at_1_s_m": float(d[-1])} for name, d in off.items()
    ]
    along = esail.simulate("steel-chain", {"gravity.acceleration": DIRECTIONS["-Y"]})
    for model in ("rigid", "elastic"):
        d = distance(along, table_of(f"exudyn_{model}_minus_y"))
        rows.append(
            {
                "against": f"exudyn {model}, gravity -Y",
                "largest_m": float(d.max()),
                "at_1_s_m": float(d[-1]),
            }
        )
    moved = np.linalg.norm(tip(along) - tip(along)[0], axis=1)
    rows.append(
        {"against": "its start, gravity -Y", "largest_m": float(moved.max()), "at_1_s_m": float(moved[-1])}
    )
    write("steel.csv", rows)
    figures.path(run, reference)
    figures.tip_distance(run.time, off, BOUND_TIP)
    if off["reference"].max() > 1e-6:
        raise SystemExit("the tip of the second experiment is more than 1e-6 m from its reference")


def matlab() -> None:
    """Integrates both experiments by ode45, with output every 1e-4 s."""
    rows = []
    cases = [("exp1", d, tolerance) for d in DIRECTIONS for tolerance in (1e-3, 1e-4, 1e-5, 1e-6)]
    for case, direction, tolerance in [*cases, ("exp2", "+X", 1e-3)]:
        chain = SOFT if case == "exp1" else STEEL
        name = reference_name(direction, int(case[-1]))
        key, reference = name.split("_", 1)[1], table_of(name)
        times, states, steps = ode45(chain, key, tolerance)
        total = chain.energy(states[:, 0], states[:, 1], UNIT[key])
        every = (len(times) - 1) // (len(reference) - 1)
        error = np.abs(total - total[0]).max()
        off = np.linalg.norm(states[::every, 0].sum(1) - reference[:, 1:4], axis=1)
        rows.append(
            {
                "case": case,
                "gravity": direction,
                "RelTol": tolerance,
                "steps": steps,
                "energy_error_J": float(error),
                "eq31": float(error / abs(total[0])) if total[0] else float("nan"),
                "tip_off_m": float(off.max()),
            }
        )
    write("ode45.csv", rows)


FIXED = {
    "dopri5": (1e-4, 2e-5, 1.6e-5, 1.4e-5, 1.2e-5, 1e-5, 8e-6, 6e-6, 5.6e-6, 5e-6),
    "dopri8": (3e-5, 2.4e-5, 2.2e-5, 2e-5, 1.5e-5),
}


def steps() -> None:
    """Runs the second experiment with fixed steps, and records which are stable and how the others fail."""
    rows, reference = [], table_of("exp2_plus_x")
    fastest = np.sqrt(np.linalg.eigvals(STEEL.matrices(np.float64)[1]).real.max())  # [1/s]
    for method, step in ((m, h) for m, sizes in FIXED.items() for h in sizes):
        row = {"method": method, "step_s": step, "step_times_fastest": float(step * fastest)}
        row |= dict.fromkeys(("largest_off_m", "energy_error"), "")
        try:
            run = esail.simulate("steel-chain", {"integrator.method": method, "integrator.step": step})
            off, error = distance(run, reference), np.abs(run["energy_error"])
            row |= {"largest_off_m": float(off.max()), "energy_error": float(error.max()), "outcome": "ran"}
        except esail.SimulationError as failure:
            row["outcome"] = " ".join(str(failure).split())
        rows.append(row)
    write("steps.csv", rows)


PARTS = {
    "energy": energy,
    "tips": tips,
    "steel": steel,
    "ode45": matlab,
    "steps": steps,
    "precision": precision.main,
}


def main() -> None:
    """Runs the chosen parts in their order."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all if none is named")
    chosen = parser.parse_args().parts or list(PARTS)
    for name, part in PARTS.items():
        if name in chosen:
            part()


if __name__ == "__main__":
    main()
