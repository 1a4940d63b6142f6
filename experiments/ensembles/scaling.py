"""Members a second by number of processes, each on a core of its own.

python experiments/ensembles/scaling.py [FOLDER]     # scaling.csv; some minutes
"""

import csv
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py

HERE = Path(__file__).parent
MEMBERS = 96
COMMAND = [
    sys.executable, "-m", "esail_jax", "ensemble", "baseline", "--members", str(MEMBERS), "--quiet",
    "--vary", "tethers.length[*]=normal:10e3:10", "--vary", "initial.spin_rate=normal:4e-3:4e-5",
    "--observables", "coning_angle,smallest_tether_distance", "--set", "output.interval=60",
]  # fmt: skip


def main(scratch: Path) -> None:
    """Run with one process, two, and so on; the first run fills the cache of compiled programs."""
    counts = [2**k for k in range(8) if 2**k <= len(os.sched_getaffinity(0))]
    rows = []
    for count in [1, *counts]:
        folder = scratch / f"{count}-{len(rows)}"
        began = time.perf_counter()
        subprocess.run([*COMMAND, "-o", str(folder), "--processes", str(count)], check=True)
        whole = time.perf_counter() - began
        with h5py.File(folder / "ensemble.h5") as file:
            running, compiling = float(file.attrs["wall_time"]), float(file.attrs["compile_time"])
        rows.append((count, whole, running / count, compiling / count, MEMBERS * count / running))
        print(rows[-1], flush=True)
    with open(HERE / "scaling.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("processes", "whole_s", "running_s", "compiling_s", "members_per_s"))
        table.writerows((row[0], *(f"{x:.4g}" for x in row[1:])) for row in rows[1:])


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as found:
        main(Path(sys.argv[1]) if sys.argv[1:] else Path(found))
