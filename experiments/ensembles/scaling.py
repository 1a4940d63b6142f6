"""Measures members per second of ensembles and of single runs, by number of processes.

The cases are `esail ensemble` with 1, 2, ... processes (each with its own core), an ensemble in this
process on all cores, and independent processes that make single runs.

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
"""Number of single runs of each process."""

INTERVAL = 60.0
VARY = ("tethers.length[*]=normal:10e3:10", "initial.spin_rate=normal:4e-3:4e-5")
OBSERVABLES = ("coning_angle", "smallest_tether_distance")
COMMAND = [sys.executable, "-m", "esail_jax", "ensemble", "baseline", "--members", str(MEMBERS), "--quiet"]
COMMAND += [x for text in VARY for x in ("--vary", text)]
COMMAND += ["--observables", ",".join(OBSERVABLES), "--set", f"output.interval={INTERVAL:g}"]


def drawn(members: int):
    """The scene and the inputs of `members` members."""
    import esail_jax as esail
    from esail_jax.ensembles import draw, parse_variation

    scene = esail.load_scene("baseline", {"output.interval": INTERVAL})
    return scene, draw(scene, [parse_variation(text) for text in VARY], members, 1)


def single_runs(ready, done) -> None:
    """Makes the single runs of one process, after all processes have compiled; puts their time [s] into
    `done`."""
    import esail_jax as esail
    from esail_jax.ensembles import select_members

    scene, inputs = drawn(SINGLE)
    esail.simulate(scene, select_members(inputs, 0))
    ready.wait()
    began = time.perf_counter()
    for member in range(SINGLE):
        esail.simulate(scene, select_members(inputs, member))
    done.put(time.perf_counter() - began)


def single_run_rate(processes: int) -> float:
    """Single runs per second of all processes together."""
    context = multiprocessing.get_context("spawn")
    ready, done = context.Barrier(processes), context.Queue()
    started = [context.Process(target=single_runs, args=(ready, done)) for _ in range(processes)]
    for process in started:
        process.start()
    seconds = [done.get() for _ in started]
    for process in started:
        process.join()
    return processes * SINGLE / max(seconds)


def in_process_rate() -> float:
    """Members per second of an ensemble in this process, on all its cores."""
    from esail_jax.ensembles import MemberRunner, select_members

    scene, inputs = drawn(MEMBERS)
    run = MemberRunner(scene, inputs, OBSERVABLES)
    run(np.arange(1), select_members(inputs, np.arange(1)))
    began = time.perf_counter()
    for first in range(0, MEMBERS, run.batch):
        members = np.arange(MEMBERS)[first : first + run.batch]
        run(members, select_members(inputs, members))
    return MEMBERS / (time.perf_counter() - began)


def command_rate(scratch: Path, count: int) -> tuple[float, float]:
    """Members per second of `esail ensemble` while members run, and the time [s] of the whole
    command."""
    began = time.perf_counter()
    subprocess.run([*COMMAND, "-o", str(scratch), "--processes", str(count)], check=True)
    whole = time.perf_counter() - began
    with h5py.File(scratch / "ensemble.h5") as file:
        return MEMBERS * count / float(file.attrs["wall_time"]), whole


def main(scratch: Path) -> None:
    """Measures all cases with 1, 2, 4, ... processes, up to the number of cores, and writes scaling.csv."""
    most = len(os.sched_getaffinity(0))
    counts = [2**k for k in range(8) if 2**k <= most]
    command_rate(scratch / "first", 1)  # fills the cache of compiled programs
    rows = [("single runs, processes side by side", count, single_run_rate(count), "") for count in counts]
    rows += [("esail ensemble", n, *command_rate(scratch / f"{n}", n)) for n in counts]
    rows.append(("ensemble in one process", 1, in_process_rate(), ""))
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
