"""Measures the engines of an ensemble side by side: two processes of this machine, two workers of Dask, and
two ranks of MPI beside that of the driver.

python experiments/ensembles/engines.py [REPEATS]     # engines.csv; ten minutes with three repeats

The engines take turns. The time of a whole command counts from its start to its end with all programs
kept; that of the workers of Dask and their scheduler, which are started before, is not in it. `second` is
the time from the start of a process of this machine to its first answer, when the program is kept.
"""

import csv
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scaling import MEMBERS, OBSERVABLES, VARY

from esail_jax.ensembles.engines import local
from esail_jax.ensembles.task import about, task_of
from esail_jax.ensembles.work import Program, prepare, this_process

HERE, BIN = Path(__file__).parent, Path(sys.executable).parent
ENSEMBLE = ["ensemble", "baseline", "--members", str(MEMBERS), "--quiet", "--set", "output.interval=60"]
ENSEMBLE += [x for text in VARY for x in ("--vary", text)] + ["--observables", ",".join(OBSERVABLES)]
COMMAND = [sys.executable, "-m", "esail_jax", *ENSEMBLE]
MPI = [
    str(BIN / "mpiexec"),
    "-n",
    "3",
    sys.executable,
    "-m",
    "mpi4py.futures",
    "-m",
    "esail_jax",
    *ENSEMBLE,
]


def whole_time(command: list[str], folder: Path) -> float:
    """Seconds of a whole command."""
    began = time.perf_counter()
    subprocess.run([*command, "-o", str(folder)], check=True)
    return time.perf_counter() - began


def time_of_a_second_process() -> float:
    """Seconds from the start of two processes to the answer of both that the kept program is ready."""
    task = task_of("baseline", MEMBERS, VARY, 0, observables=OBSERVABLES)
    shapes = tuple((key, x.shape[1:]) for key, x in task.draws.of(np.arange(1)).items())
    program = Program(json.dumps(about(task)), shapes, None, this_process())
    began = time.perf_counter()
    with local(2) as executor:
        for future in [executor.submit(prepare, program, "", k) for k in range(2)]:
            future.result()
        return time.perf_counter() - began


def main(repeats: int) -> None:
    """Measures, prints, and writes engines.csv."""
    times: dict[str, list[float]] = {"local": [], "dask": [], "mpi": [], "second": []}
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        file = place / "scheduler.json"
        quiet = {"stderr": subprocess.DEVNULL, "cwd": place}
        dask = str(BIN / "dask")
        started = [
            subprocess.Popen([dask, "scheduler", "--scheduler-file", str(file), "--no-dashboard"], **quiet),
            subprocess.Popen(
                [dask, "worker", "--scheduler-file", str(file), "--nthreads", "1", "--nworkers", "2"],
                env=os.environ | {"NPROC": "1"}, **quiet,
            ),
        ]  # fmt: skip
        commands = {
            "local": [*COMMAND, "--processes", "2"],
            "dask": [*COMMAND, "--engine", f"dask:{file}"],
            "mpi": [*MPI, "--engine", "mpi"],
        }
        try:
            for turn in range(repeats + 1):  # the first turn compiles, and is left out
                for engine, command in commands.items():
                    seconds = whole_time(command, place / f"{engine}{turn}")
                    if turn:
                        times[engine].append(seconds)
                        print(engine, f"{seconds:.2f}", flush=True)
                if turn:
                    times["second"].append(time_of_a_second_process())
        finally:
            for process in reversed(started):
                process.terminate()
                process.wait()
    with open(HERE / "engines.csv", "w", newline="") as table:
        writer = csv.writer(table, lineterminator="\n")
        writer.writerow(("engine", "whole_s", "members_per_s"))
        for engine, seconds in times.items():
            median = statistics.median(seconds)
            rate = "" if engine == "second" else f"{MEMBERS / median:.3g}"
            writer.writerow((engine, f"{median:.3g}", rate))
            print(engine, f"{median:.3g}", rate, flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
