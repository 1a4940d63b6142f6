"""Prints how well the reference of the baseline agrees with the independent code.

python experiments/work_precision/agreement.py
"""

from pathlib import Path

import numpy as np

import esail_jax as esail
from esail_jax.commands.benchmark import REFERENCE, errors, measure

GOLDEN = Path(__file__).parents[2] / "tests" / "physics" / "golden" / "baseline.npz"


def main() -> None:
    """Prints differences relative to the range, at the instants of the independent code's file."""
    method, tolerance = REFERENCE["tethers"]
    run = measure(esail.load_scene("baseline"), method, "tolerance", tolerance, 1)
    exact = np.load(GOLDEN)
    time = esail.load_scene("baseline").output.interval * np.arange(len(run.rows["tip_position_I"]))
    picked = np.searchsorted(time, exact["time"] - 1e-6)
    names = [name for name in exact.files if name in run.rows]
    found = errors({name: np.asarray(run.rows[name])[picked] for name in names}, exact, names)
    for name, error in sorted(found.items(), key=lambda item: -item[1]):
        print(f"{name:24s} {error:.1e}")


if __name__ == "__main__":
    main()
