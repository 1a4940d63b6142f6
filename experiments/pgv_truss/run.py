"""Five cables or nine trusses per tether: Fig. 11 and 12 of [PGV].

    python experiments/pgv_truss/run.py

Runs the baseline at 10 deg over three spin periods with five cables, nine trusses and nine cables per
tether, writes differences.csv and figures/*.png beside this file, and prints the table.
"""

import csv
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "pgv_common"))

from kept_runs import model_run
from layout import BLUE, VERMILION, Line, Panel, draw, save
from signals import DEGREES, turns

STYLES = {"5 cables": ("cable", 5, BLUE, "-"), "9 trusses": ("truss", 9, VERMILION, "--")}
"""Model, number of elements, colour and dashes of the compared runs."""

ANGLES = ("coning_angle", "root_coning_angle", "lagging_angle", "root_lagging_angle")


def signals(run) -> dict[str, np.ndarray]:
    """The signals of both figures by name, (time) each."""
    found = {name: DEGREES * run[name][:, 0] for name in ANGLES}
    for k in range(3):
        found[f"omega_{k + 1}"] = 1e3 * run["angular_velocity_B"][:, k]
    for k, name in enumerate(("psi", "theta", "phi")):
        found[name] = DEGREES * np.unwrap(run["euler_hub"][:, k])
    for name in ("thrust", "reaction", "thrust_moment", "reaction_moment"):
        factor = 1.0 if name == "thrust_moment" else 1e3
        for k, axis in enumerate("xyz"):
            found[f"{name}_{axis}"] = factor * run[f"{name}_O"][:, k]
    return found


def panels(found: dict[str, dict], letters: str, names: list[str], labels: list[str]) -> list[Panel]:
    """One row of panels."""
    row = []
    for k, (name, label) in enumerate(zip(names, labels, strict=True)):
        lines = []
        for title, (_, _, colour, dashes) in STYLES.items():
            lines.append(Line(found[title]["turns"], found[title][name], title, colour, dashes, 0.9))
        row.append(Panel(f"{letters}{k + 1}", label, lines))
    return row


def motion(found: dict[str, dict]):
    """The figure after Fig. 11: angles of tether 1, angular rates and attitude of the hub."""
    return draw(
        "[PGV] Fig. 11: five cables and nine trusses per tether, 10 deg",
        [
            panels(
                found, "a", ["coning_angle", "root_coning_angle"], [r"$\gamma$ [deg]", r"$\gamma'$ [deg]"]
            ),
            panels(
                found, "b", ["lagging_angle", "root_lagging_angle"], [r"$\beta$ [deg]", r"$\beta'$ [deg]"]
            ),
            panels(
                found,
                "c",
                [f"omega_{k}" for k in (1, 2, 3)],
                [rf"$\omega_{k}^B$ [mrad/s]" for k in (1, 2, 3)],
            ),
            panels(
                found, "d", ["psi", "theta", "phi"], [rf"$\{s}$ [deg]" for s in ("psi", "theta", "phi")]
            ),
        ],
    )


def forces(found: dict[str, dict]):
    """The figure after Fig. 12: thrust, reactions and their moments in the orbital frame."""
    rows = []
    for letter, name, symbol, unit in (
        ("a", "thrust", "F_{c", "mN"),
        ("b", "reaction", r"F_{\lambda", "mN"),
        ("c", "thrust_moment", "M_{c", "N m"),
        ("d", "reaction_moment", r"M_{\lambda", "mN m"),
    ):
        labels = [f"${symbol},{axis}}}^O$ [{unit}]" for axis in "xyz"]
        rows.append(panels(found, letter, [f"{name}_{axis}" for axis in "xyz"], labels))
    return draw("[PGV] Fig. 12: five cables and nine trusses per tether, 10 deg", rows)


def differences(found: dict[str, dict]) -> list[dict]:
    """The rms difference of each signal from nine cables, relative to the range of the signal."""
    reference, rows = found["9 cables"], []
    for name, true in reference.items():
        if name != "turns":
            row = {"signal": name, "range": np.ptp(true)}
            for title in STYLES:
                row[title] = np.sqrt(np.mean((found[title][name] - true) ** 2)) / np.ptp(true)
            rows.append(row)
    return rows


def main() -> None:
    """Runs everything, writes the table and the figures, prints the table."""
    runs = {title: model_run(model, n) for title, (model, n, _, _) in STYLES.items()}
    runs["9 cables"] = model_run("cable", 9)
    found = {title: signals(run) | {"turns": turns(run)} for title, run in runs.items()}
    rows = differences(found)
    with open(HERE / "differences.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.3e}" if isinstance(v, float) else v for k, v in row.items()})
            print("".join(f"{v:12.2e}" if isinstance(v, float) else f"{v:20s}" for v in row.values()))
    save(motion(found), HERE / "figures" / "fig-11.png")
    save(forces(found), HERE / "figures" / "fig-12.png")


if __name__ == "__main__":
    main()
