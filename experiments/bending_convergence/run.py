"""Studies whether bending stiffness makes cable elements converge faster than trusses.

    python experiments/bending_convergence/run.py

Writes results.csv, frequencies.csv and figures/*.png beside this file and prints the README's tables.
"""

import csv
from pathlib import Path

import figures
import modes
import study as plan
from analysis import SIGNALS, Study, elements_for, errors, order, ranges
from models import STEP, Run

HERE = Path(__file__).parent


def write(name: str, rows: list[dict]) -> None:
    """Writes a table beside this file."""
    with open(HERE / name, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def result(scene: str, run: Run, reference: Run) -> dict:
    """A row of results.csv: the run, its reference, and the errors relative to each signal's
    range."""
    row = {
        "scene": scene,
        "variant": run.variant,
        "elements": run.elements,
        "EI_factor": f"{run.lane.stiffness:.0e}",
        "axial_damping_s": run.lane.axial,
        "bending_damping_s": run.lane.bending,
        "step_s": STEP / run.refine,
        "iterations": f"{run.iterations:.2f}",
        "reference": f"{reference.variant} {reference.elements}",
        "reference_EI_factor": f"{reference.lane.stiffness:.0e}",
    }
    for key, (largest, rms) in errors(run, reference).items():
        row |= {f"{key} max": f"{largest:.3e}", f"{key} rms": f"{rms:.3e}"}
    return row


def results(scene: str, found: Study) -> list[dict]:
    """Rows that compare every run with its reference, and with the run without bending."""
    rows = []
    for run in found.runs.values():
        if run is not found.reference(run.lane):
            rows.append(result(scene, run, found.reference(run.lane)))
        without = found.runs.get(("none", run.elements, run.lane._replace(stiffness=1.0, bending=0.0), 1))
        if run.variant in ("nonlinear", "linear") and run.refine == 1 and without is not None:
            rows.append(result(scene, run, without))
    return rows


def frequency_table() -> list[dict]:
    """The relative errors of the frequencies of transverse modes."""
    exact = modes.frequencies("cubic C1 (cable)", 80)
    rows = []
    for name in modes.INTERPOLATIONS:
        for n in (*plan.CABLES, 40):
            found = modes.frequencies(name, n)
            for mode in (1, 2, 3, 5):
                if mode < len(found):
                    error = found[mode] / exact[mode] - 1.0
                    row = {"interpolation": name, "elements": n, "unknowns": len(found), "mode": mode}
                    rows.append(row | {"frequency_rad_s": found[mode], "error": error})
    return rows


def print_errors(title: str, rows: dict[str, dict]) -> None:
    """Prints a table with one column per signal; of a pair of numbers only the second."""
    print(f"\n{title:38s}" + "".join(f"{key[:13]:>14s}" for key in SIGNALS))
    for name, row in rows.items():
        values = [row[key][1] if isinstance(row[key], tuple) else row[key] for key in SIGNALS]
        print(f"{name:38s}" + "".join(f"{value:14.2e}" for value in values))


def print_tables(tether: Study, sail: Study) -> None:
    """Prints the tables of the README."""
    fine, get = plan.FINE, tether.get
    print_errors("ranges", {"one tether": ranges(tether.reference()), "sail": ranges(sail.reference())})
    checks = {
        f"cable {fine} - cable {plan.FINEST}": tether.errors("nonlinear", fine),
        f"cable {fine}, half step": errors(get("nonlinear", fine, None, 2), get("nonlinear", fine)),
        "cable 5, half step": errors(get("nonlinear", 5, None, 2), get("nonlinear", 5)),
        "truss 9, half step": errors(get("truss", 9, None, 2), get("truss", 9)),
    }
    for n in (1, 5, 20, fine):
        without = get("none", n)
        checks[f"bending nonlinear - none, {n}"] = errors(get("nonlinear", n), without)
        checks[f"bending linear - none, {n}"] = errors(get("linear", n), without)
        checks[f"bending and its damping - none, {n}"] = errors(
            get("nonlinear", n, plan.AS_SHIPPED), without
        )
    print_errors("differences, rms / range", checks)
    for lane in plan.AXIAL:
        table = {}
        for variant, least in (("none", 5), ("truss", 20 if lane == plan.DAMPED else 10)):
            for n in tether.meshes(variant, lane):
                table[f"{variant} {n}"] = tether.errors(variant, n, lane)
            orders = {}
            for key in SIGNALS:
                pairs = [p for p in zip(*tether.curve(variant, key, 1, lane), strict=True) if p[0] >= least]
                orders[key] = order(*zip(*pairs, strict=True))
            table[f"{variant}, order from {least}"] = orders
        for n in (1, 2, 3, 5, 10):
            wanted = tether.errors("none", n, lane)
            table[f"trusses as accurate as {n} cables"] = {
                key: elements_for(*tether.curve("truss", key, 1, lane), wanted[key][1]) for key in SIGNALS
            }
        print_errors(f"axial damping {lane.axial:g} s, rms / range", table)
    table = {}
    for power in plan.POWERS:
        (lane,) = plan.stiffer(power)
        layer = modes.boundary_layer(10.0**power)
        stiff = get("nonlinear", fine, lane)
        table[f"EI 1e{power}, l_b {layer:.2g} m: change"] = errors(stiff, get("nonlinear", fine))
        for n in (5, 20):
            name = f"    error of {n}, l_b/l {layer * n / modes.LENGTH:.2g}"
            table[name] = tether.errors("nonlinear", n, lane)
        if ("linear", fine, lane, 1) in tether.runs:
            table[f"    linear - nonlinear, EI 1e{power}"] = errors(get("linear", fine, lane), stiff)
    print_errors("stiffer, rms / range", table)
    table = {f"{run.variant} {run.elements}": errors(run, sail.reference()) for run in sail.runs.values()}
    print_errors("sail, rms / range", table)
    for name, found, variants in (("one tether", tether, figures.STYLE), ("sail", sail, ("none", "truss"))):
        for variant in variants:
            costs = [f"{n}: {found.cost(variant, n):.1f}" for n in found.meshes(variant)]
            print(f"us per step, {name}, {variant}: {', '.join(costs)}")


def main() -> None:
    """Runs everything and reports."""
    tether, sail = Study(plan.runs_of_one_tether()), Study(plan.runs_of_the_sail())
    report(tether, sail)


def report(tether: Study, sail: Study) -> None:
    """Writes the tables, draws the figures and prints what follows from the runs."""
    table = frequency_table()
    write("results.csv", results("single-tether", tether) + results("baseline", sail))
    write(
        "frequencies.csv",
        [{k: f"{v:.6g}" if isinstance(v, float) else v for k, v in r.items()} for r in table],
    )
    figures.convergence(tether)
    figures.coordinates(tether)
    figures.stiffness(tether, plan.POWERS, plan.FINE)
    figures.frequencies(table)
    figures.sail_spin(sail)
    print_tables(tether, sail)


if __name__ == "__main__":
    main()
