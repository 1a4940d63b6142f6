"""Drop of the potential along a tether that collects electrons, and the thrust that it costs.

python experiments/potential_drop/run.py    # seconds; writes table.csv
"""

import csv
from pathlib import Path

import numpy as np
from scipy.constants import e, m_e
from scipy.integrate import solve_bvp

HERE = Path(__file__).parent
RESISTIVITY = 2.7e-8
"""Of aluminium [Ohm m]."""
CUTOFF = 1e3
CASES = (
    # name, length [m], wires, wire radius [m], voltage [V], density [1/m^3]
    ("baseline, four wires of 25 um", 10e3, 4, 12.5e-6, 20e3, 7.3e6),
    ("the same at 0.3 au", 10e3, 4, 12.5e-6, 20e3, 7.3e6 / 0.09),
    ("20 km at 40 kV", 20e3, 4, 12.5e-6, 40e3, 7.3e6),
    ("20 km at 40 kV, 0.3 au", 20e3, 4, 12.5e-6, 40e3, 7.3e6 / 0.09),
    ("one wire of 25 um, 20 km", 20e3, 1, 12.5e-6, 20e3, 7.3e6),
)


def collected(volts, wires, radius, density):
    """Electron current per length of a tether [A/m] (`loads/electron_current.py`)."""
    return wires * 2.0 * radius * e * density * np.sqrt(2.0 * e * np.maximum(volts, 0.0) / m_e)


def drop_to_first_order(length, wires, radius, volts, density):
    """Drop from root to tip [V] for a current that is collected evenly: R' i L^2 / 2."""
    resistance = RESISTIVITY / (wires * np.pi * radius**2)
    return 0.5 * resistance * collected(volts, wires, radius, density) * length**2


def drop(length, wires, radius, volts, density):
    """Drop from root to tip [V] and the loss of the thrust [-]: V'' = R' i(V), V(0) given, V'(L) = 0."""
    resistance = RESISTIVITY / (wires * np.pi * radius**2)
    scale = resistance * length**2 / volts

    def slope(x, y):
        return np.stack([y[1], scale * collected(volts * y[0], wires, radius, density)])

    x = np.linspace(0.0, 1.0, 101)
    found = solve_bvp(
        slope, lambda a, b: np.array([a[0] - 1.0, b[1]]), x, np.stack([1 + 0 * x, 0 * x]), tol=1e-10
    )
    lost = 1.0 - np.trapezoid(volts * found.sol(x)[0] - CUTOFF, x) / (volts - CUTOFF)
    return volts * (1.0 - found.sol(1.0)[0]), lost


def main():
    rows = []
    for name, *case in CASES:
        exact, lost = drop(*case)
        rows.append({
            "tether": name, "current [mA]": 1e3 * case[0] * collected(case[3], case[1], case[2], case[4]),
            "drop [V]": exact, "drop, even current [V]": drop_to_first_order(*case),
            "drop/voltage [%]": 100.0 * exact / case[3], "loss of thrust [%]": 100.0 * lost,
        })  # fmt: skip
        print(rows[-1])
    with (HERE / "table.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows({k: v if isinstance(v, str) else f"{v:.4g}" for k, v in r.items()} for r in rows)


if __name__ == "__main__":
    main()
