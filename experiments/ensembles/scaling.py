"""Members a second by number of processes, each on a core of its own; of an ensemble in this process on all
cores; and of single runs, in processes side by side that know nothing of each other.

python experiments/ensembles/scaling.py [FOLDER]     # scaling.csv; some minutes
"""

import csv
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

HERE = Path(__file__).parent
MEMBERS = 96
SINGLE = 24
"""Single runs of a process."""

INTERVAL = 60.0
VARY = ("tethers.length[*]=normal:10e3:10", "initial.spin_rate=normal:4e-3:4e-5")
OBSERVABLES = ("coning_angle", "smallest_tether_distance")
COMMAND = [sys.executable, "-m", "esail_jax", "ensemble", "baseline", "--members", str(MEMBERS), "--quiet"]
COMMAND += [x for text in VARY for x in ("--vary", text)]
COMMAND += ["--observables", ",".join(OBSERVABLES), "--set", f"output.interval={INTERVAL:g}"]


def drawn(members: int):
    """Scene and inputs of so many members."""
    import esail_jax as esail
    from esail_jax.ensembles import draw, parse_variation

    scene = esail.load_scene("baseline", {"output.interval": INTERVAL})
    return scene, draw(scene, [parse_variation(text) for text in VARY], members, 1)


def single_runs(ready, done) -> None:
    """A process's single runs, once all are ready."""
    import esail_jax as esail
    from esail_jax.ensembles import select_members

    scene, inputs = drawn(SINGLE)
    esail.simulate(scene, select_members(inputs, 0))
    ready.wait()
    began = time.perf_counter()
    for member in range(SINGLE):
        esail.simulate(scene, select_members(inputs, member))
    done.put(time.perf_counter() - began)


def of_single_runs(processes: int) -> float:
    """Single runs a second of all processes together."""
    context = multiprocessing.get_context("spawn")
    ready, done = context.Barrier(processes), context.Queue()
    started = [context.Process(target=single_runs, args=(ready, done)) for _ in range(processes)]
    for process in started:
        process.start()
    seconds = [done.get() for _ in started]
    for process in started:
        process.join()
    return processes * SINGLE / max(seconds)


def in_process() -> float:
    """Members a second of an ensemble in this process, on all its cores."""
    from esail_jax.ensembles import MemberRunner

    scene, inputs = drawn(MEMBERS)
    run = MemberRunner(scene, inputs, OBSERVABLES)
    run(np.arange(1))
    began = time.perf_counter()
    for first in range(0, MEMBERS, run.batch):
        run(np.arange(MEMBERS)[first : first + run.batch])
    return MEMBERS / (time.perf_counter() - began)


def of_processes(scratch: Path, count: int) -> tuple[float, float]:
    """Members a second of `esail ensemble` while its processes run members, and seconds of the command."""
    began = time.perf_counter()
    subprocess.run([*COMMAND, "-o", str(scratch), "--processes", str(count)], check=True)
    whole = time.perf_counter() - began
    with h5py.File(scratch / "ensemble.h5") as file:
        return MEMBERS * count / float(file.attrs["wall_time"]), whole


def main(scratch: Path) -> None:
    """Everything with one process, two, and so on, as far as there are cores."""
    most = len(os.sched_getaffinity(0))
    counts = [2**k for k in range(8) if 2**k <= most]
    of_processes(scratch / "first", 1)  # fills the cache of compiled programs
    rows = [("single runs, processes side by side", count, of_single_runs(count), "") for count in counts]
    rows += [("esail ensemble", n, *of_processes(scratch / f"{n}", n)) for n in counts]
    rows.append(("ensemble in one process", 1, in_process(), ""))
    with open(HERE / "scaling.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("way", "processes", "members_per_s", "whole_s"))
        for way, count, rate, whole in rows:
            table.writerow((way, count, f"{rate:.4g}", f"{whole:.4g}" if whole else ""))
            print(way, count, rate, whole, flush=True)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as name:
            main(Path(name))
