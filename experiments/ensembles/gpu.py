"""Measures ensembles in lockstep on a GPU: throughput in double precision, time by kernel, and equality.

    python experiments/ensembles/gpu.py METHOD SECONDS MEMBERS [--table FILE] [--kernels FILE]
    python experiments/ensembles/gpu.py METHOD SECONDS MEMBERS --write-rows FILE     # on a CPU
    python experiments/ensembles/gpu.py METHOD SECONDS MEMBERS --compare-rows FILE   # on the GPU

METHOD is `generalized-alpha` (steps of 0.1 s, as in [PGV]), `collocation` (tolerance 1e-8, as in the Monte
Carlo run), or `collocation, default tolerance`. Every member is a baseline sail with its own lengths,
masses, voltages and spin rate, which runs for SECONDS. The script prints the time of compiling and the
median time of a run. `--kernels` adds the time on the GPU by kernel. `--write-rows` runs the first 16
members one after the other on a CPU and writes three observables, with which `--compare-rows` compares.
"""

import argparse
import collections
import csv
import gzip
import json
import statistics
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

import jax
import numpy as np

import esail_jax as esail
from esail_jax.ensembles import MemberRunner, draw, parse_variation, select_members
from esail_jax.ensembles.sampling import Inputs

VARY = (
    "tethers.length[*]=normal:10e3:10",
    "remote_units.mass[*]=normal:1.5:0.015",
    "voltage.value[*]=normal:20e3:200",
    "initial.spin_rate=normal:4e-3:4e-5",
)
NAMES = ("coning_angle", "lagging_angle", "smallest_tether_distance")
METHODS = {
    "generalized-alpha": {"integrator.method": "generalized-alpha", "integrator.step": 0.1},
    "collocation": {"integrator.tolerance": 1e-8},
    "collocation, default tolerance": {},
}
REPEATS = 3
COMPARED = 16
"""Number of members whose observables are compared with another machine's."""
COLUMNS = ("device", "method", "seconds", "members", "compile_s", "run_s", "sails_per_s", "steps_per_s",
           "busy", "kernels_per_run")  # fmt: skip


def median_time(call) -> float:
    """The median time [s] of REPEATS calls."""
    times = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return statistics.median(times)


def kernel_times(call) -> dict[str, tuple[int, float]]:
    """Number of launches and time [s] of every kernel during a call."""
    with tempfile.TemporaryDirectory() as folder:
        with jax.profiler.trace(folder, create_perfetto_trace=True):
            call()
        (file,) = Path(folder).rglob("perfetto_trace.json.gz")
        events = json.loads(gzip.open(file).read())["traceEvents"]
    processes = {e["pid"]: e["args"]["name"] for e in events if e.get("name") == "process_name"}
    threads = {(e["pid"], e["tid"]): e["args"]["name"] for e in events if e.get("name") == "thread_name"}
    found: dict[str, list[float]] = collections.defaultdict(lambda: [0, 0.0])
    for e in events:
        where = processes.get(e.get("pid"), ""), threads.get((e.get("pid"), e.get("tid")), "")
        if e.get("ph") == "X" and "GPU" in where[0] and "Stream" in where[1]:
            found[e["name"]][0] += 1
            found[e["name"]][1] += e["dur"] * 1e-6
    return {name: (int(n), t) for name, (n, t) in sorted(found.items(), key=lambda x: -x[1][1])}


def largest_differences(kept: Mapping[str, np.ndarray], rows: Mapping[str, np.ndarray]) -> dict[str, float]:
    """The largest difference of the first members, relative to the range of each observable."""
    return {
        name: float(np.abs(rows[name][:COMPARED] - kept[name]).max() / np.ptp(kept[name])) for name in NAMES
    }


def measure(scene: esail.Scene, inputs: Inputs, arguments: argparse.Namespace) -> dict:
    """Measures members in lockstep. Returns the row of the table."""
    count = arguments.members
    runner, members = MemberRunner(scene, inputs, NAMES, batch=count, lockstep=True), np.arange(count)
    began = time.perf_counter()
    runner.compile()
    compiled = time.perf_counter() - began
    inputs = select_members(inputs, members)
    found = runner(members, inputs)
    if not found.complete.all():
        raise RuntimeError(f"members {found.failed} have failed")
    run = median_time(lambda: runner(members, inputs))
    row = {
        "device": jax.devices()[0].device_kind, "method": arguments.method, "seconds": arguments.seconds,
        "members": count, "compile_s": compiled, "run_s": run, "sails_per_s": count / run,
        "steps_per_s": found.steps.sum() / run,
    }  # fmt: skip
    if arguments.compare_rows:
        print("differences", largest_differences(np.load(arguments.compare_rows), found.observables))
    if arguments.kernels:
        kernels = kernel_times(lambda: runner(members, inputs))
        row["busy"] = sum(seconds for _, seconds in kernels.values()) / run
        row["kernels_per_run"] = sum(number for number, _ in kernels.values())
        arguments.kernels.write_text(json.dumps(kernels, indent=0))
    return row


def main() -> None:
    """Measures one number of members, or writes rows for comparison."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("method", choices=METHODS)
    parser.add_argument("seconds", type=float)
    parser.add_argument("members", type=int)
    for name in ("--table", "--kernels", "--write-rows", "--compare-rows"):
        parser.add_argument(name, type=Path)
    arguments = parser.parse_args()
    t_end = {"integrator.t_end": arguments.seconds, "output.interval": min(60.0, arguments.seconds)}
    scene = esail.load_scene("baseline", METHODS[arguments.method] | t_end)
    inputs = draw(scene, [parse_variation(text) for text in VARY], arguments.members, 1)
    if arguments.write_rows:
        some = np.arange(COMPARED)
        found = MemberRunner(scene, inputs, NAMES, lockstep=False)(some, select_members(inputs, some))
        np.savez(arguments.write_rows, **found.observables)
        return
    row = measure(scene, inputs, arguments)
    print(*(f"{key} {value}" for key, value in row.items()), sep="\n")
    if arguments.table:
        with open(arguments.table, "a", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            if not file.tell():
                writer.writeheader()
            writer.writerow(row)


if __name__ == "__main__":
    main()
